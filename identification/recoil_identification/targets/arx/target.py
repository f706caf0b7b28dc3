"""Target ``arx``: the transfer function from force to acceleration, equations (32) to (36), with its orders."""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.remark import Note, NoteCode
from recoil_identification.estimate.mass import MassEstimate
from recoil_identification.estimate.rounding import rounded, significant
from recoil_identification.report.document.report_files import stated
from recoil_identification.targets.arx.choice import choose_model, order_grid
from recoil_identification.targets.arx.decimated_record import decimated, force_noise_n
from recoil_identification.targets.arx.figures import frequency_figure, order_figure, output_figure, residual_figure
from recoil_identification.targets.arx.mass import mass_of_gain, noise_attenuation, wider_covariance
from recoil_identification.targets.arx.model import ArxOrders, fit_percent, residuals, robust_covariance, simulate
from recoil_identification.targets.arx.tables import order_rows, parameter_rows, pole_rows, quality_rows
from recoil_identification.targets.arx.verdict import notes_on_model, reasons_against_model
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import Quantity, Series, TargetResult

GRID = order_grid(range(5), range(5), range(3))
"""Orders that are tried."""
BANDS = (1.0, 0.7, 0.5)
"""Shares of the shot's cut-off that are tried."""
ORDERS_MARGIN = 6.0
"""Margin of the criterion within which other orders might have been chosen: strong evidence begins there (Kass,
Raftery)."""


def find(case: Case) -> TargetResult:
    """Identify the transfer function from force F' to acceleration a' of one shot.

    Both signals pass the shot's low-pass and are decimated to the rate at which they carry errors of their
    own; at the recorder's rate the fit would describe the stress waves, and leave the gain at zero frequency
    to chance. Orders, residuals and responses are those of the signals as the shot's calibration corrects them;
    the mass is that of the same orders with every sensor as its certificate has it, so that it owes the shot's
    mass nothing.

    Raises
    ------
    IdentificationError
        If an acceleration or a pressure is missing, or no model of any order can be estimated.
    """
    shot = case.identified
    filtered, specification_kg = shot.route.filtered, shot.specification.mass_kg
    corrected = shot.inertial.calibration.correct(filtered)
    choice = choose_model(lambda share: decimated(filtered, *corrected, share=share), BANDS, GRID)
    record, model = choice.record, choice.model
    declared = decimated(filtered, filtered.acceleration_m_s2, filtered.force_n, share=choice.share)
    by_certificates, of_shot = shot.results["reverse"].estimate, shot.inertial.calibration.estimate
    other_rel = by_certificates.u_kg / by_certificates.mass_kg
    near = [one.orders for one in choice.table.near(ORDERS_MARGIN)]
    mass, static = mass_of_gain(declared, model.orders, near, other_rel), mass_of_gain(declared, ArxOrders())
    forces = case.fired.rig.forces
    noise_n = math.nan if record.low_pass is None else force_noise_n(shot.route.signals, forces, record.low_pass)
    attenuation = noise_attenuation(record, noise_n)
    simulated = simulate(model, record.force_n, record.acceleration_m_s2)
    simulated[~np.isfinite(simulated)] = np.nan
    fit = fit_percent(record.acceleration_m_s2, simulated, record.rows)
    errors = np.where(record.rows, residuals(model, record.force_n, record.acceleration_m_s2), np.nan)
    covariance = robust_covariance(model, record.force_n, record.acceleration_m_s2, rows=choice.table.rows)
    return TargetResult(
        target="arx",
        title="Transfer function from force to acceleration",
        summary=(
            f"ARX model ({model.orders}) of the acceleration a' on the force F' of equation (36), {model.n_rows} rows "
            f"at {record.rate_hz:.0f} Hz behind the low-pass; orders by BIC among {len(GRID)} candidates; mass by the "
            f"gain at zero frequency, sensors as declared, {rounded(mass.mass_kg, mass.u_kg)[0]} kg, fit {fit:.2f} %."
        ),
        quantities=(
            Quantity(
                "mass by the gain at zero frequency",
                "m_dc",
                mass.mass_kg,
                mass.u_kg,
                "kg",
                "A(1) / B(1), every sensor as its certificate has it; u by residuals "
                f"{mass.u_random_kg:.2g} kg, by orders {mass.u_orders_kg:.2g} kg, by sensors, friction and clocks "
                f"{mass.u_other_kg:.2g} kg",
                specification_kg,
                shot.specification.u_kg,
                of_recoiling_part=True,
            ),
            Quantity(
                "gain at zero frequency",
                "G_dc",
                1.0 / mass.mass_kg,
                mass.u_kg / mass.mass_kg**2,
                "1/kg",
                "B(1) / A(1), acceleration per force",
                1.0 / specification_kg,
                shot.specification.u_kg / specification_kg**2,
            ),
        ),
        figures=(
            output_figure(record, simulated, errors, shot.route.recorded.interval_s, fit),
            frequency_figure(model, wider_covariance(model, record), specification_kg),
            residual_figure(choice.white, choice.independent, record.step_s),
            order_figure(choice.table, model),
        ),
        series=Series(
            {
                "time_s": record.times_s,
                "force_n": record.force_n,
                "acceleration_m_s2": record.acceleration_m_s2,
                "simulated_m_s2": simulated,
                "predicted_m_s2": record.acceleration_m_s2 - errors,
            }
        ),
        tables=(
            parameter_rows(model, covariance),
            quality_rows(model, fit, choice.white, choice.independent, attenuation, static),
            order_rows(choice.table, model),
            pole_rows(model),
        ),
        reasons=(
            *(reason.again(f"the mass of this shot is in doubt: {reason}") for reason in shot.reasons),
            *reasons_against_model(choice, mass, static, attenuation, fit),
        ),
        notes=(*notes_on_model(choice, mass, static), _beside_the_shots_mass(mass.mass_kg, of_shot)),
        parameters={
            **stated(model.orders, "na", "nb", "delay"),
            "criterion": "bic",
            **stated(record, "step_s", "stride"),
            "cutoff_hz": None if record.low_pass is None else record.low_pass.cutoff_hz,
            "rows": model.n_rows,
            "fit_percent": fit if math.isfinite(fit) else None,
            "loss_m2_s4": model.loss,
            "bic": model.bic,
            "whiteness_p": choice.white.p_value,
            "independence_p": choice.independent.p_value,
        },
    )


def _beside_the_shots_mass(mass_kg: float, of_shot: MassEstimate) -> Note:
    """Say why both differ."""
    return Note(
        NoteCode.COMPARISON,
        "m_dc",
        f"m_dc differs by {significant(mass_kg - of_shot.mass_kg, 2)} kg from the shot's mass, "
        f"{rounded(of_shot.mass_kg, of_shot.u_kg)[0]} kg, which has found the sensors' scales and zeros within their "
        "certificates; m_dc takes them as declared, so that it owes that mass nothing",
    )
