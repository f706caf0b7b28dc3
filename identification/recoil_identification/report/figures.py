"""The figures of one shot's report: what is drawn, from what was found."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.shot import ClockAlignment
from recoil_identification.analysis import Identification
from recoil_identification.budget import COVERAGE_FACTOR
from recoil_identification.method_result import CORRECTED
from recoil_identification.report.figure import Figure, HorizontalLine, Panel, Span, Trace
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import FORCES
from recoil_processing.shot.signals import Signals, on_grid
from recoil_processing.spectra.spectrum import multitaper

Array = NDArray[np.float64]
TIME = "time on the reference clock, s"


def report_figures(found: Identification) -> list[Figure]:
    """Compose all figures of a shot, in reading order.

    The first three are those of the 2013 paper for this shot: the mass over time, the angular rates raw
    and filtered, the active force.
    """
    camera = found.camera
    alignment = None if camera is None else found.alignments.get(camera.time_base.clock)
    if camera is None or alignment is None or alignment.status == "failed":
        camera = alignment = None
    figures = [_mass(found), *_angular_rates(found), _force(found), _travel(found, camera, alignment)]
    figures.append(_residuals(found))
    if camera is not None and alignment is not None and "candidates_s" in (alignment.details or {}):
        figures.append(_motion_alignment(alignment, found, camera))
    return [*figures, _spectrum(found)]


def _shown(found: Identification) -> tuple[float, float]:
    t0, t1 = found.filtered.interval_s
    margin = 0.12 * (t1 - t0)
    return t0 - margin, t1 + margin


def _interval(found: Identification) -> tuple[Span, ...]:
    return (Span("identification interval", *found.filtered.interval_s),)


def _repaired(found: Identification) -> tuple[Span, ...]:
    """From the first to the last sample of each channel that is no measurement, as far as it is shown."""
    low, high = _shown(found)
    spans = []
    for one in found.signals.repairs:
        at = one.spans_s[(one.spans_s[:, 1] >= low) & (one.spans_s[:, 0] <= high)]
        if at.size:
            label = f"{one.channel}: {one.repair.kind}, {one.repair.count} samples"
            spans.append(Span(label, max(float(at.min()), low), min(float(at.max()), high)))
    return tuple(spans)


def _mass(found: Identification) -> Figure:
    chosen = found.chosen
    trace = chosen.trace
    half = COVERAGE_FACTOR * trace.u_kg
    traces = [
        Trace(
            f"identified mass ({chosen.estimate.method}), 95 % interval",
            trace.times_s,
            trace.mass_kg,
            "band",
            "kg",
            trace.mass_kg - half,
            trace.mass_kg + half,
        ),
    ]
    if found.walk is not None:
        walk, wide = found.walk, COVERAGE_FACTOR * found.walk.u_kg
        name = "mass that may change, together with all sensors, 95 % interval"
        times, low_kg, high_kg = walk.times_s, walk.mass_kg - wide, walk.mass_kg + wide
        traces.append(Trace(name, times, walk.mass_kg, "band", "kg", low_kg, high_kg, visible=_changes(found)))
    for name in ("reverse", "kinematic", "paper"):
        if name in found.results and name != chosen.estimate.method:
            other = found.results[name].trace
            traces.append(Trace(name, other.times_s, other.mass_kg, "reference", "kg", visible=name == "paper"))
    specification = HorizontalLine(
        f"specification {found.specification_kg:g} kg", found.specification_kg, "specification"
    )
    low, high = 0.97 * found.specification_kg, 1.03 * found.specification_kg
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
        shown=_shown(found),
    )


def _changes(found: Identification) -> bool:
    return found.constancy is not None and not found.constancy.constant()


def _angular_rates(found: Identification) -> list[Figure]:
    signals = found.signals
    low_pass = found.filtered.low_pass
    panels = []
    for role, label in (("tipping_rate", "tipping and recoiling part"), ("carriage_rate", "carriage")):
        if role not in signals.series or low_pass is None:
            continue
        raw = signals.series[role]
        smooth, _ = low_pass.apply_with_gaps(raw, signals.rate_hz)
        panels.append(
            Panel(
                f"{label}, rad/s",
                (
                    Trace(f"{label}, recorded", signals.times_s, raw, "measured", "rad/s"),
                    Trace(f"{label}, filtered", signals.times_s, smooth, "filtered", "rad/s"),
                ),
            )
        )
    if not panels:
        return []
    return [
        Figure(
            "angular-rate",
            "Angular velocity, recorded and filtered",
            f"Stress waves ride on the gyros' signals; zero-phase low-pass at {_cutoff(low_pass):.0f} Hz.",
            TIME,
            tuple(panels),
            shown=_shown(found),
        )
    ]


def _cutoff(low_pass: LowPass | None) -> float:
    return low_pass.cutoff_hz if low_pass is not None else math.nan


def _force(found: Identification) -> Figure:
    r = found.filtered
    parts = [
        Trace(name, r.times_s, 1e-3 * r.forces_n[:, i], "reference", "kN", visible=name != "friction")
        for i, name in enumerate(FORCES)
    ]
    m = found.chosen.estimate.mass_kg
    acceleration, force = r.acceleration_m_s2, r.force_n
    if found.method in CORRECTED:
        acceleration, force = found.calibration.correct(r)
    return Figure(
        "force",
        "Active force on the recoiling part",
        "Breech force less brake, recuperator and friction, against mass times measured acceleration, with the "
        "sensors' errors as identified: they coincide where the model holds.",
        TIME,
        (
            Panel(
                "force, kN",
                (
                    Trace("F', recorded", r.times_s, 1e-3 * found.recorded.force_n, "measured", "kN"),
                    Trace("F', filtered", r.times_s, 1e-3 * force, "filtered", "kN"),
                    Trace("m a', filtered", r.times_s, 1e-3 * m * acceleration, "model", "kN"),
                    *parts,
                ),
                spans=(*_interval(found), *_repaired(found)),
            ),
        ),
        shown=_shown(found),
    )


def _travel(found: Identification, camera: Channel | None, alignment: ClockAlignment | None) -> Figure:
    t = found.filtered.times_s
    fused = found.fused
    if fused is None:
        traces = [Trace("travel, accelerometers", t, 1e3 * found.travel_m, "filtered", "mm")]
        velocity = Trace("velocity", t, found.velocity_m_s, "filtered", "m/s")
    else:
        traces = [_banded("travel, fused", t, 1e3 * found.travel_m, 1e3 * fused.u_position_m, "mm")]
        velocity = _banded("velocity, fused", t, found.velocity_m_s, fused.u_velocity_m_s, "m/s")
    if camera is not None and alignment is not None:
        at = alignment.to_reference(camera.time_base.times_s)
        traces.insert(0, Trace("camera", at, 1e3 * np.asarray(camera.samples), "points", "mm"))
    return Figure(
        "travel",
        "Recoil travel and velocity",
        f"The camera's track on the reference clock, and camera and {_others(found)} together with their 95 % band.",
        TIME,
        (
            Panel("travel, mm", tuple(traces), spans=_interval(found)),
            Panel("velocity, m/s", (velocity,), spans=_interval(found)),
        ),
        shown=_shown(found),
    )


def _others(found: Identification) -> str:
    """Name what the camera's track is compared and fused with."""
    return "forces" if found.method == "camera" else "accelerometers"


