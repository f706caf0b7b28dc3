"""The tables of an ARX model from force to acceleration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_identification.analysis import Identification
from recoil_identification.arx.choice import count_of_lags
from recoil_identification.arx.decimated_record import DecimatedRecord, decimated
from recoil_identification.arx.mass import GainMass, mass_of_gain, one_step_errors, refitted
from recoil_identification.arx.model import ArxModel, ArxOrders
from recoil_identification.arx.orders import OrderTable
from recoil_identification.arx.residual_tests import ResidualTest, whiteness
from recoil_identification.arx.response import poles, zeros
from recoil_identification.arx.simulation import fit_percent, predict
from recoil_identification.report.finding import Table
from recoil_identification.report.rounding import plain, rounded, significant

Array = NDArray[np.float64]

SHOWN_CANDIDATES = 12
HORIZONS = (1, 5, 20)
"""Samples ahead of the predictions whose fit is shown."""
RECORDED_ORDERS = (ArxOrders(), ArxOrders(10, 10), ArxOrders(20, 20))
"""Fitted at the recorder's rate for comparison."""


def parameter_rows(model: ArxModel, covariance: Array) -> Table:
    """List the coefficients with their standard errors.

    Parameters
    ----------
    covariance : ndarray, shape (n_parameters, n_parameters)
        For residuals that may be correlated.
    """
    robust = np.sqrt(np.diag(covariance))
    units = ["1"] * model.orders.na + ["1/kg"] * (model.orders.nb + 1)
    rows = []
    for name, value, own, wide, unit in zip(
        model.orders.names, model.parameters, model.standard_errors, robust, units, strict=True
    ):
        rows.append((name, *rounded(float(value), float(own)), significant(float(wide), 2), unit))
    return Table(
        "Parameters",
        "Coefficients of A and B; the first standard error is for white residuals, the second allows for correlation "
        "in time and a changing size.",
        ("coefficient", "value", "standard error", "robust standard error", "unit"),
        tuple(rows),
    )


def quality_rows(
    model: ArxModel,
    record: DecimatedRecord,
    simulated_m_s2: Array,
    white: ResidualTest,
    independent: ResidualTest,
    attenuation: float,
    static: GainMass,
) -> Table:
    """List how well the model does.

    Parameters
    ----------
    simulated_m_s2 : ndarray, shape (n,)
    attenuation
        Share of the force's energy that is noise.
    static
        By na = nb = d = 0.
    """
    a, rows = record.acceleration_m_s2, record.rows
    listed = [("fit of the simulation, %", plain(fit_percent(a, simulated_m_s2, rows)))]
    listed += [
        (f"fit of predictions, {k} ahead, %", plain(fit_percent(a, predict(model, record.force_n, a, k), rows)))
        for k in HORIZONS
    ]
    listed += [
        ("final prediction error (Akaike), m^2/s^4", significant(model.fpe, 4)),
        ("loss function, m^2/s^4", significant(model.loss, 4)),
        ("AIC", plain(model.aic)),
        ("BIC", plain(model.bic)),
        (
            f"Ljung-Box, chi-squared ({white.degrees_of_freedom} degrees of freedom)",
            f"{significant(white.statistic, 3)}, p = {significant(white.p_value, 2)}",
        ),
        (
            f"residual and force, chi-squared ({independent.degrees_of_freedom} degrees of freedom)",
            f"{significant(independent.statistic, 3)}, p = {significant(independent.p_value, 2)}",
        ),
        ("noise in the force, share of its energy", significant(attenuation, 2)),
        ("mass raised by that noise (na = nb = 0), kg", significant(attenuation * static.mass_kg, 2)),
        ("mass without past samples (na = nb = d = 0), kg", rounded(static.mass_kg, static.u_random_kg)[0]),
    ]
    return Table("Quality", "On the rows of the identification interval.", ("figure", "value"), tuple(listed))


