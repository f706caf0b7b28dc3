"""Largest consequence for the mass of a channel that only corrects, before there is an estimate.

The mass is force over acceleration; the carriage's sensors only correct that acceleration for where the accelerometer
sits, and the camera's travel for the carriage's motion. So a failed check of theirs is worth what the mass moves by if
they read something else: of a sensor that is noisy, with its noise once more; of one that lost samples, nothing at all.
The shift of a mass ``m = F / a`` for an error ``d`` of ``a`` is ``-m (a, d) / (a, a)``; that by frames is the same of
velocities or travels. The largest of them is taken, and the frames as if the mass were theirs alone.

What moves the mass by little is a warning. What may move it by more, and may be missing, is set aside: the mass is then
found as if it were missing, so that a bad sensor is never judged more strictly than none. A sensor that reads
something wrong (turned, not connected) stays a failure: it is mended before the next shot.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.measured import worded
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import Shot
from recoil_processing.alignment.motion_alignment import shows_motion
from recoil_processing.double_integral import integrate
from recoil_processing.gaps import bridge
from recoil_processing.shot.kinematics import (
    AngularMotion,
    angular_motion,
    inertial_acceleration,
    seen_acceleration,
    turning_as_one,
)
from recoil_processing.shot.motion_role import motion_role
from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_processing.shot.signals import Signals
from recoil_processing.shot.verdict.channel_quality import LEAST_SAMPLES, aligned_by
from recoil_processing.shot.verdict.motion_quality import Recoil
from recoil_rigs.rig import ChannelSpec, Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.rig_tables import CARRIAGE_ACCELERATIONS, CARRIAGE_ROLES

LEAST_CONSEQUENCE = 0.1
"""Share of the mass's standard uncertainty below which a failed check is a warning: it adds half a percent to it."""
NOISY = frozenset({Check.BASELINE, Check.FILTERED_NOISE, Check.HUM})
"""Checks of a channel's noise: its rest shows what that is."""
LOSSY = frozenset(
    {Check.LOSSES, Check.HELD_VALUES, Check.RANGE, Check.FLAT_TOPS, Check.LEVEL_AFTER}
    | {Check.MISSING_FRAMES, Check.STREAM}
)
"""Checks of what is lost of a channel, or of a source's channels."""
ABSENT = LOSSY | {
    Check.FILE, Check.DELIVERY, Check.CONNECTION, Check.KERNEL_DROPS, Check.DAMAGED_ENTRIES, Check.LOST_FRAMES,
    Check.ALIGNMENT,
}  # fmt: skip
"""Checks that fail of what is not there: a source without a file, or a channel without a sample."""
WITHOUT = "the mass is found without it"
MISSABLE = (*CARRIAGE_ACCELERATIONS, "carriage_rate")
"""Roles without which a mass by the accelerometer is valid: frames are not used, or a row of the budget stands in."""
MOST_LOST = 0.2
"""Share of a channel's samples in the recoil that may be lost: what is left then still shows how large it was."""
PLACES = 8
"""Number of places at which the noise of the rest is laid over the shot."""


@dataclass(frozen=True)
class Consequence:
    """By how much a mass may move.

    Attributes
    ----------
    mass_kg
        Largest shift of the mass.
    share
        Share of the least standard uncertainty that the mass can have.
    """

    mass_kg: float
    share: float

    def __str__(self) -> str:
        if not self.mass_kg:
            return "no mass hangs on it"
        return (
            f"it moves the mass by up to {self.mass_kg:.2g} kg, {self.share:.2g} of its u (limit {LEAST_CONSEQUENCE:g})"
        )


