"""The figures of one shot's report: what is drawn, from what was found."""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_identification.calibration.residuals import histogram, residuals_of, rows_left, whiteness
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.report.figure.appearance import METHODS
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
from recoil_identification.report.figure.measured_figures import (
    PRESSURES,
    aligned_camera,
    hue_of_force,
    interval_of,
    measured_figures,
    others,
    repaired_of,
    shown_of,
)
from recoil_identification.shot.identified import Identification
from recoil_identification.shot.method_result import CORRECTED
from recoil_processing.filters import LowPassFilter
from recoil_processing.shot.signals import Signals, on_grid
from recoil_processing.spectra.spectrum import multitaper

FRICTION_HUE = 7
"""Hue of the friction; those of the forces are those of what they come from."""
KILONEWTON = 1e3
"""Largest force, N, from which on forces are drawn in kN."""


def report_figures(found: Identification) -> list[Figure]:
    """Compose all figures of a shot, in reading order: what was measured, then what was found from it.

    Mass over time, angular velocities and force balance are the three figures of the 2013 paper.
    """
    figures = [*measured_figures(found), _force(found), _mass(found), _residuals(found), *_whiteness(found)]
    seen = aligned_camera(found)
    if seen is not None and "candidates_s" in (seen[1].details or {}):
        figures.append(_motion_alignment(seen[1], found, seen[0]))
    return [*figures, _spectrum(found)]


def _mass(found: Identification) -> Figure:
    chosen = found.chosen
    trace = chosen.trace
    half = COVERAGE_FACTOR * trace.u_kg
    name, hue = f"identified mass ({chosen.estimate.method}), 95 % interval", METHODS.index(chosen.estimate.method)
    traces = [with_interval(name, trace.times_s, trace.mass_kg, trace.u_kg, "kg", hue=hue)]
    if found.walk is not None:
        walk, name = found.walk, "mass that may change, together with all sensors, 95 % interval"
        changes = found.constancy is not None and not found.constancy.constant
        traces.append(with_interval(name, walk.times_s, walk.mass_kg, walk.u_kg, "kg", visible=changes, hue=7))
    for name in ("reverse", "kinematic", "paper"):
        if name in found.results and name != chosen.estimate.method:
            other = found.results[name].trace
            drawn, hue = name == "paper", METHODS.index(name)
            traces.append(Trace(name, other.times_s, other.mass_kg, "reference", "kg", visible=drawn, hue=hue))
    specification_kg = found.specification.mass_kg
    specification = HorizontalLine(f"specification {specification_kg:g} kg", specification_kg, "specification")
    low, high = 0.97 * specification_kg, 1.03 * specification_kg
    if trace.identified.any():
        # the first windows hold a few samples only and would set the scale for all others
        low = min(low, float(np.nanpercentile(trace.mass_kg - half, 2)))
        high = max(high, float(np.nanpercentile(trace.mass_kg + half, 98)))
    return Figure(
        "mass",
        "Identified recoiling mass over time",
        f"Mass by the last {1e3 * trace.window_s:.0f} ms of data, its 95 % interval, and the specification; "
        "the method of 2013, and the mass as a random walk over the travel that is estimated together with every "
        "sensor's errors, for comparison.",
        TIME,
        (Panel("mass, kg", tuple(traces), (specification,), y_shown=(low, high)),),
        shown=shown_of(found),
    )


def _cutoff(low_pass: LowPassFilter | None) -> float:
    return low_pass.cutoff_hz if low_pass is not None else math.nan


def _force(found: Identification) -> Figure:
    r = found.route.filtered
    large = float(np.nanmax(np.abs(r.forces_n), initial=0.0)) >= KILONEWTON
    scale, unit = (1e-3, "kN") if large else (1.0, "N")
    names = dict(PRESSURES)
    parts = [
        Trace(names.get(name, name), r.times_s, scale * r.forces_n[:, i], "reference", unit, hue=hue_of_force(i, name))
        for i, name in enumerate(r.gauges)
    ]
    friction = scale * r.forces_n[:, -1]
    parts.append(Trace("friction", r.times_s, friction, "reference", unit, visible=False, hue=FRICTION_HUE))
    m = found.chosen.estimate.mass_kg
    acceleration, force = r.acceleration_m_s2, r.force_n
    if found.route.method in CORRECTED:
        acceleration, force = found.route.calibration.correct(r)
    return Figure(
        "force",
        "Active force on the recoiling part",
        f"Active force F', which is {r.made_of}, against the mass m times the "
        "acceleration a' as measured, with the sensors' errors as identified: they coincide where the model holds.",
        TIME,
        (
            Panel(
                f"force, {unit}",
                (
                    Trace("F', recorded", r.times_s, scale * found.route.recorded.force_n, "measured", unit),
                    Trace("F', filtered", r.times_s, scale * force, "filtered", unit),
                    Trace("m a', filtered", r.times_s, scale * m * acceleration, "model", unit),
                    *parts,
                ),
                spans=(*interval_of(found), *repaired_of(found)),
            ),
        ),
        shown=shown_of(found),
    )


def _residuals(found: Identification) -> Figure:
    r = found.route.filtered
    residual = residuals_of(r, found.route.calibration)
    counted = histogram(residual[r.used])
    panels = [
        Panel(
            "a' − F'/m, m/s²",
            (Trace("residual", r.times_s, residual, "filtered", "m/s²"),),
            (ZERO,),
            (*interval_of(found), *repaired_of(found)),
        )
    ]
    if counted is not None:
        middles, name = counted.middles_m_s2, f"normal, {counted.spread_m_s2:.2g} m/s²"
        panels.append(
            Panel(
                "density",
                (
                    Trace("residual", middles, counted.density, "bars", "1/(m/s²)"),
                    Trace(name, middles, counted.normal, "model", "1/(m/s²)"),
                ),
                x_label="residual, m/s²",
            )
        )
    return Figure(
        "residuals",
        "Residuals of the equation of motion",
        "What active force F' and mass m do not explain of the filtered acceleration a', with the sensors' errors as "
        "identified.",
        TIME,
        tuple(panels),
        shown=shown_of(found),
    )


