"""The figures of an ARX model from force to acceleration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_identification.arx.decimated_record import DecimatedRecord
from recoil_identification.arx.mass import GainMassTrace
from recoil_identification.arx.model import ArxModel
from recoil_identification.arx.orders import OrderTable
from recoil_identification.arx.residual_tests import ResidualTest
from recoil_identification.arx.response import frequency_response, poles, step_response, zeros
from recoil_identification.budget import COVERAGE_FACTOR
from recoil_identification.report.figure import Figure, HorizontalLine, Panel, Span, Trace

Array = NDArray[np.float64]
TIME = "time on the reference clock, s"
STEP_SAMPLES = 40
"""Samples of the step response."""
SHOWN_CRITERION = 60.0
"""Above the least one; a candidate beyond it is far from any choice."""


def output_figure(
    record: DecimatedRecord, simulated_m_s2: Array, errors_m_s2: Array, interval_s: tuple[float, float], fit: float
) -> Figure:
    """Draw measured against simulated acceleration, and what is left.

    Parameters
    ----------
    simulated_m_s2, errors_m_s2 : ndarray, shape (n,)
        By the force alone; and the errors one sample ahead.
    fit
        Of the simulation, %.
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
                "a', m/s^2",
                (
                    Trace("measured", t, a, "filtered", "m/s^2"),
                    Trace("simulated", t, simulated_m_s2, "model", "m/s^2"),
                ),
                spans=spans,
            ),
            Panel(
                "difference, m/s^2",
                (
                    Trace("measured - simulated", t, a - simulated_m_s2, "filtered", "m/s^2"),
                    Trace("error one sample ahead", t, errors_m_s2, "model", "m/s^2"),
                ),
                (HorizontalLine("zero", 0.0, "mean"),),
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
        level = f"{100 * test.level:g} % band"
        panels.append(
            Panel(
                label,
                (
                    Trace(level, lags, np.zeros(lags.size), "band", "", -band, band),
                    Trace(label, lags, test.correlation[shown], "bars", ""),
                ),
                (HorizontalLine("zero", 0.0, "mean"),),
                x_label="lag, ms",
            )
        )
    return Figure(
        "arx-residuals",
        "Are the residuals white, and do they still follow the force?",
        f"Within the bands by chance; all lags together: p = {white.p_value:.3g} and p = {independent.p_value:.3g}.",
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
    half = COVERAGE_FACTOR * np.degrees(response.u_phase_rad)
    f = response.frequencies_hz
    ratio, ratio_low, ratio_high = (100.0 * (specification_kg * one - 1.0) for one in (response.magnitude, low, high))
    return Figure(
        "arx-frequency-response",
        "Frequency response from force to acceleration",
        "A rigid mass has the magnitude 1/m and no phase at every frequency, here m by specification; 95 % bands by "
        "the residuals, without the sensors' scales.",
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
                (Trace("phase, 95 % interval", f, phase, "band", "degrees", phase - half, phase + half),),
                (HorizontalLine("zero", 0.0, "mean"),),
            ),
        ),
        x_scale="log",
    )


def step_figure(model: ArxModel, covariance: Array, specification_kg: float) -> Figure:
    """Draw the response to one newton more, with its 95 % band.

    Parameters
    ----------
    covariance : ndarray, shape (n_parameters, n_parameters)
    """
    response = step_response(model, STEP_SAMPLES, covariance)
    half = COVERAGE_FACTOR * response.u
    values, times = response.values, 1e3 * response.times_s
    return Figure(
        "arx-step",
        "Step response",
        "Acceleration after a step of the force by 1 N; a rigid mass answers at once, and then no more. 95 % band by "
        "the residuals.",
        "time, ms",
        (
            Panel(
                "a', m/s^2 per N",
                (Trace("step response, 95 % interval", times, values, "band", "1/kg", values - half, values + half),),
                (HorizontalLine(f"1 / {specification_kg:g} kg", 1.0 / specification_kg, "specification"),),
            ),
        ),
    )


def pole_figure(model: ArxModel) -> Figure:
    """Draw poles and zeros in the z plane beside the unit circle."""
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    of_model, of_zeros = poles(model).values, zeros(model)
    near = np.abs(np.concatenate([of_model, of_zeros[np.abs(of_zeros) < 3.0]]))
    reach = 1.1 * float(np.max(near, initial=1.0))
    return Figure(
        "arx-poles",
        "Poles and zeros",
        "Poles within the unit circle are stable; a zero upon a pole cancels it, which is how noise is modelled "
        "where force and acceleration are proportional.",
        "real part",
        (
            Panel(
                "imaginary part",
                (
                    Trace("unit circle", np.cos(turn), np.sin(turn), "reference"),
                    Trace("poles", of_model.real, of_model.imag, "points"),
                    Trace("zeros", of_zeros.real, of_zeros.imag, "points"),
                ),
                y_shown=(-reach, reach),
            ),
        ),
        shown=(-reach, reach),
    )


def order_figure(table: OrderTable, chosen: ArxModel) -> Figure:
    """Draw the criterion of every candidate over its number of parameters."""
    found = [c for c in table.candidates if c.model is not None]
    count = np.array([c.orders.n_parameters for c in found], dtype=np.float64)
    score = np.array([c.score(table.criterion) for c in found])
    numbers = np.unique(count)
    least = np.array([score[count == n].min() for n in numbers])
    of_chosen = next(c.score(table.criterion) for c in found if c.orders == chosen.orders)
    name, best = table.criterion.upper(), float(score.min())
    return Figure(
        "arx-orders",
        "Choice of the orders",
        f"{name} above the least one of all candidates, all fitted to the same rows; chosen: {chosen.orders}.",
        "number of parameters",
        (
            Panel(
                f"{name} above the least",
                (
                    Trace("candidates", count, score - best, "points"),
                    Trace("least of the number", numbers, least - best, "model"),
                    Trace("chosen", [chosen.orders.n_parameters], [of_chosen - best], "points"),
                ),
                y_shown=(-0.05 * SHOWN_CRITERION, SHOWN_CRITERION),
            ),
        ),
    )


def mass_figure(
    record: DecimatedRecord, trace: GainMassTrace, mass_kg: float, specification_kg: float, orders_text: str
) -> Figure:
    """Draw the mass over time by both memories.

    Parameters
    ----------
    mass_kg, specification_kg
        Of the whole interval; by specification.
    orders_text
        Of the models.
    """
    half = COVERAGE_FACTOR * trace.u_forgetting_kg
    mass, t = trace.forgetting_kg, record.times_s
    inside = t[record.rows]
    return Figure(
        "arx-mass",
        "Mass by the gain at zero frequency, over time",
        f"Recursive estimates ({orders_text}) with forgetting factor {trace.forgetting:.4f}, and from the last "
        f"{trace.window} rows alone; the band is that of the residuals, without the sensors' scales.",
        TIME,
        (
            Panel(
                "mass, kg",
                (
                    Trace("forgetting, 95 % interval", t, mass, "band", "kg", mass - half, mass + half),
                    Trace("finite history", t, trace.finite_kg, "reference", "kg"),
                ),
                (
                    HorizontalLine(f"specification {specification_kg:g} kg", specification_kg, "specification"),
                    HorizontalLine(f"whole interval {mass_kg:.1f} kg", mass_kg, "mean"),
                ),
                y_shown=(0.97 * specification_kg, 1.03 * specification_kg),
            ),
        ),
        shown=(float(inside[0]), float(inside[-1])),
    )