def weighed(checks: Sequence[QualityCheck], fired: FiredShot, recoil: Recoil | None) -> list[QualityCheck]:
    """Let a failed check count by what it can do to the mass: below `LEAST_CONSEQUENCE` it is a warning.

    Parameters
    ----------
    recoil
        Motion of the shot; None where none was recorded: a shot that no mass can be asked of has other reasons, and
        what only corrects warns.

    Returns
    -------
    list of QualityCheck
        Checks as they count, with one more for each channel that is set aside.
    """
    judged: list[QualityCheck] = []
    aside: dict[str, QualityCheck] = {}
    gone = _dispensable(fired)
    asked = motion_role(fired) == "recoil_displacement" or not (
        recoil is None or recoil.regression is None or recoil.turned
    )
    for check in checks:
        if check.verdict == "fail" and check.check in ABSENT and (what := gone.get(check.channel)) is not None:
            if what in aside:
                judged.append(replace(check, verdict="warn"))
            else:
                aside[what] = QualityCheck(what, Check.SET_ASIDE, "warn", worded(check.detail, f"; {WITHOUT}"))
            continue
        concerned = _concerned(check, fired) if check.verdict == "fail" else None
        worst = None if concerned is None else consequence(fired, recoil, concerned, noise=check.check in NOISY)
        if concerned is not None and not asked:
            detail = check.detail if worst is None else worded(check.detail, f"; {worst}")
            judged.append(replace(check, verdict="warn", detail=detail))
            continue
        if concerned is None or worst is None:
            judged.append(check)
            continue
        detail = worded(check.detail, f"; {worst}")
        small = worst.share <= LEAST_CONSEQUENCE
        missable = motion_role(fired) == "recoil_acceleration" and concerned <= set(MISSABLE)
        judged.append(replace(check, verdict="warn" if small or missable else "fail", detail=detail))
        if missable and not small:
            names = [c.name for role in sorted(concerned) for c in fired.shot.with_role(role)]
            text = f"{WITHOUT}, because of its {check.name}: mend it before the next shot"
            aside |= {name: QualityCheck(name, Check.SET_ASIDE, "warn", text) for name in names if name not in aside}
    return [*judged, *aside.values()]


def _dispensable(fired: FiredShot) -> dict[str, str]:
    """Return what recorded nothing and the mass does not hang on: channels, and sources that have no other.

    Returns
    -------
    dict of str to str
        Name of each channel and source -> name of the source if that has no other channel, else of the channel.
    """
    rig, found = fired.rig, dict[str, str]()
    there = {name for name, channel in fired.shot.channels.items() if _recorded(channel)}
    left = FiredShot(replace(fired.shot, channels={name: fired.shot.channels[name] for name in there}), rig)
    for source in rig.sources:
        specs = rig.channels_of(source.name)
        if source.name == rig.reference_clock or not specs:
            continue
        absent = [spec for spec in specs if spec.name not in there]
        if needs(left, absent):
            continue
        whole = len(absent) == len(specs)
        found |= {spec.name: source.name if whole else spec.name for spec in absent}
        found |= {source.name: source.name} if whole else {}
    return found


def _recorded(channel: Channel) -> bool:
    """Return whether a channel has samples, and a track a motion: a film of before or behind it shows nothing."""
    if int(np.count_nonzero(np.isfinite(channel.measured))) < LEAST_SAMPLES:
        return False
    return channel.role != "recoil_displacement" or shows_motion(channel.measured)


def needs(fired: FiredShot, absent: Sequence[ChannelSpec]) -> bool:
    """Return whether there is no mass, or none that is valid, without some channels of the rig.

    Parameters
    ----------
    fired
        Shot without them.
    absent
        Channels that are not in it.
    """
    if any(not fired.of_force(force) for force in fired.rig.forces if any(one in absent for one in force.channels)):
        return True
    motion, mechanism = motion_role(fired), fired.rig.mechanism
    needed = {"tipping_rate", *(mechanism.motion_roles if motion is None else ())}
    if mechanism.needs_carriage(motion):
        needed |= set(mechanism.carriage_roles)
    if any(spec.role in needed and fired.shot.by_role(spec.role) is None for spec in absent):
        return True
    names = {spec.name for spec in absent}
    clocks = {channel.time_base.clock for channel in fired.shot.channels.values() if channel.role}
    return any(source.name in clocks and names & aligned_by(source) for source in fired.rig.sources)


def set_aside(shot: Shot) -> tuple[QualityCheck, ...]:
    """Return why which channels are set aside, by their checks."""
    return tuple(check for check in shot.quality if check.check is Check.SET_ASIDE)


def consequence(
    fired: FiredShot, recoil: Recoil | None, roles: Collection[str], *, noise: bool = False
) -> Consequence | None:
    """Return by how much the mass moves at most if sensors of some of `CARRIAGE_ROLES` read nothing, or are noisy.

    Parameters
    ----------
    roles
        Roles of the sensors; no mass hangs on none.
    noise
        Whether only their noise is wrong.

    Returns
    -------
    Consequence or None
        Consequence of the sensors; None where the record does not show how much they contributed.
    """
    if not roles:
        return Consequence(0.0, 0.0)
    if recoil is None or recoil.regression is None or recoil.turned:
        return None
    series, inside = recoil.signals.series, recoil.regression.inside
    for role in roles:
        seen = series[role][inside] if role in series else np.zeros(0)
        if seen.size == 0 or np.mean(~np.isfinite(seen)) > MOST_LOST or not np.ptp(seen[np.isfinite(seen)]) > 0:
            return None
    camera = fired.shot.by_role("recoil_displacement") is not None
    others = _noisier(recoil, fired.rig, roles) if noise else ()
    shares = [_share(recoil, fired.rig, *other, camera=camera) for other in others or _silent(recoil, fired.rig, roles)]
    worst, least_u = max(shares), least_u_rel(fired.rig)
    return Consequence(worst * fired.rig.mechanism.m3, worst / least_u if least_u > 0 else math.inf)


