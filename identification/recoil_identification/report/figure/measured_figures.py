"""The figures of what a shot's instruments measured, each quantity at its own scale: as recorded, and filtered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_identification.report.figure.figure import TIME, Figure, Panel, Span, Trace, with_interval
from recoil_identification.shot.identified import Identification

ROLE_HUES = {"breech_pressure": 5, "brake_pressure": 2, "recuperator_pressure": 3}
"""A pressure has the colour of the force that it makes."""
FIRST_HUE = 4
"""Hue of the first force that is no pressure's."""
PRESSURES = (("breech_pressure", "breech"), ("brake_pressure", "brake"), ("recuperator_pressure", "recuperator"))
RATES = (("tipping_rate", "tipping and recoiling part"), ("carriage_rate", "carriage"))
CARRIAGE = (("carriage_acceleration_x", "carriage, x"), ("carriage_acceleration_y", "carriage, y"))


def measured_figures(found: Identification) -> list[Figure]:
    """Compose the figures of pressures, recoil motion and the carriage's motion, as far as the shot has channels."""
    figures = [
        _of_forces(found),
        _of_roles(found, "pressure", "Pressures", PRESSURES, 1e-6, "MPa", "Each at its own scale"),
        _motion(found),
        _of_roles(found, "angular-rate", "Angular velocities", RATES, 1.0, "rad/s", "Stress waves ride on the gyros"),
        _of_roles(found, "carriage", "Accelerations of the carriage", CARRIAGE, 1.0, "m/s²", "At the sensors' places"),
    ]
    return [figure for figure in figures if figure is not None]


def shown_of(found: Identification) -> tuple[float, float]:
    """Return the stretch of time that a figure shows first."""
    t0, t1 = found.route.filtered.interval_s
    margin = 0.12 * (t1 - t0)
    return t0 - margin, t1 + margin


def interval_of(found: Identification) -> tuple[Span, ...]:
    """Return the stretch of time that the mass is identified from."""
    return (Span("identification interval", *found.route.filtered.interval_s),)


def repaired_of(found: Identification, role: str | None = None) -> tuple[Span, ...]:
    """Return from where to where repaired samples of a role, or of all, lie: as far as that is shown."""
    low, high = shown_of(found)
    spans = []
    for one in found.route.signals.repairs:
        at = one.spans_s[(one.spans_s[:, 1] >= low) & (one.spans_s[:, 0] <= high)]
        if at.size and role in (None, one.role):
            label = f"{one.channel}: {one.repair.kind}, {one.repair.count} samples"
            spans.append(Span(label, max(float(at.min()), low), min(float(at.max()), high)))
    return tuple(spans)


def aligned_camera(found: Identification) -> tuple[Channel, ClockAlignment] | None:
    """Return the camera's track and its clock; None where either is missing."""
    alignment = None if found.route.camera is None else found.alignments.get(found.route.camera.time_base.clock)
    if found.route.camera is None or alignment is None or alignment.status == "failed":
        return None
    return found.route.camera, alignment


def _said(found: Identification, what: str) -> str:
    low_pass = found.route.filtered.low_pass
    by = "" if low_pass is None else f"; filtered by the zero-phase low-pass at {low_pass.cutoff_hz:.0f} Hz"
    return f"{what}: as recorded, on the reference clock and without the sensors' zero offsets{by}."


def _pair(
    found: Identification, label: str, recorded: Array, scale: float, unit: str, hue: int, number: int = 0
) -> list[Trace]:
    """Return a signal as recorded and, where there is a low-pass, behind it; the number is that of its gauge."""
    hue += number
    signals, low_pass = found.route.signals, found.route.filtered.low_pass
    traces = [Trace(f"{label}, recorded", signals.times_s, scale * recorded, "measured", unit, hue=hue)]
    if low_pass is not None:
        smooth, trusted = low_pass.apply_with_gaps(recorded, signals.rate_hz)
        smooth = np.where(trusted, scale * smooth, np.nan)
        # the camera's low-pass is made for a displacement, and flattens what an instrument beside it recorded
        shown = found.route.method != "camera"
        traces.append(
            Trace(f"{label}, filtered", signals.times_s, smooth, "filtered", unit, visible=shown, hue=hue, dash=number)
        )
    return traces


