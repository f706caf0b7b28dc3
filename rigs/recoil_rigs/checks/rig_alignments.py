"""Checks of a source's alignment against the rig's channels: clocks, roles, quantities that compare."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

from recoil_acquisition.errors import Fault, FaultCode, KeyPath, did_you_mean
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_rigs.rig_file import RigFile
from recoil_rigs.tables.channel_table import ChannelSpec
from recoil_rigs.tables.rig_tables import (
    FORCE_ROLES,
    MOTIONS,
    ROLES,
    AbsoluteAlignment,
    ExposureAlignment,
    MotionAlignment,
    RedundantAlignment,
    Source,
    TriggerAlignment,
)

DRIVEN = MappingProxyType(
    {
        "breech_pressure": ("recoil_displacement",),
        **dict.fromkeys(FORCE_ROLES, ("recoil_acceleration", "recoil_velocity", "recoil_displacement")),
    }
)
"""Role that stands for all forces -> roles of the motions that they drive, the one that tells most of it first."""


def motion_channels(
    source: str, channel: str | None, against: str, channels: Sequence[ChannelSpec]
) -> list[ChannelSpec]:
    """Return the channels of a source that its alignment by motion may mean, the likeliest first.

    Parameters
    ----------
    channel
        Name of the channel that the rig names; None if it names none.
    against
        Name of the channel of the reference clock.

    Returns
    -------
    list of ChannelSpec
        Channels that may be compared: the named one alone; else the one with the role of the recoil's travel, and any
        of a quantity that compares.
    """
    if channel is not None:
        return [c for c in channels if c.name == channel]
    reference = next((c for c in channels if c.name == against), None)
    if reference is None:
        return []
    if reference.role in DRIVEN:
        return [c for role in DRIVEN[reference.role] for c in channels if c.source == source and c.role == role]
    fitting = [c for c in channels if c.source == source and reference.quantity in MOTIONS.get(c.quantity, ())]
    return sorted(fitting, key=lambda c: (c.role != "recoil_displacement", c.quantity != "displacement"))


def second_way(
    source: Source, reference: str, channels: Sequence[ChannelSpec]
) -> MotionAlignment | RedundantAlignment | None:
    """Return the alignment that is the second opinion on absolute time; None where nothing else tells the offset.

    What the rig does not name is what every shot has: the recoil, which a channel of the reference clock has as an
    acceleration, or else a channel whose role one of the reference clock bears too.

    Parameters
    ----------
    reference
        Name of the reference clock.
    channels
        Channels of the rig.
    """
    align = source.align
    if not isinstance(align, AbsoluteAlignment):
        return None
    of_reference = [c for c in channels if c.source == reference and align.against in (None, c.name)]
    own = [c for c in channels if c.source == source.name and align.channel in (None, c.name)]
    drift_allowance = align.drift_allowance
    if align.against is None:
        named = align.channel is not None
        accelerometers = [c for c in of_reference if c.role == "recoil_acceleration"]
        moving = [c for c in own if named or c.role in ("recoil_displacement", "recoil_velocity")]
    else:
        accelerometers, moving = of_reference, own
    for against in accelerometers:
        fitting = [c for c in moving if c in motion_channels(source.name, align.channel, against.name, channels)]
        if fitting and fitting[0].quantity != against.quantity:
            return MotionAlignment(
                method="motion", against=against.name, channel=fitting[0].name, drift_allowance=drift_allowance
            )
    for one, other in ((one, other) for one in own for other in of_reference):
        alike = one.quantity == other.quantity
        if alike and (align.against is not None or (one.role in ROLES and one.role == other.role)):
            return RedundantAlignment(
                method="redundant", channel=one.name, against=other.name, drift_allowance=drift_allowance
            )
    return None


def _faults_of_locks(where: KeyPath, source: Source, reference: str, file: RigFile) -> list[Fault]:
    """Name the clocks of both sides of absolute time that are locked to nothing, or that nothing can tell of."""
    faults = []
    for at, one in file.sources.legible:
        if one.name not in (source.name, reference):
            continue
        if one.time is not None and one.time.by == "free":
            problem = f"the clock of {one.name!r} runs free: absolute time says nothing of it; name another way"
            faults.append(Fault((*where, "method"), problem, FaultCode.CONTRADICTION))
        elif one.time is None and one.kind != "dewetron":
            problem = "is missing: absolute time needs what its clock is locked to"
            problem += ', such as `time = { by = "ptp" }`; no file of it says so itself'
            faults.append(Fault((*at, "time"), problem, FaultCode.MISSING))
    return faults


def faults_of_alignment(where: KeyPath, source: Source, reference: str, file: RigFile) -> list[Fault]:
    """Check a source's alignment.

    Parameters
    ----------
    where
        Key of the alignment.
    source
        Source that is aligned, not that of the reference clock.
    reference
        Name of the reference clock.
    file
        Rig file; a faulty channel is not judged twice: what it might have been is unknown.
    """
    align, faults = source.align, []
    clocks, names = file.sources.names, file.channels.names
    # of a quantity, or a source, that is none it is unknown what might be compared
    channels = [one for _, one in file.channels.legible if one.quantity in SI_UNITS and one.source in clocks]
    by_name = {channel.name: channel for channel in channels}
    complete = 0 < len(channels) == len(file.channels.rows)

    def unfit(problem: str, *key: str) -> Fault:
        return Fault((*where, *key), problem, FaultCode.CONTRADICTION)

    def check(key: str, name: str | None, clock: str, whose: str) -> ChannelSpec | None:
        if name is None:
            return None
        if name not in names:
            problem = f"{name!r} is no channel; {did_you_mean(name, names)}"
            faults.append(Fault((*where, key), problem, FaultCode.UNKNOWN, undeclared=name))
        elif name in by_name and by_name[name].source in {*clocks} - {clock}:
            faults.append(unfit(f"{name!r} must be a channel of {whose}", key))
        return by_name.get(name)

    of_reference = f"the reference clock {reference!r}"
    against = own = None
    if isinstance(align, MotionAlignment | RedundantAlignment | ExposureAlignment | AbsoluteAlignment):
        against = check("against", align.against, reference, of_reference)
    if isinstance(align, MotionAlignment | RedundantAlignment | TriggerAlignment | AbsoluteAlignment):
        own = check("channel", align.channel, source.name, "this source")
    if isinstance(align, ExposureAlignment):
        pulses = check("channel", align.channel, reference, of_reference)
        if pulses and pulses.source == reference and pulses.quantity not in ("voltage", "count"):
            faults.append(unfit(f"{pulses.name!r} must be a voltage, found {pulses.quantity}", "channel"))
        if against and against.quantity != "acceleration" and against.role not in DRIVEN:
            faults.append(unfit(f"{against.name!r} must be an acceleration, found {against.quantity}", "against"))
    if isinstance(align, RedundantAlignment) and own and against:
        if own.quantity != against.quantity:
            faults.append(unfit(f"a channel of {own.quantity} does not repeat one of {against.quantity}"))
        faults += _faults_of_bodies(where, own, against)
    if isinstance(align, MotionAlignment) and against:
        faults += _faults_of_motion(where, source, align, own, against, channels if complete else None)
    if isinstance(align, AbsoluteAlignment):
        faults += _faults_of_locks(where, source, reference, file)
        other = second_way(source, reference, channels) if complete else None
        if other is None and complete and not faults and (align.against is not None or align.channel is not None):
            what = ", ".join(repr(name) for name in (align.channel, align.against) if name is not None)
            faults.append(unfit(f"no other channel is there that {what} may be compared with"))
        elif isinstance(other, MotionAlignment) and own and against:
            faults += _faults_of_motion(where, source, other, own, against, channels)
    triggered = any(c.source == reference and c.role == "trigger" for c in channels)
    if isinstance(align, TriggerAlignment) and complete and not triggered:
        problem = f"no channel of the reference clock {reference!r} has the role `trigger`"
        faults.append(Fault(where, problem, FaultCode.MISSING))
    return faults


def _faults_of_motion(
    where: KeyPath,
    source: Source,
    align: MotionAlignment,
    own: ChannelSpec | None,
    against: ChannelSpec,
    channels: Sequence[ChannelSpec] | None,
) -> list[Fault]:
    """Check that a source has one channel whose motion the reference clock has in another quantity."""
    if own is not None and own.quantity == against.quantity:
        problem = f"{own.name!r} repeats {against.name!r}: the method for one and the same quantity is `redundant`"
        return [Fault((*where, "method"), problem, FaultCode.CONTRADICTION)]
    if against.role in DRIVEN:
        return _faults_of_force(where, source, own, DRIVEN[against.role], channels)
    comparable = [quantity for quantity, others in MOTIONS.items() if against.quantity in others]
    if not comparable or (source.kind == "camera" and against.quantity != "acceleration"):
        problem = f"{against.name!r} must be an acceleration, found {against.quantity}"
        if source.kind != "camera":
            problem = f"{against.name!r} must be of a motion, found {against.quantity}"
        return [Fault((*where, "against"), problem, FaultCode.CONTRADICTION)]
    if own is not None:
        if own.quantity not in comparable:
            problem = f"a channel of {own.quantity} is not the motion of one of {against.quantity}"
            problem += f"; compared are {' and '.join(comparable)}"
            return [Fault(where, problem, FaultCode.CONTRADICTION)]
        return _faults_of_bodies(where, own, against)
    if align.channel is not None or channels is None:
        return []
    found = motion_channels(source.name, None, against.name, channels)
    if not found:
        kinds = ["displacement"] if source.kind == "camera" else comparable
        problem = f"motion needs a {' or '.join(kinds)} channel of this source"
        return [Fault(where, problem, FaultCode.MISSING)]
    if len(found) > 1 and found[0].quantity != "displacement":
        problem = f"is needed: {', '.join(c.name for c in found)} may all be meant"
        return [Fault((*where, "channel"), problem, FaultCode.AMBIGUOUS)]
    return _faults_of_bodies(where, found[0], against)


def _faults_of_force(
    where: KeyPath,
    source: Source,
    own: ChannelSpec | None,
    roles: Sequence[str],
    channels: Sequence[ChannelSpec] | None,
) -> list[Fault]:
    """Check that a source has a motion that the forces drive."""
    any_of = f"role {' or '.join(roles)}"
    if own is not None:
        problem = f"{own.name!r} must have the {any_of}"
        return [] if own.role in roles else [Fault((*where, "channel"), problem, FaultCode.CONTRADICTION)]
    if channels is not None and not any(c.source == source.name and c.role in roles for c in channels):
        problem = f"motion against the forces needs a channel of {any_of} of this source"
        return [Fault(where, problem, FaultCode.MISSING)]
    return []


def _faults_of_bodies(where: KeyPath, own: ChannelSpec, against: ChannelSpec) -> list[Fault]:
    """Refuse to compare channels whose roles are of two bodies."""
    bodies = [channel.role.partition("_")[0] for channel in (own, against)]
    if all(bodies) and bodies[0] != bodies[1]:
        problem = f"{own.name!r} is of the {bodies[0]} part, {against.name!r} of the {bodies[1]} part"
        return [Fault(where, problem, FaultCode.CONTRADICTION)]
    return []
