"""The figures of an ARX model from force to acceleration."""

from __future__ import annotations

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.normal_distribution import probability_text
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.report.figure.figure import (
    TIME,
    ZERO,
    Figure,
    HorizontalLine,
    Panel,
    Span,
    Trace,
    with_interval,
)
from recoil_identification.targets.arx.choice import OrderTable
from recoil_identification.targets.arx.decimated_record import DecimatedRecord
from recoil_identification.targets.arx.model import ArxModel
from recoil_identification.targets.arx.residual_tests import LEVEL, ResidualTest
from recoil_identification.targets.arx.response import frequency_response

SHOWN_CRITERION = 60.0
"""Above the least one; a candidate beyond it is far from any choice."""


def output_figure(
    record: DecimatedRecord, simulated_m_s2: Array, errors_m_s2: Array, interval_s: tuple[float, float], fit: float
) -> Figure:
    """Draw measured against simulated acceleration, and what is left.

    Parameters
    ----------
    simulated_m_s2, errors_m_s2 : ndarray, shape (n,)
        Acceleration simulated by the force alone, and the errors one sample ahead.
    fit
        Fit of the simulation, %.
    """
    t, a = record.times_s, record.acceleration_m_s2
    margin = 0.12 * (interval_s[1] - interval_s[0])
    spans = (Span("identification interval", *interval_s),)
    return Figure(
        "arx-output",
        "Measured and simulated acceleration",
        f"The model is driven by the measured force alone: fit {fit:.2f} %.",
        TIME,
        (
            Panel(
                "a', m/s²",
                (
                    Trace("measured", t, a, "filtered", "m/s²"),
                    Trace("simulated", t, simulated_m_s2, "model", "m/s²"),
                ),
                spans=spans,
            ),
            Panel(
                "difference, m/s²",
                (
                    Trace("measured − simulated", t, a - simulated_m_s2, "filtered", "m/s²"),
                    Trace("error one sample ahead", t, errors_m_s2, "model", "m/s²"),
                ),
                (ZERO,),
                spans,
            ),
        ),
        shown=(interval_s[0] - margin, interval_s[1] + margin),
    )


def residual_figure(white: ResidualTest, independent: ResidualTest, step_s: float) -> Figure:
    """Draw both correlations of the residuals with their bands.

    Parameters
    ----------
    white, independent
        Autocorrelation, and cross-correlation with the force.
    """
    panels = []
    for test, label in ((white, "autocorrelation"), (independent, "cross-correlation with the force")):
        shown = slice(1, None) if test is white else slice(None)
        lags, band = 1e3 * step_s * test.lags[shown], np.where(np.isfinite(test.band), test.band, 0.0)[shown]
        level = f"{100 * LEVEL:g} % band"
        panels.append(
            Panel(
                label,
                (
                    Trace(level, lags, np.zeros(lags.size), "band", "", -band, band),
                    Trace(label, lags, test.correlation[shown], "bars", ""),
                ),
                (ZERO,),
                x_label="lag, ms",
            )
        )
    return Figure(
        "arx-residuals",
        "Are the residuals white, and do they still follow the force?",
        f"Within the bands by chance; all lags together: {probability_text(white.p_value)} and "
        f"{probability_text(independent.p_value)}.",
        "lag, ms",
        tuple(panels),
    )


def frequency_figure(model: ArxModel, covariance: Array, specification_kg: float) -> Figure:
    """Draw magnitude and phase over frequency with their 95 % bands.

    Parameters
    ----------
    covariance : ndarray, shape (n_parameters, n_parameters)
    """
    half_rate = 0.5 / model.step_s
    response = frequency_response(model, np.geomspace(1e-3 * half_rate, half_rate, 400), covariance)
    low, high = response.magnitude_band(COVERAGE_FACTOR)
    phase = np.degrees(response.phase_rad)
    f = response.frequencies_hz
    ratio, ratio_low, ratio_high = (100.0 * (specification_kg * one - 1.0) for one in (response.magnitude, low, high))
    return Figure(
        "arx-frequency-response",
        "Frequency response from force to acceleration",
        "A rigid mass has the magnitude 1/m and no phase at every frequency, here m by specification. Signals as the "
        "shot's calibration corrects them: look at the shape, the level is the shot's own. 95 % bands by the "
        "residuals.",
        "frequency, Hz",
        (
            Panel(
                "magnitude, 1/kg",
                (Trace("|G|, 95 % interval", f, response.magnitude, "band", "1/kg", low, high),),
                (HorizontalLine(f"1 / {specification_kg:g} kg", 1.0 / specification_kg, "specification"),),
                y_scale="log",
                y_shown=(0.2 / specification_kg, 5.0 / specification_kg),
            ),
            Panel(
                "|G| above 1/m, %",
                (Trace("|G| above 1/m, 95 % interval", f, ratio, "band", "%", ratio_low, ratio_high),),
                (HorizontalLine(f"1 / {specification_kg:g} kg", 0.0, "specification"),),
            ),
            Panel(
                "phase, degrees",
                (with_interval("phase, 95 % interval", f, phase, np.degrees(response.u_phase_rad), "degrees"),),
                (ZERO,),
            ),
        ),
        x_scale="log",
    )


def order_figure(table: OrderTable, chosen: ArxModel) -> Figure:
    """Draw the criterion of every candidate over its number of parameters."""
    models = [model for model, _ in table.ranked]
    count = np.array([model.orders.n_parameters for model in models], dtype=np.float64)
    above = np.array([model.bic for model in models]) - models[0].bic
    numbers = np.unique(count)
    least = np.array([above[count == n].min() for n in numbers])
    return Figure(
        "arx-orders",
        "Choice of the orders",
        f"BIC above the least one of all candidates, all fitted to the same rows; chosen: {chosen.orders}.",
        "number of parameters",
        (
            Panel(
                "BIC above the least",
                (
                    Trace("candidates", count, above, "points"),
                    Trace("least of the number", numbers, least, "model"),
                    Trace("chosen", [chosen.orders.n_parameters], [chosen.bic - models[0].bic], "points"),
                ),
                y_shown=(-0.05 * SHOWN_CRITERION, SHOWN_CRITERION),
            ),
        ),
    )
