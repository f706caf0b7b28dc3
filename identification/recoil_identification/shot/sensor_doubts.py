"""Doubts of a shot's sensors and of a constant mass, and which of them speak against the mass."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.gauge_agreement import ALIKE
from recoil_identification.calibration.mass_over_time import MassConstancy
from recoil_identification.calibration.suspicion import LITTLE, ShotSuspicion
from recoil_identification.estimate.mass import ACCELERATION, GAUGES, MassEstimate
from recoil_identification.rows.breech_chain import OF_CHAIN
from recoil_identification.rows.known_forces import is_declared
from recoil_identification.rows.sensor_priors import CAMERA_SCALE
from recoil_identification.rows.unread_resistance import SHARE, SLIDE
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.sensor_scales import BORE_FRICTION, dynamic_scale

ROUNDING = 1e-6
"""Difference of two that are one and the same."""
FAR = 3.0
"""Factor on how far, in its standard uncertainties, something would have to be off, beyond which another is taken."""
LEAST_GAIN = 0.5
"""Gain of the breech chain over that of the likeliest sensor, from which on it is named beside it."""
DRIVING = (
    GAUGES[0],
    ErrorSource(SourceKind.SENSITIVITY, "breech_pressure"),
    dynamic_scale("breech_pressure"),
    SHARE,
    BORE_FRICTION,
)
"""Sources of which one that is off looks like another to a shot: breech gauge, unread resistance, friction in the
bore."""
NEAR = 3.0
"""Normalised residual of a sensor from which on it is mentioned, as a second explanation or the beginning of one."""


def weighed_doubts(
    calibration: Calibration, constancy: MassConstancy | None, chain: ShotSuspicion | None = None
) -> list[tuple[Reason, str]]:
    """List the doubts of sensors, breech chain and a constant mass, each with why it is none of the mass, or ``""``.

    A certificate that the shot contradicts is a reason whatever it does to the mass. Of what the shot alone knows
    (zeros, delays, the picture, the carriage's part) there are some thirty, and of a sound shot one of them is beyond
    the critical value now and then: such a doubt decides by the mass that it would give.
    """
    estimate = calibration.estimate
    low, high = estimate.interval_kg
    judged: list[tuple[Reason, str]] = []
    changes = constancy is not None and not constancy.constant
    if constancy is not None and changes and low <= min(constancy.ends_kg) <= max(constancy.ends_kg) <= high:
        held = "the interval of the mass holds both"
        judged.append((Reason(ReasonCode.CONSTANCY, "shot", str(constancy).rstrip(".")), held))
        constancy = None
    rows = {row.source: row.u_kg for row in estimate.budget}
    own = {source for prior in calibration.own for source in prior.sources}
    beside: dict[str, ErrorSource] = {source: source for source in calibration.sources if source in own}
    named = None if chain is None or (constancy is not None and not constancy.constant) else _rank(calibration, chain)
    # what speaks against the mass does so by its right name, too
    refused = named == "first" and any(not held for _, held in weighed_doubts(calibration, constancy))
    if chain is not None and named == "first":
        judged.append(_doubted_chain(estimate, chain, refused))
        calibration = chain.explained
    for doubt in doubted_sensors_or_mass(calibration, constancy):
        held, source = "", beside.get(doubt.about)
        decides = constancy is not None and constancy.by_a_sensor  # in the place of a mass that changes
        if (
            doubt.code is ReasonCode.SENSOR
            and source is not None
            and source in rows
            and not decides
            and not is_declared(source)
        ):
            # released, it is off by w^2 / pull of its standard uncertainties; what one of them does the budget says
            w, pull = calibration.normalised_residuals[source], calibration.pulls[source]
            moves_kg = rows[source] * w * w / abs(pull)
            if moves_kg <= 0.5 * (high - low):
                held = f"the mass would move by {moves_kg:.2g} kg, which its interval holds"
        judged.append((doubt, held))
    if chain is not None and named == "beside":
        judged.append(_doubted_chain(estimate, chain, refused))
    # what stands before the first that speaks against the mass explains the shot better: it is named with it
    against = next((at for at, (_, held) in enumerate(judged) if not held), 0)
    return [
        (doubt, "" if at < against and doubt.code is ReasonCode.SENSOR else held)
        for at, (doubt, held) in enumerate(judged)
    ]


def _rank(calibration: Calibration, chain: ShotSuspicion) -> Literal["first", "beside"] | None:
    """Return whether the breech chain is named before the sensors that contradict the others, or after them; or not.

    It stands before one that explains less, and, if it is of the breech chain, before one that would have to be off by
    far more of its standard uncertainties: but a delay, of which a clock may have any. A slow error of a reading, and a
    part that hangs, take a little of the form of whatever is off by much.
    """
    if not chain.suspected:
        return None
    likeliest = likeliest_sensor(calibration)
    if likeliest.gain <= 0.5 * CRITICAL_VALUE**2 or chain.gain >= likeliest.gain:
        return "first"
    if chain.gain < LEAST_GAIN * likeliest.gain:
        return None
    source = next(one for one in calibration.judged_residuals if one == likeliest.source)
    off = calibration.normalised_residuals[source] ** 2 / abs(calibration.pulls[source])
    return "first" if chain.source.kind in OF_CHAIN and not source.is_of_time and off > FAR * chain.off else "beside"


def _doubted_chain(estimate: MassEstimate, chain: ShotSuspicion, refused: bool) -> tuple[Reason, str]:
    """State the doubt of the breech chain, and why it is none of the mass; ``""`` where it is one.

    Where the mass would be `refused` by what the breech chain explains better, it is.
    """
    little = not refused and chain.spread_rel <= LITTLE * estimate.u_kg / estimate.mass_kg
    held = "its interval holds that" if little else ""
    return Reason(ReasonCode.BREECH_CHAIN, chain.source, str(chain).rstrip(".")), held


def notes_on_doubts(
    calibration: Calibration, constancy: MassConstancy | None, chain: ShotSuspicion | None = None
) -> list[Note]:
    """Say which doubts do not speak against the mass, and why not."""
    judged = weighed_doubts(calibration, constancy, chain)
    return [Note(one.code, one.about, f"{one}; {held}") for one, held in judged if held]


def doubted_sensors_or_mass(calibration: Calibration, constancy: MassConstancy | None) -> list[Reason]:
    """Name what contradicts the rest: sensors, or a constant mass where a change explains more than any sensor."""
    doubts = doubted_sensors(calibration)
    if constancy is None or constancy.constant:
        return doubts
    likeliest = likeliest_sensor(calibration)
    compared = (
        f"the log likelihood rises by {likeliest.gain:.1f} if {likeliest.source} is off, by {constancy.gain:.1f} if "
        f"{constancy.what_changes} changes"
    )
    said = f"{str(constancy).rstrip('.')} ({compared}): see the mass over time, one number does not describe it"
    if constancy.gain > likeliest.gain:
        others = [
            one
            for one, w in calibration.judged_residuals.items()
            if abs(w) > CRITICAL_VALUE and one != likeliest.source
        ]
        beside = (
            f"; if the mass does not change, {', '.join(others)} would contradict the other sensors, too"
            if others
            else ""
        )
        return [Reason(ReasonCode.CONSTANCY, "shot", said + beside), *doubted_sensors(constancy.changed)]
    either = f"either {constancy.what_changes} changes or {likeliest.source} is off, the shot cannot tell: {said}"
    return [Reason(ReasonCode.CONSTANCY, likeliest.source, either)]


@dataclass(frozen=True)
class Explanation:
    """How well a sensor that is off explains a shot.

    Attributes
    ----------
    source
        Name of its row in the budget; ``none`` where there is none.
    gain
        Amount by which the largest log likelihood rises if its calibration is forgotten: half the square of its
        normalised residual.
    """

    source: str
    gain: float


def likeliest_sensor(calibration: Calibration) -> Explanation:
    """Return what explains a shot best beside a mass that changes, however little that is."""
    sensors = {source: 0.5 * w * w for source, w in calibration.judged_residuals.items()}
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
        source: (abs(w), residuals[source] ** 2 / abs(pulls[source]))
        for source, w in calibration.judged_residuals.items()
        if abs(w) > CRITICAL_VALUE
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
        alike = [other for other in named if _indistinguishable(named[0], other, beyond)]
        if not set(DRIVING).isdisjoint(alike):  # within the limit, too: one column is theirs
            driving = [one for one in DRIVING if residuals.get(one)]
            alike = [*driving, *(one for one in alike if one not in driving)]
        source, *same = alike
        named = [other for other in named if other not in (source, *same)]
        senses = {one: _sense(one, residuals[one]) for one in (source, *same)}
        off = {one: residuals[one] ** 2 / abs(pulls[one]) for one in (source, *same)}
        sizes = {one: _size(residuals[one], off[one], *known[one]) for one in (source, *same)}
        worst = max(beyond.get(one, (abs(residuals[one]), 0.0))[0] for one in (source, *same))
        text = (
            f"{source} contradicts {_against(source)}: it {senses[source]} by {off[source]:.3g} of its standard "
            f"uncertainties if they are right{sizes[source]} ({worst:.1f} standard deviations, limit "
            f"{CRITICAL_VALUE:g})"
            + "".join(f", or {one} {senses[one]} by {off[one]:.3g} of its own{sizes[one]}" for one in same)
        )
        doubts.append(Reason(ReasonCode.SENSOR, source, text))
    doubts += [
        Reason(
            ReasonCode.SENSOR,
            source,
            f"{source} contradicts {_against(source)}, too, but would have to be off by {beyond[source][1]:.3g} of its "
            f"standard uncertainties ({beyond[source][0]:.1f} standard deviations, limit {CRITICAL_VALUE:g}): what "
            "stands before it is the likelier cause",
        )
        for source in unlikely
    ]
    return doubts


def nearly_doubted(calibration: Calibration) -> list[Note]:
    """Say which calibrations are within the limit by little: a second explanation where another is named."""
    return [
        Note(
            NoteCode.NEAR_LIMIT,
            source,
            f"{source} {_sense(source, w)} by {abs(w):.1f} standard deviations if the others are right: within the "
            f"limit of {CRITICAL_VALUE:g} by little",
        )
        for source, w in calibration.judged_residuals.items()
        if NEAR < abs(w) <= CRITICAL_VALUE
    ]


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

    They share a column, are the two ends of one scale, or both make something late. More of the driving force and less
    of the resistance are one to a shot.
    """
    apart = abs(beyond[one][0] - beyond[other][0])
    alike = {one, other} == {ACCELERATION, CAMERA_SCALE} or (one.is_of_time and other.is_of_time)
    if one in DRIVING and other in DRIVING:
        return True
    return apart < (ALIKE if alike else ROUNDING)


def _against(source: ErrorSource) -> str:
    """Say what something contradicts: what is declared of a force has its gauge on the other side."""
    return f"{source.of} and the other sensors" if is_declared(source) else "the other sensors"


def _sense(source: ErrorSource, w: float) -> str:
    """Say in which direction something is off."""
    if is_declared(source):
        return "is declared too large" if w > 0 else "is declared too small"
    if source.is_of_time:
        never = ", which no line and no orifice makes it," if source.is_late_alone else ""
        return "is late" if w > 0 else f"is early{never}"
    if source == BORE_FRICTION:
        return "takes off more" if w > 0 else "takes off less"
    if source in (SHARE, SLIDE):
        return "is larger" if w > 0 else "is smaller"
    return "reads high" if w > 0 else "reads low"
