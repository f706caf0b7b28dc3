"""The sources of a rig that are read live, with their channels' way to SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, cast

from recoil_acquisition.capture.live_source import LiveChannel, LiveSource
from recoil_acquisition.devices.can_device import delivers_several_buses
from recoil_acquisition.devices.device import Device, TellingDevice
from recoil_acquisition.errors import DeviceError, Fault, FaultCode, RigError, Row, nearest_first
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.live_kind import live_kind_of
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_acquisition.readers.can.messages import load_database
from recoil_acquisition.readers.recording import SignalHeader
from recoil_acquisition.streams.tick_stream import TickChannel
from recoil_rigs.rig import ChannelSpec, Rig, Source
from recoil_rigs.shots.assemble import shown_unit, si_line, unit_of
from recoil_rigs.shots.can_signals import faults_of_can_signals
from recoil_rigs.shots.found_channels import contradictions
from recoil_rigs.tables.channel_table import range_si


def live_sources(
    rig: Rig,
    devices: Mapping[str, Mapping[str, Any]] | None = None,
    told: Mapping[str, Mapping[str, str]] | None = None,
    found: Mapping[str, Sequence[TickChannel]] = MappingProxyType({}),
) -> tuple[LiveSource, ...]:
    """Return the sources of a rig that have a ``device``, in its order.

    Parameters
    ----------
    devices
        ``device`` tables in place of the rig's own, by source: those of virtual devices.
    told
        Units of signals by source and signal, of those whose devices tell them: see `told_by`. Before they are open
        the channels of these sources stand in the units that the rig states, or in SI.
    found
        Channels as devices describe them, by source: see `found_by`.

    Raises
    ------
    DeviceError
        If no source has a device.
    RigError
        If units, ranges or filters contradict, or a CAN database or a device lacks a signal, with every case.
    ReadError
        If a CAN database is at fault.
    """
    tables = {s.name: (devices or {}).get(s.name, s.device) for s in rig.sources}
    faults: list[Fault] = []
    sources = [
        _live_source(rig, s, table, (told or {}).get(s.name), faults)
        for s in rig.sources
        if (table := tables[s.name]) is not None
    ]
    for source in (s for s in rig.sources if s.name in found):
        by_name = {one.name: one for one in found[source.name]}
        for spec in (one for one in rig.channels_of(source.name) if one.signal in by_name):
            faults += contradictions(source, spec, by_name[spec.signal])
    if faults:
        raise RigError(rig.path, faults)
    if not sources:
        raise DeviceError(
            f"rig {rig.name!r} has no source that can be read live",
            path=rig.path,
            remedy='declare such as `device = { port = "/dev/ttyUSB0", baudrate = 921600 }` of a can or serial source',
        )
    return tuple(sources)


def told_by(sources: Sequence[LiveSource], devices: Mapping[str, Device]) -> dict[str, Mapping[str, str]]:
    """Return the units that open devices tell of their signals, by source; of those that tell none nothing."""
    telling = [s.name for s in sources if s.live_kind.tells_signals and s.name in devices]
    return {name: cast("TellingDevice", devices[name]).units for name in telling}


def found_by(sources: Sequence[LiveSource], devices: Mapping[str, Device]) -> dict[str, Sequence[TickChannel]]:
    """Return what open devices say of their channels beside the units, by source; of those that say nothing none."""
    telling = [s.name for s in sources if s.live_kind.tells_signals and s.name in devices]
    return {name: found for name in telling if (found := getattr(devices[name], "channels", ()))}


def _live_source(
    rig: Rig, source: Source, table: Mapping[str, Any], told: Mapping[str, str] | None, faults: list[Fault]
) -> LiveSource:
    database = None if source.database is None else rig.databases[source.database]
    framing = None if source.framing is None else framing_from_table(source.framing)
    units: dict[str, str] = {}
    if database is not None:
        units = {name: those[0].unit for name, those in load_database(database, rig.path).signals.items()}
    if framing is not None:
        units = {field.name: field.unit for frame_type in framing.types for field in frame_type.fields}
    faults += faults_of_can_signals(rig, source)
    kind, specs = live_kind_of(source.kind, table), rig.channels_of(source.name)
    if kind is not None and kind.tells_signals:
        units = {spec.signal: spec.unit or SI_UNITS[spec.quantity] for spec in specs} if told is None else dict(told)
        missing = [spec for spec in specs if spec.signal not in units]
        for spec in missing:
            near = ", ".join(nearest_first(spec.signal, list(units))[:8])
            problem = f"the device has no {spec.signal!r}; nearest: {near or 'none at all'}"
            faults.append(Fault((Row("channel", spec.name), "signal"), problem, FaultCode.UNKNOWN, spec.signal))
        specs = tuple(spec for spec in specs if spec not in missing)
    channels = [_live_channel(rig, source, spec, units, faults) for spec in specs]
    return LiveSource(
        name=source.name,
        kind=source.kind,
        device=table,
        channels=tuple(channel for channel in channels if channel is not None),
        framing=framing,
        database=database,
        counters=source.counters or (),
        bus=source.bus if delivers_several_buses(table) else None,
        path=rig.path,
    )


def _live_channel(
    rig: Rig, source: Source, spec: ChannelSpec, units: Mapping[str, str], faults: list[Fault]
) -> LiveChannel | None:
    header = SignalHeader(spec.signal, units.get(spec.signal, ""), 0)
    unit = unit_of(spec, header, source, rig.path, faults)
    if unit is None:
        return None
    factor, offset = si_line(spec, unit)
    shown_in, shown = shown_unit(spec, header.unit, unit, rig.read_in)
    return LiveChannel(
        name=spec.name,
        signal=spec.signal,
        factor=factor,
        offset=offset,
        unit=SI_UNITS[spec.quantity],
        range=range_si(spec),
        shown_in=shown_in,
        shown_unit=shown,
    )