def least_u_rel(rig: Rig) -> float:
    """Return the least relative standard uncertainty that a mass can have: that of force over length.

    Only the certificates count, and every sensor as if it measured all of the force or of the motion: what they have
    in common, frictions, zeros and noise come on top.
    """
    scales = scale_uncertainty(rig)
    camera = rig.by_role("recoil_displacement")
    lengths = [scales.acceleration] if rig.by_role("recoil_acceleration") is not None else []
    lengths += [camera.sensor.u_scale_rel] if camera is not None else []
    return math.hypot(_together(scales.gauges), _together(lengths))


def _together(u_rel: Sequence[float]) -> float:
    """Return the standard uncertainty of what several independent sensors say of one scale."""
    return 1.0 / math.sqrt(math.fsum(u**-2 for u in u_rel)) if u_rel and all(u > 0 for u in u_rel) else 0.0


def _concerned(check: QualityCheck, fired: FiredShot) -> frozenset[str] | None:
    """Return the roles whose readings a failed check doubts; None if any of them does more than correct."""
    named = [spec for spec in fired.rig.channels if spec.name == check.channel]
    if not named and check.check in LOSSY and check.channel != fired.rig.reference_clock:
        sources = [source.name for source in fired.rig.sources if source.name == check.channel]
        named = [
            spec for source in sources for spec in fired.rig.channels_of(source) if spec.name in fired.shot.channels
        ]
    if not named:
        return None
    roles = {spec.role for spec in named if spec.role}
    # what does nothing but align a clock is behind every channel on that
    by_it = {spec.name for spec in named if not spec.role}
    aligned = [source.name for source in fired.rig.sources if by_it & aligned_by(source)]
    roles |= {spec.role for source in aligned for spec in fired.rig.channels_of(source) if spec.role}
    if roles and check.check not in NOISY | LOSSY:
        return None
    return frozenset(roles) if roles <= set(CARRIAGE_ROLES) else None


def _silent(recoil: Recoil, rig: Rig, roles: Collection[str]) -> list[tuple[Signals, AngularMotion]]:
    """Return signals and motion without some sensors: at rest, or the carriage turning with the tipping part."""
    signals = recoil.signals
    silent = replace(signals, series={role: s for role, s in signals.series.items() if role not in roles})
    found = [(silent, angular_motion(silent, rig))]
    if "carriage_rate" in roles and "tipping_rate" not in roles:
        found.append((signals, turning_as_one(recoil.motion)))
    return found


def _noisier(recoil: Recoil, rig: Rig, roles: Collection[str]) -> list[tuple[Signals, AngularMotion]]:
    """Return signals and motion with the rest's noise laid over the shot, at several places; none without a rest."""
    signals = recoil.signals
    rests = {role: signals.series[role][signals.in_baseline] for role in roles}
    rests = {role: rest[np.isfinite(rest)] for role, rest in rests.items()}
    if min(rest.size for rest in rests.values()) < LEAST_SAMPLES:
        return []
    found = []
    for place in range(PLACES):
        noisier = dict(signals.series)
        for role, rest in rests.items():
            again = np.resize(rest - np.mean(rest), noisier[role].size)
            noisier[role] = noisier[role] + np.roll(again, place * rest.size // PLACES)
        other = replace(signals, series=noisier)
        found.append((other, angular_motion(other, rig)))
    return found


def _share(recoil: Recoil, rig: Rig, other: Signals, motion: AngularMotion, *, camera: bool) -> float:
    """Return the share of the mass by which it moves if carriage and tipping part move otherwise."""
    regression = recoil.regression
    if regression is None:
        return 0.0
    inside, step_s = regression.inside, regression.step_s

    def moved(of: Array, by: Array) -> float:
        a, d = of[inside], (by - of)[inside]
        return abs(float(a @ d)) / max(float(a @ a), 1e-300)

    def smooth(samples: Array) -> Array:
        return recoil.low_pass.apply(bridge(samples, otherwise=0.0), regression.rate_hz) * regression.released

    felt = [smooth(inertial_acceleration(s, rig, m)) for s, m in ((recoil.signals, recoil.motion), (other, motion))]
    shares = [moved(*felt)]
    if camera:
        seen = [smooth(recoil.acceleration), smooth(seen_acceleration(other, rig, motion))]
        for _ in range(3):
            shares.append(moved(*seen))
            seen = [integrate(one, step_s) for one in seen]
    return max(shares)
