"""Do the sensors of one motion agree? Checks that need several channels, or the motion itself, wired to a shot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_processing.alignment.channel_skew import Skew, measure_skew
from recoil_processing.double_integral import DoubleIntegral, integrate
from recoil_processing.filters import LowPass
from recoil_processing.gaps import bridge
from recoil_processing.quality.balance_checks import check_braking, check_force_sign, check_impulse, check_skew
from recoil_processing.quality.level_checks import check_zero_shift
from recoil_processing.quality.limits import Outcome
from recoil_processing.quality.motion_checks import check_rest_to_rest, check_velocity, velocity_error
from recoil_processing.shot.blow import Blow
from recoil_processing.shot.gauge_zero import MOVES_S, empty_bore_s, moving_zero_pa, zero_moves
from recoil_processing.shot.kinematics import (
    AngularMotion,
    angular_motion,
    inertial_acceleration,
    seen_acceleration,
    still,
    travel_acceleration,
)
from recoil_processing.shot.line_regression import line_motion, line_regression
from recoil_processing.shot.projectile import breech_force_on_body_n
from recoil_processing.shot.regression import PRESSURE_ROLES, Regression, build_regression
from recoil_processing.shot.signals import Signals, collect_signals
from recoil_rigs.mechanism.line import Line
from recoil_rigs.mechanism.mechanism_parameters import Mechanism
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot

CUTOFF_HZ = 300.0
"""Cut-off of the checks' low-pass: stress waves of gun-size mechanisms ring above 900 Hz, the pulse has little above
this."""
SLOWEST_SHARE = 0.2
"""Share of a force's sampling rate which the cut-off may not exceed."""
DRIVING_SHARE = 0.05
"""Share of the breech force's peak from which on it drives."""
LARGE_SHARE = 0.5
"""Share of the largest net force of a body on a line from which on it is compared with the acceleration."""
DRIVEN_S = 0.05
"""Time from the onset in which the breech drives."""
AROUND_S = 0.03
"""Time kept around a part for the low-pass: some reaches of it."""
LEAST_RECOIL_SAMPLES = 50
"""Samples of the recoil by which a shift of the zero is identified."""
LEAST_EMPTY = 20
"""Samples of an empty bore by which the breech gauge's zero is told."""
MOST_LOST = 0.05
"""Share of the recoil's samples that may be bridged for an integral."""


@dataclass(frozen=True, eq=False)
class Recoil(ReadOnlyArrays):
    """Motion as several checks need it, computed once.

    Attributes
    ----------
    acceleration : ndarray, shape (n,)
        Second derivative of what the camera sees by the accelerometers, lost samples bridged.
    travel
        Travel that the camera sees, by the accelerometer, on the reference clock.
    regression
        Force and acceleration; None where a pressure is missing or nothing recoils.
    force_problem
        Sentence on why there is no regression although every pressure is there; empty otherwise.
    sign
        Outcome of the correlation of force and acceleration; None without a breech pressure.
    """

    signals: Signals
    motion: AngularMotion
    acceleration: Array
    travel: DoubleIntegral
    low_pass: LowPass
    regression: Regression | None
    force_problem: str = ""
    sign: Outcome | None = None

    @property
    def turned(self) -> bool:
        """Whether force and acceleration point against one another, so that neither is compared any further."""
        return self.sign is not None and self.sign[0] == "fail"

    @property
    def once(self) -> Regression | None:
        """Force and acceleration where they may be compared from the release to the end of one recoil."""
        one = self.regression
        return None if one is None or self.turned or not one.recoils_once else one


def recoil_of(fired: FiredShot, alignments: Mapping[str, ClockAlignment]) -> Recoil | None:
    """Bring the channels of a shot together once for all checks; None where no acceleration shows a shot."""
    try:
        signals = collect_signals(fired, alignments)
    except IdentificationError:
        # the onset's own check says so
        return None
    return _recoil(fired.rig.mechanism, fired, signals)


