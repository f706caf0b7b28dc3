"""The figures of the breech force by the motion."""

from __future__ import annotations

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.report.figure.figure import TIME, ZERO, Figure, Panel, Span, Trace, with_interval
from recoil_identification.targets.forces.force_peak import ForcePeak
from recoil_identification.targets.forces.motion_force import MotionForce


def force_figures(found: MotionForce, peak: ForcePeak, area_m2: float) -> tuple[Figure, ...]:
    """Compose the figures, in reading order."""
    return (_forces(found, peak), _pressure(found, peak, area_m2), _parts(found))


def _shown(found: MotionForce) -> tuple[float, float]:
    return found.record.onset_s - 2e-3, float(found.times_s[-1])


def _spans(found: MotionForce, peak: ForcePeak) -> tuple[Span, ...]:
    return Span("release", found.record.onset_s, found.record.onset_s), Span("peak", peak.time_s, peak.time_s)


def _forces(found: MotionForce, peak: ForcePeak) -> Figure:
    t, record = found.times_s, found.record
    kalman, inverted = found.blank(found.kalman.force_n), found.blank(found.inverted.force_n)
    traces = [
        Trace("m3 a' + R_f, recorded", record.measured.times_s, 1e-3 * record.measured.force_n, "measured", "kN"),
        _band("Kalman input estimation", t, kalman, found.u_kalman_n),
        Trace("regularised inversion", t, 1e-3 * inverted, "model", "kN"),
    ]
    apart = np.hypot(found.kalman.u_force_n, found.inverted.u_force_n)
    differences = [_band("inversion less Kalman", t, inverted - kalman, apart)]
    if found.gauge is not None and record.gauge_n is not None:
        traces.append(Trace("breech gauge", record.measured.times_s, 1e-3 * record.gauge_n, "reference", "kN"))
        u = np.hypot(found.u_kalman_n, found.u_gauge_n)
        differences.append(_band("motion less gauge", t, kalman - found.gauge.force_n, u))
    top = 1.15e-3 * peak.force_n
    return Figure(
        "breech-force",
        "Breech force from the motion",
        "By two methods with the 95 % interval of the first; the breech gauge, where there is one, has no part in it.",
        TIME,
        (
            Panel("force, kN", tuple(traces), spans=_spans(found, peak), y_shown=(-0.1 * top, top)),
            Panel("difference, kN", tuple(differences), (ZERO,)),
        ),
        shown=_shown(found),
    )


def _pressure(found: MotionForce, peak: ForcePeak, area_m2: float) -> Figure:
    pressure = 1e-6 * found.blank(found.kalman.force_n) / area_m2
    half = COVERAGE_FACTOR * 1e-6 * found.u_kalman_n / area_m2
    name = "by the motion, 95 % interval"
    band = Trace(name, found.times_s, pressure, "band", "MPa", pressure - half, pressure + half)
    return Figure(
        "breech-pressure",
        "Equivalent breech pressure",
        f"The force over the bore area, less the projectile's friction: {area_m2:g} m².",
        TIME,
        (Panel("pressure, MPa", (band,), spans=_spans(found, peak)),),
        shown=_shown(found),
    )


def _parts(found: MotionForce) -> Figure:
    t, record = found.times_s, found.record
    grid = record.measured.times_s
    parts = tuple(Trace(name, grid, 1e-3 * part, "reference", "kN") for name, part in record.parts_n.items())
    rings = Trace("mass times what rings", t, 1e-3 * found.kalman.stress_waves_n, "measured", "kN")
    return Figure(
        "breech-force-parts",
        "What the force went into",
        "The motion, the measured resistance, and the stress waves that were told from the force.",
        TIME,
        (
            Panel("force, kN", (Trace("m3 a'", t, 1e-3 * found.inertia_n, "model", "kN"), *parts)),
            Panel("stress waves, kN", (rings,)),
        ),
        shown=_shown(found),
    )


def _band(name: str, t: Array, values: Array, u: Array) -> Trace:
    return with_interval(f"{name}, 95 % interval", t, values, u, "kN", scale=1e-3)
