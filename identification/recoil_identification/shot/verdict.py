"""Reasons against a shot's mass, by the accelerometer or by the camera alone, and notes for its reader."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from recoil_acquisition.normal_distribution import CRITICAL_VALUE
from recoil_acquisition.remark import Reason, ReasonCode
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.gauge_agreement import ALIKE
from recoil_identification.calibration.mass_over_time import MassConstancy
from recoil_identification.calibration.trace import MassTrace
from recoil_identification.estimate.mass import ACCELERATION, RANDOM
from recoil_identification.estimators.endogeneity import Endogeneity
from recoil_identification.rows.camera_rows import LATE
from recoil_identification.rows.row_noise import LARGEST_SIZE
from recoil_identification.rows.sensor_priors import CAMERA_SCALE, RELEASE
from recoil_identification.rows.tracked_recoil import TrackedRecoil
from recoil_identification.shot.route import Route
from recoil_processing.alignment.align import INNOVATION_LIMITS, MOST_INFLATION, MOST_SET_ASIDE
from recoil_processing.noise import noise_sigma
from recoil_processing.shot.clocks.double_impulse import INFLATIONS
from recoil_processing.shot.error_source import ErrorSource
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Signals
from recoil_processing.shot.verdict.influence import LEAST_INFLUENCE
from recoil_processing.shot.verdict.mass_reasons import (
    against_losses,
    against_signals,
    doubted_clocks,
    doubts_of,
    failed_checks,
    lost_share,
    unused_channels,
)
from recoil_rigs.assumptions import CARRIAGE_ROLES
from recoil_rigs.fired_shot import FiredShot
from recoil_rigs.rig import Rig

UNCHECKED = (
    "no accelerometer on the recoiling part was used: what it checks is not checked, the camera's scale and a skew of "
    "the recorder's channels among it"
)
LARGEST_SHIFT = 4.0
"""Standard uncertainties by which frames and forces may call for another offset of the clock than it was aligned by."""


def against_the_track(tracked: TrackedRecoil, calibration: Calibration) -> Iterator[Reason]:
    """Say what speaks against a mass by this camera track, one sentence each, with its limit."""
    found, clock = tracked.found, tracked.clock
    if found.inflation > MOST_INFLATION:
        more = " or more, for no more are tried," if found.inflation >= INFLATIONS[-1] else ""
        yield _of_track(
            f"camera track and forces do not show the same motion: {found.inflation:.0f} times the force's noise{more} "
            f"would be needed to explain the difference (limit {MOST_INFLATION:g})"
        )
    noise = noise_sigma(tracked.positions_m)
    if noise > 0 and (found.marker_sigma_m / noise) ** 2 > INNOVATION_LIMITS[1]:
        yield _of_track(
            f"the camera track is {1e3 * found.marker_sigma_m:.3g} mm off what the forces drive, its own noise is "
            f"{1e3 * noise:.3g} mm: a dropped frame, a wrong frame rate or a force that is wrong"
        )
    if found.set_aside > MOST_SET_ASIDE * (found.frames + found.set_aside):
        yield _of_track(f"{found.set_aside} of {found.frames + found.set_aside} frames contradict their neighbours")
    if not tracked.by_force:
        shift_s = calibration.inferred.value(LATE.name)
        apart = abs(shift_s) / max(clock.u_offset_s, 1e-9)
        if apart > LARGEST_SHIFT:
            yield _of_track(
                f"camera track and forces call for an offset of clock {clock.clock} {1e6 * shift_s:+.0f} us away, "
                f"{apart:.1f} of its standard uncertainties (limit {LARGEST_SHIFT:g})"
            )


def _of_track(text: str) -> Reason:
    return Reason(ReasonCode.TRACK, "recoil_displacement", text)


def notes_on_track(fired: FiredShot, tracked: TrackedRecoil, calibration: Calibration) -> list[str]:
    """Say what a reader should know of a mass by this camera track although it does not make the result invalid."""
    notes = [UNCHECKED]
    if tracked.by_force:
        notes.append(
            f"clock {tracked.clock.clock} is aligned by camera track and forces, and its offset is found with the mass "
            f"(u {1e6 * calibration.inferred.u(LATE.name):.1f} us)"
        )
    ignored = [c for c in fired.shot.quality if c.verdict == "fail" and c.channel in unused_channels(fired)]
    return [*notes, *(f"not used: {c.channel}: {c.detail}" for c in ignored)]


LEAST_SHARE = 0.5
"""Below this share of identified samples the trace does not describe the shot."""
ROUNDING = 1e-6
"""Difference of two that are one and the same."""
FAR = 3.0
"""Factor on how far, in its standard uncertainties, something would have to be off, beyond which another is taken."""
NEAR = 3.0
"""Normalised residual of a sensor from which on it is mentioned, as a second explanation or the beginning of one."""
CHANGE_LEVEL = 0.001
"""Probability of a constant mass below which a change speaks against it, as of a sensor: one sound shot in 1000."""
PLAIN = ("reverse", "forward")
"""Methods that regress one side of the equation of motion on the other, behind one low-pass."""
LARGEST_ROUTE_GAP = 3.0
"""Combined standard uncertainties by which the two routes to the acceleration may differ."""


def reasons_against(
    fired: FiredShot,
    route: Route,
    trace: MassTrace,
    constancy: MassConstancy | None,
    endogeneity: Endogeneity | None = None,
) -> tuple[Reason, ...]:
    """Say what speaks against the result.

    Parameters
    ----------
    trace
        Of the method that was asked for.
    endogeneity
        Of force on acceleration as recorded; None where that cannot be told.

    Returns
    -------
    tuple of Reason
        One sentence each, with its limit; empty if nothing does.
    """
    unused = () if route.tracked is None else unused_channels(fired)
    reasons = reasons_against_record(fired, route.signals, trace, route.filtered, unused)
    reasons += [one for one, held in _weighed_doubts(route.calibration, constancy) if not held]
    reasons += _against_the_method(route, endogeneity)
    if not route.calibration.inferred.converged:
        text = "mass and sensors' errors did not settle: check areas, units and signals of the pressures"
        reasons.append(Reason(ReasonCode.CONVERGENCE, "shot", text))
    reasons += _against_the_fit(route) if route.tracked is None else against_the_track(route.tracked, route.calibration)
    return tuple(reasons)


def notes_on_doubts(calibration: Calibration, constancy: MassConstancy | None) -> list[str]:
    """Say which doubts do not speak against the mass, and why not."""
    return [f"{one}; {held}" for one, held in _weighed_doubts(calibration, constancy) if held]


def _weighed_doubts(calibration: Calibration, constancy: MassConstancy | None) -> list[tuple[Reason, str]]:
    """List the doubts of sensors and of a constant mass, each with why it is none of the mass; empty where it is.

    A certificate that the shot contradicts is a reason whatever it does to the mass. Of what the shot alone knows
    (zeros, delays, the picture, the carriage's part) there are some thirty, and of a sound shot one of them is beyond
    the critical value now and then: such a doubt decides by the mass that it would give.
    """
    estimate = calibration.estimate
    low, high = estimate.interval_kg
    judged: list[tuple[Reason, str]] = []
    if constancy is not None and not constancy.constant():
        ends = constancy.before_kg, constancy.after_kg
        held = "the interval of the mass holds both" if all(low <= end <= high for end in ends) else ""
        if constancy.constant(CHANGE_LEVEL):
            held = held or f"chance does as much in more than one shot of {1.0 / CHANGE_LEVEL:.0f}"
        if held:
            judged.append((Reason(ReasonCode.CONSTANCY, "shot", str(constancy).rstrip(".")), held))
            constancy = None
    rows = {row.source: row.u_kg for row in estimate.budget}
    own = {source for prior in calibration.own for source in prior.sources}
    beside: dict[str, ErrorSource] = {source: source for source in calibration.sources if source in own}
    for doubt in doubted_sensors_or_mass(calibration, constancy):
        held, source = "", beside.get(doubt.about)
        if doubt.code is ReasonCode.SENSOR and source is not None and source in rows:
            # released, it is off by w^2 / pull of its standard uncertainties; what one of them does the budget says
            w, pull = calibration.normalised_residuals[source], calibration.pulls[source]
            moves_kg = rows[source] * w * w / abs(pull)
            if moves_kg <= 0.5 * (high - low):
                held = f"the mass would move by {moves_kg:.2g} kg, which its interval holds"
        judged.append((doubt, held))
    return judged


def _against_the_method(route: Route, endogeneity: Endogeneity | None) -> Iterator[Reason]:
    """Say that a plain regression is biased here, by the report's own test or by Frisch's bracket."""
    other = "take the default method"
    if route.method == "paper" and endogeneity is not None and endogeneity.biased:
        yield Reason(ReasonCode.METHOD, "paper", f"the method paper is biased in this shot: {endogeneity}; {other}")
    if route.method in PLAIN:
        masses = [route.estimates[method].mass_kg for method in PLAIN]
        u_kg, apart = route.estimates[route.method].u_kg, max(masses) - min(masses)
        if apart > LEAST_INFLUENCE * u_kg:
            yield Reason(
                ReasonCode.METHOD,
                route.method,
                f"the method {route.method} is biased in this shot: force on acceleration and acceleration on force "
                f"lie {apart:.1f} kg apart, {apart / u_kg:.2g} of its u (limit {LEAST_INFLUENCE:g}); {other}",
            )


def _against_the_fit(route: Route) -> Iterator[Reason]:
    """Say what speaks against a fit of the accelerometer's rows."""
    calibration, shift, estimates = route.calibration, route.zero_shift, route.estimates
    if shift is not None and shift.demanded and not shift.confirmed:
        yield Reason(
            ReasonCode.ZERO,
            ACCELERATION,
            f"either the accelerometer's zero shifted at the shot {shift}, or a gauge is off: without a camera that is "
            "aligned the shot cannot tell",
        )
    size = calibration.noise.size
    if size > LARGEST_SIZE:
        yield Reason(
            ReasonCode.RESIDUAL,
            "shot",
            f"mass and forces leave {calibration.estimate.residual_m_s2:.3g} m/s^2 of the acceleration unexplained, "
            f"{size:.1f} times the noise even if every sensor is off and the mass changes (limit {LARGEST_SIZE:g}): "
            "check areas, units and signals of the pressures",
        )
    if "kinematic" in estimates:
        inertial, camera = estimates["reverse"], estimates["kinematic"]
        # both routes share the forces, so only what they do not share counts
        apart = abs(inertial.mass_kg - camera.mass_kg)
        own = math.hypot(*(r.u_kg for e in (inertial, camera) for r in e.budget if _not_shared(r.source)))
        if apart > LARGEST_ROUTE_GAP * own:
            yield Reason(
                ReasonCode.ROUTES,
                "shot",
                f"the accelerometer gives {inertial.mass_kg:.1f} kg and the camera {camera.mass_kg:.1f} kg, "
                f"{apart / own:.1f} standard uncertainties apart (limit {LARGEST_ROUTE_GAP:g})",
            )


def reasons_against_record(
    fired: FiredShot, signals: Signals, trace: MassTrace, filtered: Regression, unused: Collection[str] = ()
) -> list[Reason]:
    """Say what speaks against the record of a shot, whatever its mass was found by: what the range says, and the trace.

    Parameters
    ----------
    fired, signals
    trace
        Of the method that gives the mass.
    filtered
        Tells what of the pulse was lost.
    unused
        Channels that the mass does not hang on.
    """
    reasons = [
        *failed_checks(fired.shot, unused),
        *doubts_of(fired.rig),
        *doubted_clocks(fired),
        *against_signals(signals, fired.rig),
        *against_losses(fired.shot, lost_share(filtered)),
    ]
    if trace.share < LEAST_SHARE:
        text = f"only {100 * trace.share:.0f} % of the interval could be identified (limit {100 * LEAST_SHARE:.0f} %)"
        reasons.append(Reason(ReasonCode.TRACE, "shot", text))
    return reasons


JUDGED_TOGETHER = (ReasonCode.RIG, ReasonCode.SENSOR, ReasonCode.METHOD)
"""By how much sensors are off many shots tell better than one, a rig file is doubted for all of them, and a campaign
has a method of its own."""


def against_this_shot(reasons: Sequence[Reason], rig: Rig) -> tuple[Reason, ...]:
    """Return the reasons for which the shot is left out of a campaign.

    What many shots are judged by together is none of them, and neither is a carriage sensor that is noisy in a weak
    shot: it has its part in the budget.
    """
    carriage = {spec.name for spec in rig.channels if spec.role in CARRIAGE_ROLES}
    return tuple(
        reason
        for reason in reasons
        if reason.code not in JUDGED_TOGETHER and not (reason.code is ReasonCode.NOISE and reason.about in carriage)
    )


def doubted_sensors_or_mass(calibration: Calibration, constancy: MassConstancy | None) -> list[Reason]:
    """Name what contradicts the rest: sensors, or a constant mass where a change explains more than any sensor."""
    doubts = doubted_sensors(calibration)
    if constancy is None or constancy.constant():
        return doubts
    likeliest = likeliest_sensor(calibration)
    compared = (
        f"the log likelihood rises by {likeliest.gain:.1f} if {likeliest.source} is off, by {constancy.gain:.1f} if "
        "mass, friction or the breech chain changes"
    )
    said = f"{str(constancy).rstrip('.')} ({compared}): see the mass over time, one number does not describe it"
    if constancy.gain > likeliest.gain:
        others = [one for one, w in _judged(calibration) if abs(w) > CRITICAL_VALUE and one != likeliest.source]
        beside = (
            f"; if the mass does not change, {', '.join(others)} would contradict the other sensors, too"
            if others
            else ""
        )
        return [Reason(ReasonCode.CONSTANCY, "shot", said + beside), *doubted_sensors(constancy.changed)]
    # a sensor that is off explains more, and may look like a mass that changes
    if doubts:
        return [Reason(ReasonCode.CONSTANCY, doubts[0].about, f"{doubts[0]}; {compared}"), *doubts[1:]]
    either = (
        f"either mass, friction or the breech chain changes or {likeliest.source} is off, the shot cannot tell: {said}"
    )
    return [Reason(ReasonCode.CONSTANCY, likeliest.source, either)]


@dataclass(frozen=True)
class Explanation:
    """How well a sensor that is off explains a shot.

    Attributes
    ----------
    source
        Name of its row in the budget; ``none`` where there is none.
    gain
        By how much the largest log likelihood rises if its calibration is forgotten: half the square of its normalised
        residual.
    """

    source: str
    gain: float


def likeliest_sensor(calibration: Calibration) -> Explanation:
    """Return what explains a shot best beside a mass that changes, however little that is."""
    sensors = {source: 0.5 * w * w for source, w in _judged(calibration)}
    return max(
        (Explanation(*one) for one in sensors.items()), key=lambda one: one.gain, default=Explanation("none", 0.0)
    )


def doubted_sensors(calibration: Calibration) -> list[Reason]:
    """Name the calibrations that contradict the shot, the least likely first.

    One wrong sensor pulls on those that it is compared with; which of them it is the shot alone may
    not tell, so all that are beyond the limit are named. By how much the others say that it is off is its
    pull over its redundancy, the square of pull over normalised residual; the standard uncertainty of that is the size
    over the normalised residual. What would have to be off by far more of its standard uncertainties than another that
    explains the shot as well is no likely explanation, and stands behind all others.
    """
    pulls, residuals, known = calibration.pulls, calibration.normalised_residuals, calibration.known_beforehand
    beyond = {
        source: (abs(w), w * w / abs(pulls[source])) for source, w in _judged(calibration) if abs(w) > CRITICAL_VALUE
    }
    sizes_down = sorted(beyond, key=lambda source: -beyond[source][0])
    unlikely = [
        source
        for source in sizes_down
        if any(size >= beyond[source][0] - ALIKE and FAR * off < beyond[source][1] for size, off in beyond.values())
    ]
    named = [source for source in sizes_down if source not in unlikely]
    doubts = []
    while named:
        source, *same = [other for other in named if _indistinguishable(named[0], other, beyond)]
        named = [other for other in named if other not in (source, *same)]
        senses = {one: _sense(one, residuals[one]) for one in (source, *same)}
        sizes = {one: _size(residuals[one], beyond[one][1], *known[one]) for one in (source, *same)}
        text = (
            f"{source} contradicts the other sensors: it {senses[source]} by {beyond[source][1]:.3g} of its standard "
            f"uncertainties if they are right{sizes[source]} ({beyond[source][0]:.1f} standard deviations, limit "
            f"{CRITICAL_VALUE:g})"
            + "".join(f", or {one} {senses[one]} by {beyond[one][1]:.3g} of its own{sizes[one]}" for one in same)
        )
        doubts.append(Reason(ReasonCode.SENSOR, source, text))
    doubts += [
        Reason(
            ReasonCode.SENSOR,
            source,
            f"{source} contradicts the other sensors, too, but would have to be off by {beyond[source][1]:.3g} of its "
            f"standard uncertainties ({beyond[source][0]:.1f} standard deviations, limit {CRITICAL_VALUE:g}): what "
            "stands before it is the likelier cause",
        )
        for source in unlikely
    ]
    return doubts


def nearly_doubted(calibration: Calibration) -> list[str]:
    """Say which calibrations are within the limit by little: a second explanation where another is named."""
    return [
        f"{source} {_sense(source, w)} by {abs(w):.1f} standard deviations if the others are right: within the limit "
        f"of {CRITICAL_VALUE:g} by little"
        for source, w in _judged(calibration)
        if NEAR < abs(w) <= CRITICAL_VALUE
    ]


def _judged(calibration: Calibration) -> list[tuple[ErrorSource, float]]:
    """Return the normalised residuals of what can be off: how the stop lets go is of the firing, and of no sensor."""
    return [(source, w) for source, w in calibration.normalised_residuals.items() if source != RELEASE]


def _size(w: float, off: float, u: float, unit: str) -> str:
    """Say how far something is off in its unit, with the standard uncertainty of that; a scale in percent.

    What has no unit of its own is counted in its standard uncertainties alone.
    """
    size, shown = off * u, unit
    if unit == "1":
        if u == 1.0:
            return ""
        size, shown = 100.0 * abs(math.expm1(math.copysign(size, w))), "%"
    size, u_size = (float(f"{one:.2g}") for one in (size, size / abs(w)))
    return f", {size:g} {shown} with u {u_size:g} {shown}"


def _indistinguishable(one: ErrorSource, other: ErrorSource, beyond: Mapping[ErrorSource, tuple[float, float]]) -> bool:
    """Return whether a shot cannot tell which of two is off.

    They share a column, are the two ends of one scale, or both make something late.
    """
    apart = abs(beyond[one][0] - beyond[other][0])
    alike = {one, other} == {ACCELERATION, CAMERA_SCALE} or (one.is_of_time and other.is_of_time)
    return apart < (ALIKE if alike else ROUNDING)


def _sense(source: ErrorSource, w: float) -> str:
    """Say in which direction something is off."""
    if source.is_of_time:
        return "is late" if w > 0 else "is early"
    return "reads high" if w > 0 else "reads low"


def _not_shared(source: ErrorSource) -> bool:
    return source in (RANDOM, ACCELERATION, CAMERA_SCALE)


def notes_on(fired: FiredShot, route: Route, trace: MassTrace) -> tuple[str, ...]:
    """Say what a reader should know although it does not make the result invalid.

    Parameters
    ----------
    fired
        Shot and rig; a role that the rig has no channel of is one of its assumptions, and no note.
    trace
        Of the method that was asked for.
    """
    signals, shift, recorded = route.signals, route.zero_shift, route.recorded
    notes = [] if route.tracked is None else notes_on_track(fired, route.tracked, route.calibration)
    notes += [
        f"no usable channel of role {role}: its term in the equation of motion is taken at rest"
        for role in CARRIAGE_ROLES
        if role not in signals.series and fired.rig.by_role(role) is not None
    ]
    if recorded.interval_s[1] >= recorded.times_s[-1]:
        notes.append("the record ends before the recoil does: the interval ends with it")
    notes += [f"{count} samples not identified: {reason}" for reason, count in trace.reasons.items()]
    notes += nearly_doubted(route.calibration)
    if shift is not None and shift.demanded and shift.confirmed:
        notes.append(
            f"the accelerometer's zero shifted at the shot {shift}, as force and camera tell: it is taken off, at the "
            "cost of a wider interval; check its mounting and charge amplifier"
        )
    return tuple(notes)
