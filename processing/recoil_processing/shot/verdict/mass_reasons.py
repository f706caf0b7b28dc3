"""Reasons against a mass of a shot's record, whatever it is found by: one rule, at the range and at the desk.

``ingest`` asks it before the next shot is fired, identification before it trusts its own mass and adds what only an
estimate can tell. So a shot that is usable at the range is valid at the desk unless its estimate says otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.measured import worded
from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_acquisition.shot.shot import doubted_clocks as clocks_in_doubt
from recoil_processing.filters import LowPass
from recoil_processing.shot.clocks.camera_stand import contradicts_stand
from recoil_processing.shot.clocks.force_clocks import METHOD as BY_FORCE
from recoil_processing.shot.clocks.force_clocks import recoil_only
from recoil_processing.shot.clocks.forced_recoil import ForcedRecoil, carriage_lacks
from recoil_processing.shot.instants import delay_of
from recoil_processing.shot.kinematics import lacks
from recoil_processing.shot.motion_role import motion_lacks, motion_role
from recoil_processing.shot.regression import Regression, telling_rows
from recoil_processing.shot.signals import Signals, at_instants, collect_signals
from recoil_processing.shot.thinned import thinned
from recoil_processing.shot.verdict.consequence import set_aside
from recoil_processing.shot.verdict.motion_quality import recoil_of
from recoil_rigs.rig import ChannelSpec, Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.rig_tables import FORCE_ROLES

LARGEST_LOSS = 0.8
"""Share of the squares of the force that may be lost: beyond it the mass hangs on the slow rest of the motion, and on
the friction."""
LARGEST_PART = 0.5
"""Share of the variance of a clock's offset from which on one delay is what to declare before anything else."""


def against_the_record(fired: FiredShot) -> tuple[Reason, ...]:
    """Say what speaks against a mass of a record in which no check failed, before there is an estimate.

    Parameters
    ----------
    fired
        Shot with its alignments, and its rig.

    Returns
    -------
    tuple of Reason
        Reasons, the first one first. What a failed check says already is none of them.
    """
    fired, _ = thinned(fired)
    alignments = {a.clock: a for a in fired.shot.alignments}
    said = {(check.check, check.channel) for check in fired.shot.failed}
    failed = {clock for clock, one in alignments.items() if one.status == "failed"}
    reasons = [
        *doubts_of(fired.rig),
        *(one for one in doubted_clocks(fired) if one.about not in failed),
    ]
    role = motion_role(fired)
    motionless = []
    if role is None:
        found = ", and ".join(motion_lacks(fired, one) for one in fired.rig.mechanism.motion_roles)
        remedy = "add its file, or declare its role in the rig file"
        motionless = [Reason(ReasonCode.ROLE, "shot", f"no mass without a motion: {found}; {remedy}")]
    try:
        signals = collect_signals(fired, alignments)
    except IdentificationError as error:
        known = (Check.ONSET, "shot") in said
        return (*reasons, *motionless, *(() if known else (Reason(ReasonCode.ROLE, "shot", str(error)),)))
    forceless = list(without_forces(signals, fired.rig))
    reasons += [*forceless, *motionless]
    by_camera = fired.rig.mechanism.needs_carriage(role)
    if by_camera and (missing := carriage_lacks(signals, fired.rig)):
        against = "which turned the bore" if fired.rig.camera_on_ground else "from which the camera sees the recoil"
        text = f"no usable channel of role {', '.join(missing)}: nothing tells how the tipping part moved, {against}"
        reasons.append(Reason(ReasonCode.ROLE, missing[0], f"{text}; record it"))
    reasons += against_signals(signals, fired.rig)
    if role is None or forceless or (by_camera and missing):
        return tuple(reasons)
    recoil = None if by_camera else recoil_of(fired, alignments)
    if recoil is not None and recoil.regression is not None:
        filtered = recoil.regression.filtered(LowPass(recoil.low_pass.cutoff_hz))
        if not bool(recoil.regression.trusted[recoil.regression.inside].all()):
            reasons += against_losses(fired.shot, lost_share(filtered))
    try:
        if by_camera:
            _require_track(fired, signals)
        elif recoil is not None and recoil.regression is not None:
            telling_rows(filtered)
    except IdentificationError as error:
        reasons.append(Reason(ReasonCode.NOT_IDENTIFIED, "shot", f"no mass: {error}"))
    return tuple(reasons)


