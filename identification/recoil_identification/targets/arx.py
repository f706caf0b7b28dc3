"""Target ``arx``: the transfer function from force to acceleration, equations (32) to (36), with its orders."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_identification.analysis import DEFAULT_WINDOW_S, Identification
from recoil_identification.arx.choice import ArxChoice, choose_model
from recoil_identification.arx.decimated_record import DecimatedRecord, decimated, force_noise_n
from recoil_identification.arx.estimation import robust_covariance
from recoil_identification.arx.mass import (
    GainMass,
    GainMassTrace,
    mass_of_gain,
    mass_over_time,
    noise_attenuation,
    one_step_errors,
    refitted,
    wider_covariance,
)
from recoil_identification.arx.model import ArxModel, ArxOrders
from recoil_identification.arx.orders import order_grid
from recoil_identification.arx.response import dc_gain
from recoil_identification.arx.simulation import fit_percent, predict, simulate
from recoil_identification.arx.verdict import notes_on_model, reasons_against_model
from recoil_identification.report.arx_figures import (
    frequency_figure,
    mass_figure,
    order_figure,
    output_figure,
    pole_figure,
    residual_figure,
    step_figure,
)
from recoil_identification.report.arx_tables import order_rows, parameter_rows, pole_rows, quality_rows, rate_rows
from recoil_identification.report.finding import Finding, Quantity, Series
from recoil_identification.targets.target import Case
from recoil_rigs.assumptions import AREAS

Array = NDArray[np.float64]

LARGEST_NA = LARGEST_NB = 6
"""Of the grid of orders."""
DELAYS = (0, 1, 2)
BANDS = (1.0, 0.7, 0.5)
"""Shares of the shot's cut-off that are tried."""
ORDERS_MARGIN = 6.0
"""Of the criterion, within which other orders might have been chosen: strong evidence begins there (Kass, Raftery)."""
LARGEST_TRACED = 3
"""Coefficients of a model whose gain is followed over time."""


@dataclass(frozen=True, eq=False)
class _Found:
    """What the sections of the page share."""

    case: Case
    shot: Identification
    choice: ArxChoice
    covariance: Array
    band_covariance: Array
    mass: GainMass
    declared: GainMass
    static: GainMass
    attenuation: float
    simulated_m_s2: Array
    predicted_m_s2: Array
    trace: GainMassTrace
    trace_orders: ArxOrders

    @property
    def record(self) -> DecimatedRecord:
        return self.choice.record

    @property
    def model(self) -> ArxModel:
        return self.choice.model


def find(case: Case) -> Finding:
    """Identify the transfer function from force F' to acceleration a' of one shot.

    Both signals pass the shot's low-pass and are decimated to the rate at which they carry errors of their
    own; at the recorder's rate the fit would describe the stress waves, and leave the gain at zero frequency
    to chance.

    Raises
    ------
    IdentificationError
        If an acceleration or a pressure is missing, or no model of any order can be estimated.
    """
    found = _identify(case)
    shot, record, model = found.shot, found.record, found.model
    simulated_fit = fit_percent(record.acceleration_m_s2, found.simulated_m_s2, record.rows)
    errors = one_step_errors(model, record)
    specification = shot.specification_kg
    return Finding(
        target="arx",
        title="Transfer function from force to acceleration",
        summary=(
            f"ARX model ({model.orders}) of the acceleration a' on the force F' of equation (36), {model.n_rows} rows "
            f"at {record.rate_hz:.0f} Hz behind the low-pass; orders by BIC among {len(found.choice.table.candidates)} "
            f"candidates; mass by the gain at zero frequency {found.mass.mass_kg:.1f} kg, fit {simulated_fit:.2f} %."
        ),
        quantities=_quantities(found),
        figures=(
            output_figure(record, found.simulated_m_s2, errors, shot.recorded.interval_s, simulated_fit),
            frequency_figure(model, found.band_covariance, specification),
            residual_figure(found.choice.white, found.choice.independent, record.step_s),
            pole_figure(model),
            step_figure(model, found.band_covariance, specification),
            order_figure(found.choice.table, model),
            mass_figure(record, found.trace, found.mass.mass_kg, specification, str(found.trace_orders)),
        ),
        series=Series(
            {
                "time_s": record.times_s,
                "force_n": record.force_n,
                "acceleration_m_s2": record.acceleration_m_s2,
                "simulated_m_s2": found.simulated_m_s2,
                "predicted_m_s2": found.predicted_m_s2,
                "mass_forgetting_kg": found.trace.forgetting_kg,
                "u_mass_forgetting_kg": found.trace.u_forgetting_kg,
                "mass_finite_history_kg": found.trace.finite_kg,
            }
        ),
        tables=(
            parameter_rows(model, found.covariance),
            quality_rows(
                model,
                record,
                found.simulated_m_s2,
                found.choice.white,
                found.choice.independent,
                found.attenuation,
                found.static,
            ),
            order_rows(found.choice.table, model),
            pole_rows(model),
            rate_rows(shot, record, model),
        ),
        reasons=(
            *(f"the mass of this shot is in doubt: {reason}" for reason in shot.reasons),
            *reasons_against_model(found.choice, found.mass, found.static, found.attenuation, simulated_fit),
        ),
        notes=notes_on_model(found.choice, found.mass, found.static),
        parameters={
            "na": model.orders.na,
            "nb": model.orders.nb,
            "delay": model.orders.delay,
            "criterion": found.choice.table.criterion,
            "step_s": record.step_s,
            "stride": record.stride,
            "cutoff_hz": None if record.low_pass is None else record.low_pass.cutoff_hz,
            "rows": model.n_rows,
            "fit_percent": simulated_fit if math.isfinite(simulated_fit) else None,
            "fpe_m2_s4": model.fpe,
            "loss_m2_s4": model.loss,
            "aic": model.aic,
            "bic": model.bic,
            "whiteness_p": found.choice.white.p_value,
            "independence_p": found.choice.independent.p_value,
            "window_rows": found.trace.window,
            "forgetting": found.trace.forgetting,
        },
    )