@singledispatch
def _recoil(mechanism: Mechanism, fired: FiredShot, signals: Signals) -> Recoil | None:
    """Bring motion and forces of a mechanism together; None where nothing tells how it moves."""
    if "recoil_acceleration" not in signals.series:
        return None
    motion = angular_motion(signals, fired.rig)
    acceleration = seen_acceleration(signals, fired.rig, motion)
    travel = DoubleIntegral.of(acceleration, signals.start_s, signals.step_s)
    low_pass = _low_pass(fired, signals)
    sign = _force_sign(signals, fired.rig, low_pass)
    if any(role not in signals.series for role in PRESSURE_ROLES):
        return Recoil(signals, motion, acceleration, travel, low_pass, None, sign=sign)
    static = mechanism.at_rest["recoil_acceleration"]
    velocity = travel.velocity
    if fired.rig.camera_on_ground:
        velocity = integrate(travel_acceleration(signals, fired.rig, motion), signals.step_s)
    try:
        regression = build_regression(
            signals, mechanism, inertial_acceleration(signals, fired.rig, motion), velocity, static
        )
    except IdentificationError as error:
        return Recoil(signals, motion, acceleration, travel, low_pass, None, str(error), sign)
    return Recoil(signals, motion, acceleration, travel, low_pass, regression, sign=sign)


@_recoil.register
def _recoil_of_line(mechanism: Line, fired: FiredShot, signals: Signals) -> Recoil | None:
    try:
        line = line_motion(signals, fired.rig)
    except IdentificationError:
        return None
    static = mechanism.at_rest["recoil_acceleration"]
    acceleration = bridge(line.acceleration_m_s2, otherwise=static) - static
    travel = DoubleIntegral.of(acceleration * line.driven, signals.start_s, signals.step_s)
    nothing = still(signals.times_s.size)
    try:
        regression = line_regression(signals, fired.rig, line)
    except IdentificationError as error:
        return Recoil(signals, nothing, acceleration, travel, _low_pass(fired, signals), None, str(error))
    low_pass = _low_pass(fired, signals, regression.blow)
    sign = _sign_on_line(regression, fired.rig, low_pass)
    return Recoil(signals, nothing, acceleration, travel, low_pass, regression, sign=sign)


def _sign_on_line(regression: Regression, rig: Rig, low_pass: LowPass) -> Outcome | None:
    """Correlate net force and acceleration of a body on a line wherever the force is large."""
    smooth = regression.filtered(low_pass)
    force, acceleration = (np.where(smooth.used, one, np.nan) for one in (smooth.force_n, smooth.acceleration_m_s2))
    if not np.isfinite(force).any():
        return None
    drives = np.abs(force) > LARGE_SHARE * np.nanmax(np.abs(force))
    measured = [spec for one in rig.forces for spec in one.channels] + list(rig.with_role(regression.motion_role))
    reversed_by = [spec.name for spec in measured if spec.polarity < 0]
    return check_force_sign(force[drives], acceleration[drives], reversed_by=reversed_by)


def _low_pass(fired: FiredShot, signals: Signals, blow: Blow | None = None) -> LowPass:
    """Return the checks' low-pass, which the slowest force can follow, and which leaves a blow what it is."""
    rates = [one.recorded.time_base.rate_hz for force in fired.rig.forces for one in fired.of_force(force)[:1]]
    quickest_hz = CUTOFF_HZ if blow is None else max(CUTOFF_HZ, blow.cutoff_hz)
    return LowPass(min([quickest_hz, *(SLOWEST_SHARE * rate for rate in [*rates, signals.rate_hz] if rate > 0)]))