def _whiteness(found: Identification) -> list[Figure]:
    tested = whiteness(rows_left(found.route.calibration))
    if tested is None:
        return []
    line, limit = tested.frequency, tested.cumulative_limit
    verdict = "it stays within them" if tested.is_white else "it does not stay within them"
    low, high = min(-2 * tested.limit, float(tested.autocorrelation.min())), float(tested.autocorrelation.max())
    return [
        Figure(
            "whiteness",
            "Whiteness of the residuals",
            "What the fit leaves of its rows, over their noise and without the correlation that filter and motion give "
            "them: the autocorrelation with the limits of white noise (95 % at each lag), and the cumulative "
            f"periodogram with Kolmogorov's limits (95 %), {verdict}. Where it leaves them the model lacks a motion, "
            "a force or a noise.",
            "rows apart",
            (
                Panel(
                    "autocorrelation",
                    (Trace("autocorrelation", tested.lags, tested.autocorrelation, "bars", ""),),
                    (
                        HorizontalLine("95 %", tested.limit, "limit"),
                        HorizontalLine("", -tested.limit, "limit"),
                        ZERO,
                    ),
                    y_shown=(1.1 * low, max(1.1 * high, 2 * tested.limit)),
                    x_label="rows apart",
                ),
                Panel(
                    "share of the power",
                    (
                        Trace("cumulative periodogram", line, tested.cumulative, "filtered", ""),
                        Trace("white noise", line, line, "reference", ""),
                        Trace("95 % limits", line, line + limit, "model", "", group="95 % limits"),
                        Trace("95 % limits", line, line - limit, "model", "", group="95 % limits", hue=1),
                    ),
                    y_shown=(0.0, 1.0),
                    x_label="frequency, share of half the rows' rate",
                ),
            ),
        )
    ]


def _motion_alignment(alignment: ClockAlignment, found: Identification, camera: Channel) -> Figure:
    details = alignment.details or {}
    signals: Signals = found.route.signals
    on_camera = on_grid(camera, alignment, signals.times_s)
    residual = 1e3 * (on_camera - found.route.travel_m)
    candidates = 1e6 * (np.asarray(details["candidates_s"]) - alignment.offset_s)
    return Figure(
        f"alignment-{alignment.clock}",
        f"Alignment of clock {alignment.clock}",
        f"Camera less {others(found)}, and the likelihood around the offset of {1e3 * alignment.offset_s:+.4f} ms "
        f"(u {1e6 * alignment.u_offset_s:.1f} µs).",
        TIME,
        (
            Panel(
                f"camera − {others(found)}, mm",
                (Trace("difference", signals.times_s, residual, "measured", "mm"),),
                (ZERO,),
                interval_of(found),
            ),
            Panel(
                "log-likelihood",
                (Trace("log-likelihood", candidates, np.asarray(details["log_likelihood"]), "filtered", ""),),
                x_label="offset from the best, µs",
            ),
        ),
        shown=shown_of(found),
    )


def _spectrum(found: Identification) -> Figure:
    r = found.route.recorded
    inside = np.flatnonzero(r.inside)
    part = slice(inside[0], inside[-1] + 1)
    columns = [found.route.filtered.acceleration_m_s2[part], r.force_n[part], r.acceleration_m_s2[part]]
    spectra = [multitaper(np.nan_to_num(c), r.rate_hz) for c in columns[: 2 if found.route.method == "camera" else 3]]
    frequency_hz, density = spectra[0].frequency_hz, [np.maximum(one.density, 1e-30) for one in spectra]
    keep = frequency_hz > 0
    m = found.chosen.estimate.mass_kg
    floor = 1e-9 * float(density[-1][keep].max() if len(density) == 3 else density[0][keep].max())
    cutoff_hz = _cutoff(found.route.filtered.low_pass)
    spans = [Span("cut-off", cutoff_hz, cutoff_hz)]
    said = found.route.filter_choice.cutoff
    if said is not None and math.isfinite(said.valley_hz) and math.isfinite(said.shoulder_hz):
        spans.append(Span(f"gap, {said.depth_db:.0f} dB deep", said.valley_hz, said.shoulder_hz))
    traces = [
        Trace("a', filtered", frequency_hz[keep], np.maximum(density[0][keep], floor), "filtered", ""),
        Trace("F'/m, recorded", frequency_hz[keep], density[1][keep] / m**2, "model", ""),
    ]
    left = residuals_of(found.route.filtered, found.route.calibration)[part]
    of_left = multitaper(np.nan_to_num(left), r.rate_hz).density
    traces.append(Trace("residual, filtered", frequency_hz[keep], np.maximum(of_left[keep], floor), "reference", ""))
    if len(density) == 3:
        traces.insert(0, Trace("a', recorded", frequency_hz[keep], density[2][keep], "measured", ""))
    return Figure(
        "spectrum",
        "Spectrum of the acceleration before and after the filter",
        f"Of the acceleration a': rigid-body motion below {_cutoff(found.route.filtered.low_pass):.0f} Hz, "
        "stress waves above; the spectrum of the active force F' over the mass m shows which of it is motion, that of "
        "the residual what they leave.",
        "frequency, Hz",
        (
            Panel(
                "(m/s²)²/Hz",
                tuple(traces),
                spans=tuple(spans),
                y_scale="log",
            ),
        ),
        x_scale="log",
    )