def _of_roles(
    found: Identification, key: str, title: str, roles: tuple[tuple[str, str], ...], scale: float, unit: str, what: str
) -> Figure | None:
    """Draw the channels of each role on a panel of its own; None where the shot has none of them."""
    signals, panels = found.route.signals, []
    for role, label in roles:
        if role not in signals.series:
            continue
        hue, gauges = ROLE_HUES.get(role, 0), signals.gauges.get(role, ())
        traces = _pair(found, label, signals.series[role], scale, unit, hue) if not gauges else []
        for number, gauge in enumerate(gauges):
            traces += _pair(found, f"{label}, {gauge.channel}", gauge.samples, scale, unit, hue, number)
        panels.append(Panel(f"{label}, {unit}", tuple(traces), spans=repaired_of(found, role)))
    if not panels:
        return None
    return Figure(
        key, title, _said(found, what), TIME, tuple(panels), shown=shown_of(found), folded=key == "carriage",
        switched=True,
    )  # fmt: skip


def hue_of_force(number: int, name: str) -> int:
    """Return the hue of a measured force by its place among the others, a pressure's by its role."""
    return ROLE_HUES.get(name, FIRST_HUE + number)


def _of_forces(found: Identification) -> Figure | None:
    """Draw the channels of forces, each on a panel of its own; None where the shot has none of them."""
    signals, panels = found.route.signals, []
    for number, name in enumerate(found.route.recorded.gauges):
        if name not in signals.series or name in ROLE_HUES:
            continue
        traces = _pair(found, name, signals.series[name], 1.0, "N", hue_of_force(number, name))
        panels.append(Panel(f"{name}, N", tuple(traces), spans=repaired_of(found, name)))
    if not panels:
        return None
    said = _said(found, "Each at its own scale")
    return Figure("forces", "Measured forces", said, TIME, tuple(panels), shown=shown_of(found), switched=True)


def _motion(found: Identification) -> Figure:
    t, fused, spans = found.route.filtered.times_s, found.route.fused, interval_of(found)
    unnamed = tuple(replace(span, label="") for span in spans)
    if fused is None:
        travel = [Trace("travel, accelerometers", t, 1e3 * found.route.travel_m, "filtered", "mm")]
        velocity = Trace("velocity", t, found.route.velocity_m_s, "filtered", "m/s")
    else:
        travel = [
            with_interval("travel, fused, 95 % interval", t, 1e3 * found.route.travel_m, 1e3 * fused.u_position_m, "mm")
        ]
        velocity = with_interval(
            "velocity, fused, 95 % interval", t, found.route.velocity_m_s, fused.u_velocity_m_s, "m/s"
        )
    seen = aligned_camera(found)
    if seen is not None:
        camera, alignment = seen
        at = alignment.to_reference(camera.time_base.times_s)
        travel.insert(0, Trace("camera", at, 1e3 * np.asarray(camera.samples), "points", "mm"))
    panels, role = [], "recoil_acceleration"
    if role in found.route.signals.series:
        pair = _pair(found, "acceleration", found.route.signals.series[role], 1.0, "m/s²", 0)
        panels.append(Panel("acceleration, m/s²", tuple(pair), spans=(*spans, *repaired_of(found, role))))
    panels.append(Panel("velocity, m/s", (velocity,), spans=unnamed if panels else spans))
    panels.append(Panel("travel, mm", tuple(travel), spans=unnamed))
    by = "the accelerometers" if seen is None else f"camera and {others(found)}"
    return Figure(
        "motion",
        "Recoil motion",
        f"{_said(found, 'Acceleration of the recoiling part')} Velocity and travel by {by}"
        f"{'' if fused is None else ', fused, with their 95 % band'}.",
        TIME,
        tuple(panels),
        shown=shown_of(found),
        switched=role in found.route.signals.series,
    )


def others(found: Identification) -> str:
    """Name what the camera's track is compared and fused with."""
    return "forces" if found.route.method == "camera" else "accelerometers"