def check_motion(
    fired: FiredShot, recoil: Recoil, camera_rest_s: float | None, *, zero_by_camera: bool
) -> Iterator[QualityCheck]:
    """Check force against acceleration, and the acceleration against the camera.

    Parameters
    ----------
    camera_rest_s
        Instant since which the camera sees the mechanism at rest again, on the reference clock; None if it does not.
    zero_by_camera
        Whether the camera shows a shift of the accelerometer's zero; if not, the forces do.
    """
    if recoil.force_problem:
        yield QualityCheck("shot", Check.FORCE, "fail", recoil.force_problem)
    role = recoil.regression.motion_role if recoil.regression is not None else "recoil_acceleration"
    accelerometer = fired.shot.by_role(role)
    if accelerometer is None:
        return
    name = accelerometer.name
    if recoil.sign is not None:
        yield QualityCheck(name, Check.FORCE_SIGN, *recoil.sign)
    if recoil.once is not None:
        for check, outcome in _impulses(recoil, recoil.once, fired.rig, accelerometer.u_rel):
            yield QualityCheck("shot", check, *outcome)
        shift = None if zero_by_camera else _zero_shift(recoil, recoil.once, fired.rig)
        if shift is not None:
            yield QualityCheck(name, Check.ZERO_SHIFT, *shift)
    if recoil.regression is not None and not recoil.turned:
        skew = _skew(recoil, recoil.regression)
        if skew is not None:
            yield QualityCheck(name, Check.SKEW, *skew)
    rest = None if camera_rest_s is None else _rest(recoil, camera_rest_s)
    if rest is not None and not recoil.turned:
        yield QualityCheck(name, Check.REST_TO_REST, *rest)


def against_specification(fired: FiredShot) -> Shot:
    """Judge impulse and momentum anew, for a shot whose specification was not known when it was ingested.

    Parameters
    ----------
    fired
        Shot with its alignments and what was found of its quality; rig with the specification mass as it is known now.
    """
    accelerometer = fired.shot.by_role("recoil_acceleration")
    recoil = recoil_of(fired, {a.clock: a for a in fired.shot.alignments})
    if accelerometer is None or recoil is None or recoil.once is None:  # where there are no such checks
        return fired.shot
    anew = dict(_impulses(recoil, recoil.once, fired.rig, accelerometer.u_rel))
    quality = (
        QualityCheck("shot", one.check, *anew[one.check]) if one.channel == "shot" and one.check in anew else one
        for one in fired.shot.quality
    )
    return replace(fired.shot, quality=tuple(quality))


def check_camera_velocity(recoil: Recoil, times_s: Array, positions_m: Array) -> Outcome | None:
    """Compare the accelerometer's velocity with a camera's, from the onset to the end of recoil.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times of the frames on the reference clock.
    positions_m : ndarray, shape (n,)
        Positions; NaN where the frame was lost.
    """
    inside = (times_s >= recoil.signals.onset_s) & recoil.travel.covers(times_s)
    if not np.isfinite(positions_m[inside]).any():
        return None
    # the camera's own end of recoil: an accelerometer whose zero shifted may never see one
    end_s = times_s[inside][int(np.nanargmax(positions_m[inside]))]
    inside &= times_s <= end_s
    travel, _ = recoil.travel.at(times_s[inside])
    found = velocity_error(times_s[inside], positions_m[inside], travel, recoil.signals.onset_s)
    return None if found is None else check_velocity(found)


def _force_sign(signals: Signals, rig: Rig, low_pass: LowPass) -> Outcome | None:
    """Correlate net force and acceleration while the breech drives."""
    series, mechanism = signals.series, rig.mechanism
    if "breech_pressure" not in series:
        return None
    force = breech_force_on_body_n(series["breech_pressure"], signals.step_s, mechanism)
    for role, area in zip(PRESSURE_ROLES[1:], mechanism.force_areas[1:], strict=True):
        if role in series:
            force = force - area * bridge(series[role], otherwise=0.0)
    part = _around(signals.times_s, signals.onset_s, signals.onset_s + DRIVEN_S)
    filtered = []
    for samples in (force[part], series["recoil_acceleration"][part]):
        if np.count_nonzero(np.isfinite(samples)) < 2:
            return None
        smooth, trusted = low_pass.apply_with_gaps(samples, signals.rate_hz)
        filtered.append(np.where(trusted, smooth, np.nan))
    if not np.isfinite(filtered[0]).any():
        return None
    drives = np.abs(filtered[0]) > DRIVING_SHARE * np.nanmax(np.abs(filtered[0]))
    compared = [spec for role in ("breech_pressure", "recoil_acceleration") for spec in rig.with_role(role)]
    reversed_by = [spec.name for spec in compared if spec.polarity < 0]
    return check_force_sign(filtered[0][drives], filtered[1][drives], reversed_by=reversed_by)