def _require_track(fired: FiredShot, signals: Signals) -> None:
    """Refuse frames and forces that tell no mass.

    Raises
    ------
    IdentificationError
        As identification by the camera does.
    """
    camera = fired.shot.by_role("recoil_displacement")
    if camera is None:
        return
    camera = at_instants(camera, fired)
    clock = fired.shot.alignment(camera.time_base.clock)
    u_shift_s = math.inf if clock.method == BY_FORCE else clock.u_offset_s
    frames_s, positions_m = clock.to_reference(camera.time_base.times_s), recoil_only(camera.measured)
    ForcedRecoil.of(fired, signals).camera_track_mass(frames_s, positions_m, u_shift_s=u_shift_s)


def failed_checks(shot: Shot, unused: Collection[str] = ()) -> Iterator[Reason]:
    """Say which checks failed; that of a clock's alignment is `doubted_clocks`' to say.

    Parameters
    ----------
    unused
        Channels that the mass does not hang on.
    """
    for check in shot.failed:
        if check.check is not Check.ALIGNMENT and check.channel not in unused:
            code = ReasonCode.NOISE if check.check is Check.FILTERED_NOISE else ReasonCode.CHECK
            yield Reason(code, check.channel, worded(f"quality: {check.channel}: ", check.detail))


def unused_channels(fired: FiredShot) -> tuple[str, ...]:
    """Return the names of what a mass by the camera does not hang on: the accelerometer on the recoiling part."""
    spec, channel = fired.rig.by_role("recoil_acceleration"), fired.shot.by_role("recoil_acceleration")
    return tuple(dict.fromkeys(c.name for c in (spec, channel) if c is not None))


def doubts_of(rig: Rig) -> list[Reason]:
    """Say what a rig file would be refused for, where a shot has been recorded with it all the same."""
    return [Reason(ReasonCode.RIG, "rig file", f"rig file: {doubt}") for doubt in rig.doubts]


def doubted_clocks(fired: FiredShot) -> list[Reason]:
    """Say of each clock that was not aligned beyond doubt why, and what to declare where a delay is the cause.

    A camera whose frames tell another stand than the rig file is a fault of that file, and none of the clock.
    """
    # why one failed says what to look at
    remedies = {a.clock: f"; {_remedy(a, fired.rig)}" if a.status == "ambiguous" else "" for a in fired.shot.alignments}
    moved = [a for a in fired.shot.alignments if contradicts_stand(a)]
    dispensable = _dispensable_clocks(fired)
    clocks = [a for a in fired.shot.alignments if not contradicts_stand(a) and a.clock not in dispensable]
    return [
        *(Reason(ReasonCode.RIG, "rig file", f"rig file: {'; '.join(a.reasons)}") for a in moved),
        *(Reason(one.code, one.about, f"{one}{remedies[one.about]}") for one in clocks_in_doubt(clocks)),
    ]


def _dispensable_clocks(fired: FiredShot) -> set[str]:
    """Return the clocks of what tells the motion once more, and is left out where they are doubted.

    There the accelerometer tells the speed from the rest on. So are those of a source that recorded nothing.
    """
    aside = {check.channel for check in set_aside(fired.shot)}
    if motion_role(fired) != "recoil_acceleration":
        return aside
    telling: dict[str, set[str]] = {}
    for one in fired.channels.values():
        if one.recorded.role:
            telling.setdefault(one.recorded.time_base.clock, set()).add(one.recorded.role)
    once_more = fired.rig.mechanism.sure_roles - {"recoil_acceleration"}
    return aside | {clock for clock, roles in telling.items() if roles <= once_more}


def _remedy(alignment: ClockAlignment, rig: Rig) -> str:
    """Say what would make a clock's alignment sure: a delay where one is most of its uncertainty."""
    names = dict.fromkeys(str(part["channel"]) for part in (alignment.details or {}).get("delays", ()))
    specs = [spec for spec in rig.channels if spec.name in names]
    delays = [(delay_of(spec, rig.source(spec.source)).u_s, spec) for spec in specs]
    u_s, spec = max(delays, key=lambda one: one[0], default=(0.0, None))
    if spec is None or not u_s**2 > LARGEST_PART * alignment.u_offset_s**2:
        compared = getattr(rig.source(alignment.clock).align, "channel", None)
        unfiltered = [
            one.name for one in rig.channels
            if one.name == compared and one.sensor.filter_hz is None and "delay_s" not in one.sensor.model_fields_set
        ]  # fmt: skip
        first = f"state `filter_hz` and `delay_s` of {unfiltered[0]}, " if unfiltered else ""
        return f"{first}look at both records, or let `align` of its source name another way, before the next shot"
    return f"{_undeclared(spec)}: of its delay u is {1e3 * u_s:.2g} ms"


