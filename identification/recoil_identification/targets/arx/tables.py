"""The tables of an ARX model from force to acceleration."""

from __future__ import annotations

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.normal_distribution import probability_text
from recoil_identification.estimate.rounding import MINUS, plain, rounded, significant
from recoil_identification.targets.arx.choice import OrderTable
from recoil_identification.targets.arx.mass import GainMass
from recoil_identification.targets.arx.model import ArxModel, ArxOrders
from recoil_identification.targets.arx.residual_tests import ResidualTest
from recoil_identification.targets.arx.response import poles, zeros
from recoil_identification.targets.target_result import Table

SHOWN_CANDIDATES = 12


def parameter_rows(model: ArxModel, covariance: Array) -> Table:
    """List the coefficients with their standard errors.

    Parameters
    ----------
    covariance : ndarray, shape (n_parameters, n_parameters)
        Covariance for residuals that may be correlated.
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
    model: ArxModel, fit: float, white: ResidualTest, independent: ResidualTest, attenuation: float, static: GainMass
) -> Table:
    """List how well the model does.

    Parameters
    ----------
    fit
        Fit of the simulation, %.
    attenuation
        Share of the force's energy that is noise.
    static
        Mass by na = nb = d = 0.
    """
    tests = (("Ljung-Box", white), ("residual and force", independent))
    listed = [
        ("fit of the simulation, %", plain(fit)),
        ("loss function, m^2/s^4", significant(model.loss, 4)),
        ("BIC", plain(model.bic)),
        *(
            (
                f"{name}, chi-squared ({test.degrees_of_freedom} degrees of freedom)",
                f"{significant(test.statistic, 3)}, {probability_text(test.p_value)}",
            )
            for name, test in tests
        ),
        ("noise in the force, share of its energy", significant(attenuation, 2)),
        ("mass raised by that noise (na = nb = 0), kg", significant(attenuation * static.mass_kg, 2)),
        ("mass without past samples (na = nb = d = 0), kg", rounded(static.mass_kg, static.u_random_kg)[0]),
    ]
    return Table("Quality", "On the rows of the identification interval.", ("figure", "value"), tuple(listed))


def order_rows(table: OrderTable, chosen: ArxModel) -> Table:
    """List the best candidates."""
    ranked = table.ranked
    rows = []
    for place, (model, candidate) in enumerate(ranked):
        orders = model.orders
        if place >= SHOWN_CANDIDATES and orders not in (chosen.orders, ArxOrders()):
            continue
        rows.append(
            (
                f"{orders.na}, {orders.nb}, {orders.delay}" + (" (chosen)" if orders == chosen.orders else ""),
                str(orders.n_parameters),
                significant(model.loss, 4),
                f"{model.bic:.1f}",
                f"{model.bic - ranked[0][0].bic:.1f}",
                "" if candidate.white is None else significant(candidate.white.p_value, 2),
            )
        )
    return Table(
        "Orders",
        f"The best of {len(table.candidates)} candidates by BIC, all fitted to the same {int(table.rows.sum())} rows; "
        f"{len(table.candidates) - len(ranked)} could not be estimated.",
        ("na, nb, d", "parameters", "loss", "BIC", "above the least", "whiteness p"),
        tuple(rows),
    )


def pole_rows(model: ArxModel) -> Table:
    """List poles and zeros."""
    found = poles(model)
    rows = []
    for value, f, damping in zip(found.values, found.frequency_hz, found.damping, strict=True):
        modulus = significant(float(abs(value)), 3)
        rows.append(("pole", _complex(value), modulus, significant(f, 3), significant(damping, 2)))
    rows += [("zero", _complex(value), significant(float(abs(value)), 3), "", "") for value in zeros(model)]
    verdict = "stable" if found.stable else "unstable"
    return Table(
        "Poles and zeros",
        f"In the z plane at {1.0 / model.step_s:.0f} Hz: {verdict}.",
        ("kind", "place", "modulus", "frequency, Hz", "damping ratio"),
        tuple(rows),
    )


def _complex(value: complex) -> str:
    if abs(value.imag) < 1e-12:
        return significant(value.real, 4)
    sign = "+" if value.imag > 0 else MINUS
    return f"{significant(value.real, 4)} {sign} {significant(abs(value.imag), 4)}i"