def _impulses(recoil: Recoil, regression: Regression, rig: Rig, u_accelerometer: float) -> list[tuple[Check, Outcome]]:
    """Compare impulse and momentum up to the largest velocity, and from there to the end of recoil."""
    inside = regression.inside
    if np.count_nonzero(~regression.trusted & inside) > MOST_LOST * np.count_nonzero(inside):
        return []
    m, specification, step = rig.mechanism, rig.specification, regression.step_s
    first, last = int(np.argmax(inside)), int(np.flatnonzero(inside)[-1])
    part = slice(first, last + 1)
    forces_n = [bridge(f[part], otherwise=0.0) for f in regression.forces_n.T]
    forces_n[0], u_zeros_n = _without_zero(forces_n[0], recoil.signals, regression.times_s[part], rig)
    impulses = [integrate(force_n, step) for force_n in forces_n]
    u_zeros_n_s = [integrate(u_n, step) for u_n in u_zeros_n]
    released = regression.released[part] > 0
    gained = integrate(np.where(released, bridge(regression.acceleration_m_s2[part], otherwise=0.0), 0.0), step)
    total = np.sum(impulses, axis=0)
    # where the net force vanishes neither delay nor ringing matters
    peak = int(np.argmax(total))
    largest = specification.mass_kg * float(np.max(gained))
    relative = _relative_u(rig)
    scale = math.hypot(u_accelerometer, specification.u_kg / specification.mass_kg)
    zero = specification.mass_kg * recoil.signals.offsets["recoil_acceleration"].u

    recuperator = forces_n[2]
    line_s = max((spec.u_line_s for spec in rig.with_role("recuperator_pressure")), default=0.0)
    resistance_n = float(np.nanmax(np.abs(regression.forces_n[part, 1:].sum(axis=1)), initial=0.0))

    def excess(start: int, stop: int) -> tuple[float, float]:
        parts = [u * float(j[stop] - j[start]) for u, j in zip(relative, impulses[:3], strict=True)]
        momentum = specification.mass_kg * float(gained[stop] - gained[start])
        parts += [scale * momentum, (zero + m.u.get("friction", 0.0)) * (stop - start) * step]
        # what no gauge reads: a share of what is read, a force of any shape, slides, and a line before a gauge
        parts.append(m.u.get("unread_share", 0.0) * sum(float(j[stop] - j[start]) for j in impulses[1:3]))
        parts.append(m.unread_force * resistance_n * (stop - start) * step)
        parts.append(m.u.get("slide_friction", 0.0) * float(np.sum(gained[start : stop + 1])) * step)
        parts.append(line_s * float(recuperator[stop] - recuperator[start]))
        parts += [float(u_n_s[stop] - u_n_s[start]) for u_n_s in u_zeros_n_s]
        return float(total[stop] - total[start]) - momentum, math.hypot(*parts)

    driven, u_driven = excess(0, peak)
    braked, u_braked = excess(peak, gained.size - 1)
    safe = max(largest, 1e-300)
    masses = {"mass_kg": specification.mass_kg, "added_mass_kg": specification.added_kg}
    return [
        (Check.IMPULSE, check_impulse(driven, largest, u_driven / safe, **masses)),
        (Check.BRAKING, check_braking(braked, largest, u_braked / safe)),
    ]


