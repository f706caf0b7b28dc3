"""A shot with the rig that it was fired on: each channel with its sensor, its source and its clock's alignment.

A recording says when and how much; what measured it, how well and in which direction the rig file says. Both are put
together once, here, so that nothing on a shot's way has to look a sensor up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

from recoil_acquisition.channel import Channel
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_rigs.rig import ChannelSpec, Rig, Source
from recoil_rigs.tables.force_input import ForceInput


@dataclass(frozen=True, eq=False)
class FiredChannel:
    """A recorded channel with what the rig states of it.

    Attributes
    ----------
    recorded
        Samples and their instants on the source's clock.
    spec
        Entry of the rig file: sensor, role, quantity, polarity.
    source
        Source that recorded it, whose name is that of its clock.
    alignment
        Map from its clock to the reference clock; None where the shot has none, the identity on the reference clock.
    """

    recorded: Channel
    spec: ChannelSpec
    source: Source
    alignment: ClockAlignment | None


@dataclass(frozen=True, eq=False)
class FiredShot:
    """One shot and its rig.

    Attributes
    ----------
    shot
        Recorded channels, alignments, verdict.
    rig
        Mechanism, sources and sensors, with the mass that was added for this shot.
    """

    shot: Shot
    rig: Rig

    @cached_property
    def channels(self) -> Mapping[str, FiredChannel]:
        """Recorded channels by name, in the rig's order; what the rig does not name any more is left out."""
        specs = {spec.name: spec for spec in self.rig.channels}
        sources = {source.name: source for source in self.rig.sources}
        return MappingProxyType(
            {
                name: FiredChannel(
                    recorded, specs[name], sources[specs[name].source], self.alignments.get(recorded.time_base.clock)
                )
                for name, recorded in self.shot.channels.items()
                if name in specs
            }
        )

    @cached_property
    def alignments(self) -> Mapping[str, ClockAlignment]:
        """Alignments by clock, the identity of the reference clock among them."""
        reference = self.shot.alignment(self.shot.reference_clock)
        return MappingProxyType({reference.clock: reference} | {one.clock: one for one in self.shot.alignments})

    @cached_property
    def roles(self) -> Mapping[str, tuple[FiredChannel, ...]]:
        """Recorded channels by role: several gauges may measure one pressure; a role without a channel is missing."""
        found: dict[str, tuple[FiredChannel, ...]] = {}
        for one in self.channels.values():
            if one.recorded.role:
                found[one.recorded.role] = (*found.get(one.recorded.role, ()), one)
        return MappingProxyType(found)

    def of_force(self, force: ForceInput) -> tuple[FiredChannel, ...]:
        """Return the recorded channels that measure a force of the rig."""
        names = [spec.name for spec in force.channels]
        return tuple(self.channels[name] for name in self.channels if name in names)

    def of_series(self, name: str) -> tuple[FiredChannel, ...]:
        """Return the recorded channels of a series: of a measured force by its name, else of a role."""
        force = next((one for one in self.rig.forces if one.name == name), None)
        return self.roles.get(name, ()) if force is None else self.of_force(force)

    def channel(self, role: str) -> FiredChannel | None:
        """Return the (first) channel of a role, or None."""
        return next(iter(self.roles.get(role, ())), None)

    def without(self, name: str) -> FiredShot:
        """Leave a channel out, as if the rig never had it."""
        return FiredShot(self.shot.without_channel(name), self.rig.without_channel(name))

    def unrecorded(self, name: str) -> FiredShot:
        """Leave a channel, or all that a source recorded, out of the shot; the rig keeps it, so that it is missed."""
        shot = self.shot.without_channel(name)
        for one in self.shot.channels.values():
            if one.time_base.clock == name:
                shot = shot.without_channel(one.name)
        return replace(self, shot=replace(shot, alignments=tuple(a for a in shot.alignments if a.clock != name)))

    def aligned_by(self, alignment: ClockAlignment) -> FiredShot:
        """Map one clock to the reference clock in another way than the shot states."""
        others = (one for one in self.shot.alignments if one.clock != alignment.clock)
        return replace(self, shot=replace(self.shot, alignments=(*others, alignment)))