def order_rows(table: OrderTable, chosen: ArxModel) -> Table:
    """List the best candidates."""
    best = table.ranked[0].score(table.criterion)
    shown = list(table.ranked[:SHOWN_CANDIDATES])
    shown += [c for c in table.ranked[SHOWN_CANDIDATES:] if c.orders in (chosen.orders, ArxOrders())]
    rows = []
    for c in shown:
        if c.model is None:
            continue
        o, m = c.orders, c.model
        mark = " (chosen)" if o == chosen.orders else ""
        rows.append(
            (
                f"{o.na}, {o.nb}, {o.delay}{mark}",
                str(o.n_parameters),
                significant(m.loss, 4),
                significant(m.fpe, 4),
                f"{m.aic:.1f}",
                f"{m.bic:.1f}",
                f"{c.score(table.criterion) - best:.1f}",
                significant(c.whiteness_p, 2),
            )
        )
    refused = sum(c.model is None for c in table.candidates)
    return Table(
        "Orders",
        f"The best of {len(table.candidates)} candidates by {table.criterion.upper()}, all fitted to the same "
        f"{int(table.estimation.sum())} rows; {refused} could not be estimated.",
        ("na, nb, d", "parameters", "loss", "FPE", "AIC", "BIC", "above the least", "whiteness p"),
        tuple(rows),
    )


def pole_rows(model: ArxModel) -> Table:
    """List poles and zeros."""
    found = poles(model)
    rows = []
    for value, u, f, damping in zip(found.values, found.u_modulus, found.frequency_hz, found.damping, strict=True):
        modulus, u_text = rounded(float(abs(value)), float(u))
        rows.append(("pole", _complex(value), modulus, u_text, significant(f, 3), significant(damping, 2)))
    rows += [("zero", _complex(value), significant(float(abs(value)), 3), "", "", "") for value in zeros(model)]
    verdict = "stable" if found.stable else "unstable"
    return Table(
        "Poles and zeros",
        f"In the z plane at {1.0 / model.step_s:.0f} Hz: {verdict}.",
        ("kind", "place", "modulus", "u", "frequency, Hz", "damping ratio"),
        tuple(rows),
    )


def rate_rows(shot: Identification, record: DecimatedRecord, model: ArxModel) -> Table:
    """Compare the decimated record with the recorder's rate.

    Parameters
    ----------
    model
        Of the decimated record.
    """
    rows = [_rate_row("low-pass, decimated", record, model)]
    recorded = shot.recorded
    if shot.filtered.shifts is None:
        raw = decimated(recorded, *shot.calibration.correct(recorded))
        for orders in RECORDED_ORDERS:
            try:
                rows.append(_rate_row("as recorded", raw, refitted(raw, orders)))
            except IdentificationError as error:
                rows.append(("as recorded", str(orders), f"{raw.rate_hz:.0f}", "", "", str(error)))
    return Table(
        "Why decimated",
        "Fits at the recorder's rate: where their residuals are not white (p below 0.01), the stress waves are "
        "in them, and their uncertainty of the mass is that of so much correlation.",
        ("signals", "orders", "rate, Hz", "mass, kg", "u by residuals, kg", "whiteness p"),
        tuple(rows),
    )


def _rate_row(name: str, record: DecimatedRecord, model: ArxModel) -> tuple[str, ...]:
    mass = mass_of_gain(model, record, (), 0.0)
    errors = one_step_errors(model, record)
    lags = count_of_lags(model.n_rows, model.orders.na)
    p_value = whiteness(errors, lags, n_dynamic=model.orders.na).p_value
    return (
        name,
        str(model.orders),
        f"{record.rate_hz:.0f}",
        *rounded(mass.mass_kg, mass.u_random_kg),
        significant(p_value, 2),
    )


def _complex(value: complex) -> str:
    if abs(value.imag) < 1e-12:
        return significant(value.real, 4)
    sign = "+" if value.imag > 0 else "\N{MINUS SIGN}"
    return f"{significant(value.real, 4)} {sign} {significant(abs(value.imag), 4)}i"