def _banded(name: str, times_s: Array, values: Array, u: Array, unit: str) -> Trace:
    half = COVERAGE_FACTOR * u
    return Trace(f"{name}, 95 % interval", times_s, values, "band", unit, values - half, values + half)


def _residuals(found: Identification) -> Figure:
    r = found.filtered
    acceleration, force = found.calibration.correct(r)
    residual = np.where(r.trusted, acceleration - force / found.calibration.estimate.mass_kg, np.nan)
    inside = residual[r.used]
    panels = [
        Panel(
            "a' - F'/m, m/s^2",
            (Trace("residual", r.times_s, residual, "filtered", "m/s^2"),),
            (HorizontalLine("zero", 0.0, "mean"),),
            (*_interval(found), *_repaired(found)),
        )
    ]
    spread = float(np.std(inside)) if inside.size > 20 else 0.0
    if spread > 0:
        counts, edges = np.histogram(inside, bins=np.linspace(-4 * spread, 4 * spread, 41), density=True)
        middles = 0.5 * (edges[1:] + edges[:-1])
        normal = np.exp(-0.5 * (middles / spread) ** 2) / (spread * math.sqrt(2 * math.pi))
        panels.append(
            Panel(
                "density",
                (
                    Trace("residual", middles, counts, "bars", "1/(m/s^2)"),
                    Trace(f"normal, {spread:.2g} m/s^2", middles, normal, "model", "1/(m/s^2)"),
                ),
                x_label="residual, m/s^2",
            )
        )
    return Figure(
        "residuals",
        "Residuals of the equation of motion",
        "What force and mass do not explain of the filtered acceleration, with the sensors' errors as identified.",
        TIME,
        tuple(panels),
        shown=_shown(found),
    )


