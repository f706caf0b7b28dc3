"""Checks of a rig file's tables against each other: names, clocks, roles, quantities and units."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

from recoil_acquisition.declaration import declared, unknown_key
from recoil_acquisition.devices.can_device import delivers_several_buses
from recoil_acquisition.errors import Fault, FaultCode, FramingError, KeyPath, did_you_mean, nearest_first
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.live_kind import live_kind_of
from recoil_acquisition.quantity import SI_UNITS, UNITS, find_unit, normalise_unit
from recoil_acquisition.readers.can.buses import bus_number
from recoil_acquisition.readers.text.layout import TextLayout
from recoil_acquisition.readers.tracks.layout import TrackLayout
from recoil_acquisition.trigger.table import trigger_faults
from recoil_rigs.checks.rig_alignments import faults_of_alignment
from recoil_rigs.mechanism.mechanism_parameters import MEANINGS, MECHANISM, MechanismModel, stated_values
from recoil_rigs.mechanism.mechanisms import MECHANISMS
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.tables.rig_tables import (
    CARRIED_ROLES,
    FORCE_SENSOR_ROLES,
    GAUGE_ROLES,
    LINE_ROLES,
    ROLES,
    ChannelSpec,
    Source,
    names_in,
    quantities_in,
)
from recoil_rigs.tables.sensitivity import amplifier_missing, output_from_text

_OF_EXIT = ("projectile_mass", "bore_length")

MISSPELT = 0.8
"""Likeness of a key to a symbol from which on the symbol was meant, whatever other symbols mean."""


def checked_mechanism(table: Any, faults: list[Fault], roles: Collection[str]) -> Mechanism | None:
    """Validate ``[mechanism]``: every value a finite number, every required one there, none that its model lacks.

    Faults are appended; None if there is any.

    Parameters
    ----------
    roles
        Roles of the rig's channels, by which a line has areas.
    """
    if not isinstance(table, dict):
        faults.append(Fault((MECHANISM,), "a table [mechanism] is needed", FaultCode.MISSING))
        return None
    model = model_of(table)
    symbols = Mechanism.symbols()
    known = {MODEL, *symbols, *(f"u_{s}" for s in Mechanism.uncertain())}
    own = [_unknown_symbol(key, symbols) for key in table if key not in known]
    written, table = table, stated_values(table, own)
    for key in (key for key in table if key in known - {MODEL}):
        problem = problem_of_value(key, table[key], key not in symbols)
        if problem is not None:
            own.append(Fault((MECHANISM, key), *problem))
    own += _faults_of_model(written, model, roles)
    own += _muzzle_brake_without_exit(table)
    if own or model is None:
        faults += own
        return None
    having = MECHANISMS[model].symbols_of(roles)
    usual_u = {symbol: u for symbol, u in Mechanism.USUAL_U.items() if symbol in having}
    none = {symbol: 0.0 for symbol in Mechanism.USUAL_U if symbol not in having}
    values = {key: float(value) for key, value in table.items() if key in having}
    u = {key.removeprefix("u_"): float(value) for key, value in table.items() if key not in (MODEL, *having)}
    usual = {symbol: usual for symbol, usual in usual_u.items() if symbol not in values and symbol not in u}
    unstated = {symbol for symbol in (*usual_u, "unread_force") if symbol not in values}
    unstated |= {f"u_{symbol}" for symbol in usual_u if symbol not in u}
    stated = MappingProxyType(usual | u)
    return MECHANISMS[model](**none, **values, u=stated, unstated=frozenset(unstated))


MODEL = "model"
"""Key of ``[mechanism]`` that says which model its values are of."""


def model_of(table: Any) -> MechanismModel | None:
    """Return the model that a table ``[mechanism]`` names, a gun if it names none; None if it names no model."""
    stated = table.get(MODEL, MechanismModel.GUN) if isinstance(table, dict) else None
    return MechanismModel(stated) if isinstance(stated, str) and stated in tuple(MechanismModel) else None


def _faults_of_model(table: Mapping[str, Any], model: MechanismModel | None, roles: Collection[str]) -> Iterator[Fault]:
    """Name a model that is none, the values that the model lacks, and those that it must have."""
    if model is None:
        models = " or ".join(f'"{one}"' for one in MechanismModel)
        yield Fault((MECHANISM, MODEL), f"must be {models}, found {table[MODEL]!r}", FaultCode.VALUE)
        return
    having = MECHANISMS[model].symbols_of(roles)
    for key in table:
        symbol = key.removeprefix("u_")
        if symbol in having or symbol not in Mechanism.symbols():
            continue
        problem = f"a body on a line has no {symbol}, {MEANINGS[symbol]}: leave it out"
        if symbol in Mechanism.OF_PRESSURE:
            problem = f"has no meaning without a channel of role {Mechanism.OF_PRESSURE[symbol]!r}: leave it out"
        yield Fault((MECHANISM, key), problem, FaultCode.CONTRADICTION)
    for symbol in MECHANISMS[model].required(roles):
        if symbol not in table:
            yield Fault((MECHANISM, symbol), f"is missing: {MEANINGS[symbol]}", FaultCode.MISSING)


def _muzzle_brake_without_exit(table: Mapping[str, Any]) -> list[Fault]:
    """Ask for what says when the projectile leaves, where a muzzle brake is declared."""
    declared_keys = [key for key in ("muzzle_brake", "u_muzzle_brake") if table.get(key)]
    return [
        Fault((MECHANISM, key), f"is missing: {MEANINGS[key]}", FaultCode.MISSING)
        for key in _OF_EXIT
        if declared_keys and not table.get(key)
    ]


def _unknown_symbol(key: str, symbols: Sequence[str]) -> Fault:
    """Name a key that is no symbol, with the one that it misspells, or those whose meaning has most of its words.

    Of several that have as many, those count in whose meanings a word stands at the front.
    """
    place, symbol = (MECHANISM, key), key.removeprefix("u_")
    if symbol in symbols:
        problem = f"unknown key; {symbol} is itself a standard uncertainty: {MEANINGS[symbol]}"
        return Fault(place, problem, FaultCode.UNKNOWN)
    prefix = key[: len(key) - len(symbol)]
    words = set(symbol.casefold().split("_"))
    places = {}
    for one in symbols:
        meaning = re.findall(r"\w+", MEANINGS[one].casefold())
        if shared := words.intersection(meaning):
            places[one] = (-len(shared), min(map(meaning.index, shared)))
    misspelt = len(symbol) > 2 and get_close_matches(symbol.casefold(), map(str.casefold, symbols), 1, MISSPELT)
    if places and len(symbol) > 1 and not misspelt:
        most, front = min(places.values())
        meant = [one for one, (shared, at) in places.items() if shared == most and at <= front + 1]
        named = ", ".join(f"{prefix}{one} ({MEANINGS[one]})" for one in meant)
        return Fault(place, f"unknown key; did you mean {named}", FaultCode.UNKNOWN)
    return unknown_key(place, key, [prefix + one for one in symbols])


def problem_of_value(key: str, value: Any, is_uncertainty: bool) -> tuple[str, FaultCode] | None:
    """Return what is wrong with a value of ``[mechanism]`` and the code of that; None if nothing is."""
    try:
        number = math.nan if isinstance(value, bool | str) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        return f"must be a finite number, found {value!r}", _code_of_number(value)
    if is_uncertainty:
        negative = f"a standard uncertainty is not negative, found {value}"
        return (negative, FaultCode.RANGE) if number < 0 else None
    if key in ("bore_friction", "muzzle_brake", "unread_force") and not 0 <= number < 1:
        return f"must be a share of at least 0 and below 1, found {value}", FaultCode.RANGE
    if key == "unread_share" and not -1 < number < 1:
        return f"must be a share between -1 and 1, found {value}", FaultCode.RANGE
    if key in ("slide_friction", "carried_mass", *_OF_EXIT, "tube_axial_hz") and number < 0:
        return f"must not be negative, found {value}", FaultCode.RANGE
    if key in Mechanism.POSITIVE and number <= 0:
        return f"must be positive, found {value}", FaultCode.RANGE
    return None


def _code_of_number(value: Any) -> FaultCode:
    return FaultCode.RANGE if isinstance(value, int | float) and not isinstance(value, bool) else FaultCode.TYPE


def faults_of_sources(
    sources: Sequence[tuple[KeyPath, Source]],
    channels: Sequence[tuple[KeyPath, ChannelSpec]],
    tables: Mapping[str, Any],
) -> list[Fault]:
    """Check names, the reference clock and the alignments of the sound sources, given with their keys."""
    faults = []
    names = names_in(tables, "source")
    reference = tables.get("reference_clock")
    known_reference = reference if isinstance(reference, str) and reference in names else None
    if isinstance(reference, str) and reference and known_reference is None:
        problem = f"{reference!r} is no source; {did_you_mean(reference, names)}"
        faults.append(Fault(("reference_clock",), problem, FaultCode.UNKNOWN))
    for where, source in sources:
        if names.count(source.name) > 1:
            faults.append(Fault((*where, "name"), "two sources have this name", FaultCode.DUPLICATE))
        faults += _faults_of_bus(where, source)
        faults += _faults_of_framing(where, source)
        faults += _faults_of_layout(where, source)
        if known_reference is None:
            continue  # which of the sources needs no alignment is not known then
        if source.name == known_reference:
            if source.align is not None:
                problem = "the reference clock is not aligned to anything; leave it out"
                faults.append(Fault((*where, "align"), problem, FaultCode.CONTRADICTION))
        elif source.align is None:
            remedy = 'declare `align = { method = "motion" | "redundant" | "trigger" | "exposure" | "fixed", ... }`'
            faults.append(Fault((*where, "align"), f"is missing; {remedy}", FaultCode.MISSING))
        else:
            specs = [c for _, c in channels]
            faults += faults_of_alignment((*where, "align"), source, known_reference, specs, tables)
    return faults


def _faults_of_bus(where: KeyPath, source: Source) -> list[Fault]:
    """Ask which bus a source is whose device delivers several."""
    if not delivers_several_buses(source.device):
        return []
    if source.bus is None:
        problem = "is missing: the device delivers several buses; say which one this source is"
        return [Fault((*where, "bus"), problem, FaultCode.MISSING)]
    if bus_number(source.bus) is None:
        problem = f"{source.bus!r} ends in no number, by which buses are told apart live"
        return [Fault((*where, "bus"), problem, FaultCode.VALUE)]
    return []


def _faults_of_framing(where: KeyPath, source: Source) -> list[Fault]:
    """Check the framing of a serial source as its reader will."""
    if source.framing is None:
        return []
    try:
        framing_from_table(source.framing)
    except FramingError as error:
        return [fault.below(where) for fault in error.faults]
    return []


def _faults_of_layout(where: KeyPath, source: Source) -> list[Fault]:
    """Check the layout of a recorder's or a camera's text tables as its reader will."""
    if source.layout is None:
        return []
    faults: list[Fault] = []
    if source.kind == "camera":
        declared(TrackLayout, source.layout, (*where, "layout"), faults)
    else:
        declared(TextLayout, source.layout, (*where, "layout"), faults)
    return faults


def faults_of_trigger(
    tables: Mapping[str, Any],
    channels: Sequence[tuple[KeyPath, ChannelSpec]],
    sources: Sequence[tuple[KeyPath, Source]],
) -> list[Fault]:
    """Check the table ``[trigger]``: its own keys, and that its channels can be watched.

    On a rig with devices it is for shots that are acquired live, and its channels must come from a bus or a port.
    Without devices it decides where in a long recording the shot is.
    """
    table = tables.get("trigger")
    if table is None:
        return []
    if not isinstance(table, dict):
        return [Fault(("trigger",), "must be a table", FaultCode.TYPE)]
    faults = list(trigger_faults(table, quantities_in(tables)))
    if faults:
        return faults
    kinds = {source.name: source.kind for _, source in sources}
    of_files = {source.name for _, source in sources if live_kind_of(source.kind, source.device) is None}
    live = any(source.device is not None for _, source in sources)
    source_of = {channel.name: channel.source for _, channel in channels}
    for key in (key for key in ("any", "all") if key in table):
        for i, row in enumerate(table[key]):
            kind = kinds.get(source_of.get(row["channel"], ""))
            where = ("trigger", key, i, "channel")
            if live and kind is not None and source_of[row["channel"]] in of_files:
                problem = f"{row['channel']!r} is of a {kind} source, which cannot be read live"
                problem += "; take a channel of a bus or port"
                faults.append(Fault(where, problem, FaultCode.CONTRADICTION, row["channel"]))
            elif kind == "camera":
                problem = f"{row['channel']!r} is of a camera, whose camera track is one shot's already"
                problem += "; take a channel of a recorder, a bus or a port"
                faults.append(Fault(where, problem, FaultCode.CONTRADICTION, row["channel"]))
    return faults


def faults_of_channels(
    channels: Sequence[tuple[KeyPath, ChannelSpec]],
    sources: Sequence[tuple[KeyPath, Source]],
    tables: Mapping[str, Any],
) -> list[Fault]:
    """Check names, sources, roles, quantities and units of the legible channels, given with their keys."""
    faults = []
    names = [c.name for _, c in channels]
    source_names = names_in(tables, "source")
    sound_sources = {s.name: s for _, s in sources}
    model = model_of(tables.get(MECHANISM))
    for where, channel in channels:
        if names.count(channel.name) > 1:
            faults.append(Fault((*where, "name"), "two channels have this name", FaultCode.DUPLICATE))
        if channel.source not in source_names:
            what = f"role {channel.role!r} has no source" if channel.role else "no such source"
            problem = f"{what}: {channel.source!r} is not declared; {did_you_mean(channel.source, source_names)}"
            faults.append(Fault((*where, "source"), problem, FaultCode.UNKNOWN))
        faults += _faults_of_role(where, channel, [c for _, c in channels], model)
        faults += _faults_of_standard(where, channel, [c for _, c in channels])
        faults += _faults_of_unit(where, channel, sound_sources.get(channel.source))
        faults += _faults_of_chain(where, channel)
        faults += _faults_of_gauge(where, channel)
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
    where: KeyPath, channel: ChannelSpec, channels: Sequence[ChannelSpec], model: MechanismModel | None
) -> list[Fault]:
    faults = []
    if not channel.role:
        return []
    if channel.role not in ROLES:
        nearest = nearest_first(channel.role, list(ROLES))[0]
        problem = f"unknown role {channel.role!r}; did you mean `{nearest}`?"
        return [Fault((*where, "role"), problem, FaultCode.UNKNOWN)]
    others = [c.name for c in channels if c.role == channel.role and c is not channel]
    if model is MechanismModel.GUN and channel.role in LINE_ROLES:
        problem = f'role {channel.role!r} is one of a body on a line: write `model = "line"` in [mechanism]'
        faults.append(Fault((*where, "role"), problem, FaultCode.CONTRADICTION))
    if model is MechanismModel.LINE and channel.role in CARRIED_ROLES:
        problem = f"a body on a line has no role {channel.role!r}: leave it out, the channel is recorded all the same"
        faults.append(Fault((*where, "role"), problem, FaultCode.CONTRADICTION))
    several = GAUGE_ROLES if model is MechanismModel.GUN else FORCE_SENSOR_ROLES
    if others and channel.role not in several:
        kinds = "pressures may have several gauges" if several is GAUGE_ROLES else "forces may have several channels"
        problem = f"{channel.role!r} is also the role of {', '.join(others)}; only {kinds}: {', '.join(several)}"
        faults.append(Fault((*where, "role"), problem, FaultCode.DUPLICATE))
    if channel.quantity in SI_UNITS and channel.quantity != ROLES[channel.role]:
        problem = f"role {channel.role!r} needs quantity {ROLES[channel.role]!r}, found {channel.quantity!r}"
        faults.append(Fault((*where, "quantity"), problem, FaultCode.CONTRADICTION))
    return faults


def _faults_of_standard(where: KeyPath, channel: ChannelSpec, channels: Sequence[ChannelSpec]) -> list[Fault]:
    """Name another sensor that says something else of the same standard."""
    sensor = channel.sensor
    stated = {c.name: c.sensor.u_reference_rel for c in channels if sensor.reference == c.sensor.reference != ""}
    others = [f"{name} {u:g}" for name, u in stated.items() if u != sensor.u_reference_rel]
    if not others:
        return []
    problem = f"{sensor.u_reference_rel:g} of {sensor.reference!r}, of which {', '.join(others)} is stated; state one"
    return [Fault((*where, "sensor", "u_reference_rel"), problem, FaultCode.CONTRADICTION)]


def _faults_of_unit(where: KeyPath, channel: ChannelSpec, source: Source | None) -> list[Fault]:
    if channel.quantity not in SI_UNITS:
        nearest = nearest_first(channel.quantity, list(SI_UNITS))[0]
        problem = f"unknown quantity {channel.quantity!r}; did you mean `{nearest}`?"
        return [Fault((*where, "quantity"), problem, FaultCode.UNKNOWN)]
    if channel.unit is None:
        return []
    at_unit = (*where, "unit")
    if channel.unit == "px":
        if channel.quantity != "displacement":
            return [Fault(at_unit, f"'px' is no unit of {channel.quantity}", FaultCode.UNIT)]
        if source is not None and source.scale_mm_per_px is None:
            problem = f"'px' needs `scale_mm_per_px` of the camera source {source.name!r}"
            return [Fault(at_unit, problem, FaultCode.UNIT)]
        return []
    unit = find_unit(channel.unit)
    if unit is None:
        nearest = ", ".join(nearest_first(normalise_unit(channel.unit), sorted(UNITS))[:3])
        return [Fault(at_unit, f"unknown unit {channel.unit!r}; nearest known: {nearest}", FaultCode.UNIT)]
    sensitivity = channel.sensitivity
    if channel.quantity in unit.quantities or (sensitivity is not None and sensitivity.turned_into(unit)):
        return []
    fitting = ", ".join(u for u, v in UNITS.items() if channel.quantity in v.quantities)
    chain = "; volts need `sensitivity` in `sensor`" if "voltage" in unit.quantities else ""
    problem = f"{channel.unit!r} is no unit of {channel.quantity}; one of {fitting}{chain}"
    return [Fault(at_unit, problem, FaultCode.UNIT)]


def _faults_of_gauge(where: KeyPath, channel: ChannelSpec) -> list[Fault]:
    """Name what only a pressure's gauge has, and what only the breech's."""
    sensor, roles = channel.sensor, {"u_linearity_rel": GAUGE_ROLES, "gauge_ahead": GAUGE_ROLES[:1]}
    return [
        Fault(
            (*where, "sensor", key),
            f"is of a channel with the role {' or '.join(of)} alone; leave it out",
            FaultCode.CONTRADICTION,
        )
        for key, of in roles.items()
        if getattr(sensor, key) is not None and channel.role not in of
    ]


def _faults_of_chain(where: KeyPath, channel: ChannelSpec) -> list[Fault]:
    """Check that a sensitivity is one of what the channel measures, and that the way to volts is known."""
    sensor = channel.sensor
    sensitivity = channel.sensitivity if channel.quantity in SI_UNITS else None
    if sensitivity is None:
        return []
    faults = []
    at_amplifier = (*where, "sensor", "amplifier")
    if channel.quantity not in sensitivity.per.quantities:
        problem = f"{sensor.sensitivity!r} is per {sensitivity.per_name}, which is no unit of {channel.quantity}"
        if sensitivity.per_name == "V":
            remedy = 'of a bridge write its output over its load, such as "0.02 mV/V/kN"'
        else:
            remedy = f"one of {', '.join(u for u, v in UNITS.items() if channel.quantity in v.quantities)}"
        faults.append(Fault((*where, "sensor", "sensitivity"), f"{problem}; {remedy}", FaultCode.UNIT))
    recorded = find_unit(channel.unit) if channel.unit is not None else None
    in_output = recorded is not None and bool(recorded.quantities & sensitivity.output.quantities)
    in_words, stated = isinstance(sensor.sensitivity, str), "amplifier" in sensor.model_fields_set
    if in_words and sensitivity.needs_amplifier and not stated and not in_output:
        faults.append(Fault(at_amplifier, amplifier_missing(sensitivity), FaultCode.MISSING))
    if sensor.zero is not None and not sensitivity.turned_into(output_from_text(sensor.zero)[1]):
        problem = f"{sensor.zero!r} is nothing that a chain of {sensitivity.output_name} gives out"
        faults.append(Fault((*where, "sensor", "zero"), problem, FaultCode.UNIT))
    if not 1e-60 < sensitivity.value * sensor.amplifier < 1e60:
        faults.append(Fault(at_amplifier, f"{sensor.amplifier:g} is no gain that a chain has", FaultCode.RANGE))
    return faults