def _without_zero(breech_n: Array, signals: Signals, times_s: Array, rig: Rig) -> tuple[Array, list[Array]]:
    """Take off the breech force what its gauge's zero has moved by, as it reads once the bore is empty.

    Returns
    -------
    breech_n : ndarray, shape (n,)
        Force without it; zero in an empty bore.
    u_n : list of ndarray, shape (n,) each
        Standard uncertainty of each gauge's force by its zero.
    """
    u_n = []
    for role, area in zip(PRESSURE_ROLES, rig.mechanism.force_areas, strict=True):
        spec, reading = rig.by_role(role), signals.series.get(role)
        u_pa = 0.0 if spec is None or reading is None else moving_zero_pa(spec, reading)
        u_n.append(np.full(times_s.size, u_pa * area))
    reading = signals.series.get(PRESSURE_ROLES[0])
    interval_s = float(times_s[0]), float(times_s[-1])
    empty = times_s >= (math.inf if reading is None else empty_bore_s(signals.times_s, reading, interval_s))
    if np.count_nonzero(empty) < LEAST_EMPTY:
        return breech_n, u_n
    # how it came there is not known, and in the middle of all ways it is wrong by half of what it may be
    way = zero_moves(times_s, interval_s[0])[:, len(MOVES_S) // 2]
    level_n = float(np.mean(breech_n[empty]) / np.mean(way[empty]))
    u_n[0] = np.where(empty, 0.0, 0.5 * u_n[0])
    return np.where(empty, 0.0, breech_n - level_n * way), u_n


def _relative_u(rig: Rig) -> list[float]:
    """Return the relative standard uncertainties of breech, brake and recuperator force."""
    specs = [rig.by_role(role) for role in PRESSURE_ROLES]
    return [
        math.hypot(spec.u_scale_rel if spec else 0.0, u_area)
        for spec, u_area in zip(specs, rig.mechanism.u_force_areas_rel, strict=True)
    ]


def _zero_shift(recoil: Recoil, regression: Regression, rig: Rig) -> Outcome | None:
    """Fit the acceleration by the force and a step at the release, below the cut-off.

    The mass is free in this fit; what the step is uncertain by is what the gauges may be off while the mechanism
    brakes.
    """
    if np.count_nonzero(regression.trusted) < LEAST_RECOIL_SAMPLES:
        return None
    part = _around(regression.times_s, *regression.interval_s)
    smooth = [
        recoil.low_pass.apply(bridge(column[part], otherwise=0.0), regression.rate_hz)
        for column in (regression.acceleration_m_s2, regression.force_n, regression.released)
    ]
    inside = regression.used[part]
    acceleration, force, released = (column[inside] for column in smooth)
    if acceleration.size < LEAST_RECOIL_SAMPLES:
        return None
    scale = float(np.max(np.abs(force)))
    solution, _, rank, _ = np.linalg.lstsq(np.column_stack([force / scale, released]), acceleration, rcond=None)
    if rank < 2:
        return None
    braking = force < 0
    parts = [
        u_rel * float(np.mean(np.abs(column[part][inside][braking]))) if braking.any() else 0.0
        for u_rel, column in zip(_relative_u(rig), regression.forces_n.T, strict=False)
    ]
    u = math.hypot(*parts, rig.mechanism.u.get("friction", 0.0)) / rig.mechanism.m3
    peak = float(np.max(np.abs(acceleration)))
    return check_zero_shift(float(solution[1]), u, peak, unit=SI_UNITS["acceleration"], against="the forces")


def _skew(recoil: Recoil, regression: Regression) -> Outcome | None:
    part = _around(regression.times_s, *regression.interval_s)
    force, acceleration = regression.force_n[part], regression.acceleration_m_s2[part]
    found = measure_skew(force, acceleration, recoil.signals.rate_hz, recoil.low_pass.cutoff_hz)
    return check_skew(found.skew_s, found.u_s, significant=found.significant) if isinstance(found, Skew) else None


def _around(times_s: Array, start_s: float, end_s: float) -> slice:
    """Return the part of a record around a stretch of it, with room for the filter."""
    first, last = np.searchsorted(times_s, [start_s - AROUND_S, end_s + AROUND_S])
    return slice(int(first), int(last))


def _rest(recoil: Recoil, rest_s: float) -> Outcome | None:
    times = recoil.signals.times_s
    resting = times >= rest_s
    if not resting.any():
        return None
    velocity = recoil.travel.velocity
    return check_rest_to_rest(float(np.mean(velocity[resting])), float(np.max(np.abs(velocity))))