def _identify(case: Case) -> _Found:
    shot = case.identified
    filtered, calibration = shot.filtered, shot.inertial.calibration
    acceleration, force = calibration.correct(filtered)
    grid = order_grid(range(LARGEST_NA + 1), range(LARGEST_NB + 1), DELAYS)
    choice = choose_model(lambda share: decimated(filtered, acceleration, force, share=share), BANDS, grid)
    record, model = choice.record, choice.model
    corrected, as_declared = shot.results["calibrated"].estimate, shot.results["reverse"].estimate
    # scales as declared, zeros as found
    plain = decimated(
        filtered, acceleration * (1.0 + calibration.acceleration_error), filtered.force_n, share=choice.share
    )
    areas = {area: getattr(case.rig.mechanism, area) for area in AREAS}
    noise = math.nan if record.low_pass is None else force_noise_n(shot.signals, areas, record.low_pass)
    simulated = simulate(model, record.force_n, record.acceleration_m_s2)
    # a model of many coefficients knows its gain only after a long memory
    trace_orders = model.orders if model.orders.n_parameters <= LARGEST_TRACED else ArxOrders()
    return _Found(
        case=case,
        shot=shot,
        choice=choice,
        covariance=robust_covariance(model, record.force_n, record.acceleration_m_s2, rows=choice.table.estimation),
        band_covariance=wider_covariance(model, record),
        mass=mass_of_gain(model, record, choice.table.near(ORDERS_MARGIN), corrected.u_kg / corrected.mass_kg),
        declared=mass_of_gain(refitted(plain, model.orders), plain, (), as_declared.u_kg / as_declared.mass_kg),
        static=mass_of_gain(refitted(record, ArxOrders()), record, (), corrected.u_kg / corrected.mass_kg),
        attenuation=noise_attenuation(record, noise),
        simulated_m_s2=np.where(np.isfinite(simulated), simulated, np.nan),
        predicted_m_s2=predict(model, record.force_n, record.acceleration_m_s2),
        trace=mass_over_time(record, trace_orders, shot.options.window_s or DEFAULT_WINDOW_S),
        trace_orders=trace_orders,
    )


def _quantities(found: _Found) -> tuple[Quantity, ...]:
    shot = found.shot
    specification, u_specification = shot.specification_kg, shot.u_specification_kg
    mass, declared = found.mass, found.declared
    gain, relative = dc_gain(found.model), mass.u_kg / mass.mass_kg
    return (
        Quantity(
            "mass by the gain at zero frequency",
            "m_dc",
            mass.mass_kg,
            mass.u_kg,
            "kg",
            f"A(1) / B(1), sensors' errors as calibrated in this shot; u by residuals {mass.u_random_kg:.2g} kg, by "
            f"orders {mass.u_orders_kg:.2g} kg, by sensors, friction and clocks {mass.u_other_kg:.2g} kg",
            specification,
            u_specification,
        ),
        Quantity(
            "mass by the gain at zero frequency, sensors as declared",
            "m_dc_declared",
            declared.mass_kg,
            declared.u_kg,
            "kg",
            "A(1) / B(1) of the same orders with every sensor's scale as its certificate has it",
            specification,
            u_specification,
        ),
        Quantity(
            "gain at zero frequency",
            "G_dc",
            gain.value,
            abs(gain.value) * relative,
            "1/kg",
            "B(1) / A(1), acceleration per force",
            1.0 / specification,
            u_specification / specification**2,
        ),
    )