def _motion_alignment(alignment: ClockAlignment, found: Identification, camera: Channel) -> Figure:
    details = alignment.details or {}
    signals: Signals = found.signals
    on_camera = on_grid(camera, alignment, signals.times_s)
    residual = 1e3 * (on_camera - found.travel_m)
    candidates = 1e6 * (np.asarray(details["candidates_s"]) - alignment.offset_s)
    return Figure(
        f"alignment-{alignment.clock}",
        f"Alignment of clock {alignment.clock}",
        f"Camera less {_others(found)}, and the likelihood around the offset of {1e3 * alignment.offset_s:+.4f} ms "
        f"(u {1e6 * alignment.u_offset_s:.1f} us).",
        TIME,
        (
            Panel(
                f"camera - {_others(found)}, mm",
                (Trace("difference", signals.times_s, residual, "measured", "mm"),),
                (HorizontalLine("zero", 0.0, "mean"),),
                _interval(found),
            ),
            Panel(
                "log-likelihood",
                (Trace("log-likelihood", candidates, np.asarray(details["log_likelihood"]), "filtered", ""),),
                x_label="offset from the best, us",
            ),
        ),
        shown=_shown(found),
    )


def _spectrum(found: Identification) -> Figure:
    r = found.recorded
    inside = np.flatnonzero(r.inside)
    part = slice(inside[0], inside[-1] + 1)
    columns = [found.filtered.acceleration_m_s2[part], r.force_n[part], r.acceleration_m_s2[part]]
    spectra = [multitaper(np.nan_to_num(c), r.rate_hz) for c in columns[: 2 if found.method == "camera" else 3]]
    frequency_hz, density = spectra[0].frequency_hz, [np.maximum(one.density, 1e-30) for one in spectra]
    keep = frequency_hz > 0
    m = found.chosen.estimate.mass_kg
    floor = 1e-9 * float(density[-1][keep].max() if len(density) == 3 else density[0][keep].max())
    cutoff_hz = _cutoff(found.filtered.low_pass)
    spans = [Span("cut-off", cutoff_hz, cutoff_hz)]
    said = found.filter_choice.cutoff
    if said is not None and math.isfinite(said.valley_hz) and math.isfinite(said.shoulder_hz):
        spans.append(Span(f"gap, {said.depth_db:.0f} dB deep", said.valley_hz, said.shoulder_hz))
    traces = [
        Trace("a', filtered", frequency_hz[keep], np.maximum(density[0][keep], floor), "filtered", ""),
        Trace("F'/m, recorded", frequency_hz[keep], density[1][keep] / m**2, "model", ""),
    ]
    if len(density) == 3:
        traces.insert(0, Trace("a', recorded", frequency_hz[keep], density[2][keep], "measured", ""))
    return Figure(
        "spectrum",
        "Spectrum of the acceleration before and after the filter",
        f"Rigid-body motion below {_cutoff(found.filtered.low_pass):.0f} Hz, stress waves above; the force's spectrum "
        "shows which of it is motion.",
        "frequency, Hz",
        (
            Panel(
                "(m/s^2)^2/Hz",
                tuple(traces),
                spans=tuple(spans),
                y_scale="log",
            ),
        ),
        x_scale="log",
    )
