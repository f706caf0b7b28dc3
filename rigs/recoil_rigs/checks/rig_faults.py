"""Checks of a rig file's tables against each other: names, clocks, roles, quantities and units."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from recoil_acquisition.errors import Fault, FaultCode, KeyPath, did_you_mean
from recoil_acquisition.live_kind import live_kind_of
from recoil_rigs.checks.rig_alignments import faults_of_alignment
from recoil_rigs.mechanism.mechanism_parameters import Mechanism
from recoil_rigs.rig_file import RigFile
from recoil_rigs.tables.channel_table import ChannelSpec
from recoil_rigs.tables.knowledge import faults_of_knowledge
from recoil_rigs.tables.rig_tables import FORCE_SENSOR_ROLES, GAUGE_ROLES, ROLES


def faults_of_tables(file: RigFile) -> list[Fault]:
    """Check the tables of a rig file against each other."""
    channels = [channel for _, channel in file.channels.sound]
    return [
        *_faults_of_sources(file),
        *_faults_of_channels(file),
        *_faults_of_trigger(file),
        *faults_of_knowledge(file.knowledge, channels),
    ]


def _faults_of_sources(file: RigFile) -> list[Fault]:
    """Check names, the reference clock and the alignments of the sound sources."""
    faults = []
    names = file.sources.names
    reference = file.texts.get("reference_clock", "")
    if reference and reference not in names:
        problem = f"{reference!r} is no source; {did_you_mean(reference, names)}"
        faults.append(Fault(("reference_clock",), problem, FaultCode.UNKNOWN, undeclared=reference))
    for where, source in file.sources.sound:
        if names.count(source.name) > 1:
            faults.append(Fault((*where, "name"), "two sources have this name", FaultCode.DUPLICATE))
        if reference not in names:
            continue  # which of the sources needs no alignment is not known then
        if source.name == reference:
            if source.align is not None:
                problem = "the reference clock is not aligned to anything; leave it out"
                faults.append(Fault((*where, "align"), problem, FaultCode.CONTRADICTION))
            if not source.required:
                problem = "the reference clock's source cannot stay away: all other clocks are aligned to it"
                faults.append(Fault((*where, "required"), problem, FaultCode.CONTRADICTION))
        elif source.align is None:
            remedy = (
                'declare `align = { method = "motion" | "redundant" | "trigger" | "exposure" | "absolute" | "fixed", '
                "... }`"
            )
            faults.append(Fault((*where, "align"), f"is missing; {remedy}", FaultCode.MISSING))
        else:
            faults += faults_of_alignment((*where, "align"), source, reference, file)
    return faults


def _faults_of_trigger(file: RigFile) -> Iterator[Fault]:
    """Check that the trigger's channels can be watched.

    On a rig with devices it is for shots that are acquired live, and its channels must come from a bus or a port.
    Without devices it decides where in a long recording the shot is.
    """
    if file.trigger is None:
        return
    sources = {source.name: source for _, source in file.sources.sound}
    live = any(source.device is not None for source in sources.values())
    source_of = {channel.name: sources.get(channel.source) for _, channel in file.channels.sound}
    for i, condition in enumerate(file.trigger.conditions):
        source, name = source_of.get(condition.channel), condition.channel
        if source is None:
            continue
        problem = ""
        if live and live_kind_of(source.kind, source.device) is None:
            problem = f"of a {source.kind} source, which cannot be read live; take a channel of a bus or port"
        elif source.kind == "camera":
            problem = "of a camera, whose camera track is one shot's already"
            problem += "; take a channel of a recorder, a bus or a port"
        if problem:
            where = ("trigger", file.trigger.combination, i, "channel")
            yield Fault(where, f"{name!r} is {problem}", FaultCode.CONTRADICTION, name)


def _faults_of_channels(file: RigFile) -> list[Fault]:
    """Check names, sources, roles, quantities and units of the legible channels."""
    faults = []
    source_names = file.sources.names
    sources = {source.name: source for _, source in file.sources.legible}
    rows = file.channels.legible
    channels = [channel for _, channel in rows]
    names = [channel.name for channel in channels]
    for where, channel in rows:
        if names.count(channel.name) > 1:
            faults.append(Fault((*where, "name"), "two channels have this name", FaultCode.DUPLICATE))
        if channel.source not in source_names:
            what = f"role {channel.role!r} has no source" if channel.role else "no such source"
            problem = f"{what}: {channel.source!r} is not declared; {did_you_mean(channel.source, source_names)}"
            faults.append(Fault((*where, "source"), problem, FaultCode.UNKNOWN, undeclared=channel.source))
        faults += _faults_of_role(where, channel, channels, file.model)
        faults += _faults_of_standard(where, channel, file.channels.sound)
        source = sources.get(channel.source)
        unscaled = source is not None and source.scale_mm_per_px is None
        if channel.unit == "px" and channel.quantity == "displacement" and unscaled:
            problem = f"'px' needs `scale_mm_per_px` of the camera source {channel.source!r}"
            faults.append(Fault((*where, "unit"), problem, FaultCode.UNIT))
    return faults


def unstated_uncertainties(channels: Sequence[tuple[KeyPath, ChannelSpec]]) -> list[Fault]:
    """Name the channels that enter the estimate and do not state how uncertain their scale is."""
    return [
        Fault(
            (*where, "sensor", "u_rel"),
            f"is missing: role {channel.role!r} enters the estimate; state the relative standard uncertainty of its "
            "scale, such as 0.005, and 0 only where it is exact",
            FaultCode.MISSING,
        )
        for where, channel in channels
        if channel.enters_estimate and not channel.sensor.states_u_rel
    ]


def _faults_of_role(
    where: KeyPath, channel: ChannelSpec, channels: Sequence[ChannelSpec], model: type[Mechanism] | None
) -> list[Fault]:
    faults = []
    if channel.role not in ROLES:
        return []
    others = [c.name for c in channels if c.role == channel.role and c is not channel]
    if model is not None and channel.role in model.foreign_roles:
        faults.append(Fault((*where, "role"), model.foreign_roles[channel.role], FaultCode.CONTRADICTION))
    several = FORCE_SENSOR_ROLES if model is None else model.shared_roles
    if others and channel.role not in several:
        kinds = "pressures may have several gauges" if several == GAUGE_ROLES else "forces may have several channels"
        problem = f"{channel.role!r} is also the role of {', '.join(others)}; only {kinds}: {', '.join(several)}"
        faults.append(Fault((*where, "role"), problem, FaultCode.DUPLICATE))
    return faults


def _faults_of_standard(
    where: KeyPath, channel: ChannelSpec, sound: Sequence[tuple[KeyPath, ChannelSpec]]
) -> list[Fault]:
    """Name the sensors that say something else of the same standard, once, of the first that names it."""
    sensor = channel.sensor
    bearing = [(at, c) for at, c in sound if sensor.reference == c.sensor.reference != ""]
    if not bearing or bearing[0][0] != where:
        return []
    stated = {c.name: c.sensor.u_reference_rel for _, c in bearing}
    others = [f"{name} {u:g}" for name, u in stated.items() if u != sensor.u_reference_rel]
    if not others:
        return []
    problem = f"{sensor.u_reference_rel:g} of {sensor.reference!r}, of which {', '.join(others)} is stated; state one"
    return [Fault((*where, "sensor", "u_reference_rel"), problem, FaultCode.CONTRADICTION)]