def _undeclared(spec: ChannelSpec) -> str:
    """Say what the rig file should state of a delay that is hardly known."""
    sensor = spec.sensor
    if "delay_s" in sensor.model_fields_set or sensor.filter_hz is None:
        return f"measure the delay of {spec.name}'s chain, and state a smaller `u_delay_s`"
    stated = "`delay_s`" if sensor.filter_type else "`delay_s`, or the `filter_type`,"
    return f"declare {stated} of {spec.name}'s sensor, from its data sheet"


def without_forces(signals: Signals, rig: Rig) -> Iterator[Reason]:
    """Name the forces that were not measured: without one of them there is no mass at all."""
    if not rig.forces:
        text = f"no channel of role {' or '.join(FORCE_ROLES)}: a motion without a force identifies no mass; record one"
        yield Reason(ReasonCode.ROLE, "rig file", text)
    for name in (force.name for force in rig.forces):
        if name not in signals.series or not np.isfinite(signals.series[name]).any():
            text = f"no usable channel of role {name}: without all forces a motion identifies no mass"
            yield Reason(
                ReasonCode.ROLE, name, f"{text}; declare its role in the rig file, or mend its clock's alignment"
            )


def against_signals(signals: Signals, rig: Rig) -> Iterator[Reason]:
    """Say what the signals lack that a valid mass needs: a rest before the shot, pressures at rest, a tipping rate."""
    # on a line the zero of an accelerometer is found with the mass, and a gauge of a force has no level at rest
    if signals.baseline_s[0] == signals.baseline_s[1] and rig.mechanism.recoils_once:
        yield Reason(
            ReasonCode.BASELINE,
            "shot",
            "no pre-trigger baseline: the zeros of the sensors, and their uncertainties, are not known; lengthen the "
            "pre-trigger",
        )
    recuperator = rig.by_role("recuperator_pressure")
    if recuperator is not None and recuperator.sensor.time_constant_s is not None:
        yield Reason(
            ReasonCode.COUPLING,
            recuperator.name,
            f"{recuperator.name} is AC-coupled (time_constant_s): it does not read the pressure at rest; record it "
            "DC-coupled",
        )
    if lacks(signals, rig, "tipping_rate"):
        yield Reason(
            ReasonCode.ROLE,
            "tipping_rate",
            "no usable channel of role tipping_rate: nothing tells how the tipping part turned, and what the "
            "accelerometer felt of that is in the mass; add its file, or mend its clock's alignment",
        )


def against_losses(shot: Shot, lost: float) -> Iterator[Reason]:
    """Say that most of the force lies where samples are lost.

    Parameters
    ----------
    lost
        Share by `lost_share`.
    """
    if lost > LARGEST_LOSS:
        where = (Check.LOSSES, Check.HELD_VALUES, Check.REFERENCE_GAP)
        channels = [c.channel for c in shot.quality if c.check in where and c.verdict != "ok"]
        yield Reason(
            ReasonCode.LOST_FORCE,
            "shot",
            f"{100 * lost:.0f} % of the shot's force lies where samples are lost, limit {100 * LARGEST_LOSS:.0f} %"
            + (f": see the losses of {', '.join(channels)}" if channels else ""),
        )


def lost_share(filtered: Regression) -> float:
    """Share of the squares of force, or of acceleration, that lies where a sample is lost, whichever is more.

    One that was differentiated is nothing but noise where its record ends.
    """
    inside, lost = filtered.inside, filtered.inside & ~filtered.trusted
    felt = filtered.motion_role == "recoil_acceleration"
    shares = [
        float(column[lost] @ column[lost]) / max(float(column[inside] @ column[inside]), 1e-300)
        for column in (filtered.force_n, *([filtered.acceleration_m_s2] if felt else []))
    ]
    return max(shares)
