"""The rig file: the stand, its sources, its channels and the mechanism under test.

A rig file is TOML. `load_rig` reads one and reports every fault at once (`daq.errors.RigError`),
each with its key path and what would be right.
"""

from __future__ import annotations

import datetime as dt
import fnmatch
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from daq.errors import Fault, ReadError, RigError, nearest_first
from daq.quantity import SI_UNITS, UNITS, find_unit, normalise_unit
from daq.readers.reader import Declarations
from rigs.mechanism import Mechanism

SCHEMA = "recoil-daq/rig/1"

ROLES = MappingProxyType(
    {
        "recoil_acceleration": "acceleration",
        "carriage_acceleration_x": "acceleration",
        "carriage_acceleration_y": "acceleration",
        "carriage_rate": "angular_rate",
        "tipping_rate": "angular_rate",
        "carriage_angular_acceleration": "angular_acceleration",
        "tipping_angular_acceleration": "angular_acceleration",
        "breech_pressure": "pressure",
        "brake_pressure": "pressure",
        "recuperator_pressure": "pressure",
        "recoil_displacement": "displacement",
        "trigger": "voltage",
    }
)
"""Role -> the quantity that its channel must have."""

SourceKind = Literal["dewetron", "can", "serial", "camera"]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]


class _Table(BaseModel):
    """A table of the rig file: frozen, strict about its keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class MotionAlignment(_Table):
    """Align a camera's track by the motion that an accelerometer measured as well."""

    method: Literal["motion"]
    against: Text
    drift_allowance: NotNegative = 5e-5


class RedundantAlignment(_Table):
    """Align a source by one of its channels that repeats a channel of the reference clock."""

    method: Literal["redundant"]
    channel: Text
    against: Text
    drift_allowance: NotNegative = 5e-5


class TriggerAlignment(_Table):
    """Align a source by the trigger edge that one of its channels recorded."""

    method: Literal["trigger"]
    channel: Text
    drift_allowance: NotNegative = 5e-5


class FixedAlignment(_Table):
    """Take the offset as known: ``t_ref = (1 + drift) * t_source + offset_s``."""

    method: Literal["fixed"]
    offset_s: Finite
    u_offset_s: NotNegative = 0.0
    drift: Finite = 0.0
    u_drift: NotNegative = 0.0


Alignment = Annotated[
    MotionAlignment | RedundantAlignment | TriggerAlignment | FixedAlignment, Field(discriminator="method")
]


class Source(_Table):
    """One recorder, bus, port or camera; its name is also the name of its clock."""

    name: Text
    kind: SourceKind
    match: str | None = None
    database: str | None = None
    framing: dict[str, Any] | None = None
    frame_rate: Positive | None = None
    scale_mm_per_px: Positive | None = None
    device: dict[str, Any] | None = None
    align: Alignment | None = None

    @model_validator(mode="after")
    def _has_what_its_kind_needs(self) -> Source:
        if self.kind == "can" and self.database is None:
            raise ValueError('a can source needs `database = "<file>.dbc"`')
        if self.kind == "serial" and self.framing is None:
            raise ValueError("a serial source needs `framing = { ... }`")
        return self


class Sensor(_Table):
    """One sensor, its calibration and its chain. Positions in metres, in its body's axes."""

    model: str = ""
    serial: str = ""
    calibrated: dt.date | None = None
    due: dt.date | None = None
    u_rel: NotNegative = 0.0
    range: tuple[Finite, Finite] | None = None
    sensitivity: Positive | None = None
    sensitivity_unit: Literal["pC", "mV", "V"] | None = None
    amplifier: Positive = 1.0
    time_constant_s: Positive | None = None
    filter_hz: Positive | None = None
    delay_s: NotNegative = 0.0
    position: tuple[Finite, Finite] = (0.0, 0.0)

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Sensor:
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError("`range` must be [lowest, highest]")
        if (self.sensitivity is None) != (self.sensitivity_unit is None):
            raise ValueError("`sensitivity` and `sensitivity_unit` go together")
        if self.calibrated is not None and self.due is not None and self.due < self.calibrated:
            raise ValueError("`due` lies before `calibrated`")
        return self


class ChannelSpec(_Table):
    """One channel: which signal of which source it is, what it measures and with which sensor."""

    name: Text
    source: Text
    signal: Text
    quantity: Text
    unit: str | None = None
    role: str = ""
    polarity: Literal[1, -1] = 1
    sensor: Sensor = Sensor()


@dataclass(frozen=True)
class Rig:
    """A validated rig.

    Attributes
    ----------
    name : str
    reference_clock : str
        Name of the source whose clock all others are aligned to.
    mechanism : Mechanism
    sources : tuple of Source
    channels : tuple of ChannelSpec
    text : str
        The file, verbatim.
    path : Path
    databases : mapping of str to str
        Text of every CAN database that a source names, by the name it uses.
    twin : mapping
        The table ``[twin]`` of a virtual rig, as read; empty if there is none.
    """

    name: str
    reference_clock: str
    mechanism: Mechanism
    sources: tuple[Source, ...]
    channels: tuple[ChannelSpec, ...]
    text: str
    path: Path
    databases: Mapping[str, str] = field(default_factory=dict)
    twin: Mapping[str, Any] = field(default_factory=dict)

    def source(self, name: str) -> Source:
        """Return a source by its name; KeyError if there is none."""
        for source in self.sources:
            if source.name == name:
                return source
        raise KeyError(name)

    def channel(self, name: str) -> ChannelSpec:
        """Return a channel by its name; KeyError if there is none."""
        for channel in self.channels:
            if channel.name == name:
                return channel
        raise KeyError(name)

    def by_role(self, role: str) -> ChannelSpec | None:
        """Return the channel of a role, or None."""
        return next((c for c in self.channels if c.role == role), None)

    def channels_of(self, source: str) -> tuple[ChannelSpec, ...]:
        """Return the channels of one source, in the file's order."""
        return tuple(c for c in self.channels if c.source == source)

    def declarations(self, source: Source) -> Declarations:
        """Return what the rig declares about a source because its files do not carry it."""
        return Declarations(
            clock=source.name,
            database=None if source.database is None else self.databases[source.database],
            framing=source.framing,
            frame_rate_hz=source.frame_rate,
            scale_mm_per_px=source.scale_mm_per_px,
        )

    def matching(self, file_name: str) -> tuple[Source, ...]:
        """Return the sources whose ``match`` pattern fits a file name, without regard to case."""
        folded = file_name.casefold()
        return tuple(s for s in self.sources if s.match and fnmatch.fnmatchcase(folded, s.match.casefold()))

    def overdue(self, on: dt.date) -> tuple[Fault, ...]:
        """Return the calibrations that were past their due date on a day."""
        return tuple(
            Fault(f"channel '{c.name}'.sensor.due", f"calibration was due {c.sensor.due}, {(on - c.sensor.due).days} days ago")
            for c in self.channels
            if c.sensor.due is not None and c.sensor.due < on
        )


def bundled_rigs() -> tuple[str, ...]:
    """Names of the rigs that ship with the package."""
    folder = resources.files("rigs")
    return tuple(sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")))


def find_rig(name_or_path: str) -> Path:
    """Find a rig file by its path or a bundled rig by its name.

    Raises
    ------
    ReadError
        If there is neither, with the names of the bundled rigs.
    """
    path = Path(name_or_path)
    if path.is_file():
        return path
    if name_or_path in bundled_rigs():
        return Path(str(resources.files("rigs") / f"{name_or_path}.toml"))
    problem = "this is a directory" if path.is_dir() else "no such rig file"
    raise ReadError(
        problem, path=path, expected=f"a TOML file or one of the bundled rigs {', '.join(bundled_rigs())}"
    )


def load_rig(name_or_path: str | Path) -> Rig:
    """Read and validate a rig file, or a bundled rig by its name.

    Raises
    ------
    ReadError
        If there is no such file, or it is not readable UTF-8.
    RigError
        With every fault of the file.
    """
    path = find_rig(str(name_or_path))
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ReadError(f"cannot be read: {error.strerror}", path=path) from error
    except UnicodeDecodeError as error:
        raise ReadError("is not UTF-8 text", path=path, place=f"byte {error.start}", expected="a TOML file") from error
    return parse_rig(text, path)


def parse_rig(text: str, path: Path, databases: Mapping[str, str] | None = None) -> Rig:
    """Validate the text of a rig file.

    Parameters
    ----------
    text : str
    path : Path
        Where it came from; the files it names are looked up beside it.
    databases : mapping of str to str, optional
        Text of the CAN databases by name, where they are at hand already (in a shot file).

    Raises
    ------
    RigError
        With every fault of the text.
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise RigError(path, [Fault("TOML", str(error))]) from error
    faults: list[Fault] = []
    faults += _unknown_keys(tables, {"schema", "name", "reference_clock", "mechanism", "source", "channel", "twin"}, "")
    if tables.get("schema") != SCHEMA:
        faults.append(Fault("schema", f"must be {SCHEMA!r}, not {tables.get('schema')!r}"))
    for key in ("name", "reference_clock"):
        if not isinstance(tables.get(key), str) or not tables[key]:
            faults.append(Fault(key, "must be a text"))
    mechanism = _mechanism(tables.get("mechanism"), faults)
    sources = _rows(tables, "source", Source, faults)
    channels = _rows(tables, "channel", ChannelSpec, faults)
    faults += _faults_of_sources(sources, channels, tables)
    faults += _faults_of_channels(channels, tables)
    texts = _databases([s for _, s in sources], path, databases, faults)
    if faults or mechanism is None:
        raise RigError(path, faults)
    return Rig(
        name=str(tables["name"]),
        reference_clock=str(tables["reference_clock"]),
        mechanism=mechanism,
        sources=tuple(s for _, s in sources),
        channels=tuple(c for _, c in channels),
        text=text,
        path=path,
        databases=texts,
        twin=tables.get("twin", {}),
    )


Row = TypeVar("Row", bound=_Table)


def _rows(tables: Mapping[str, Any], key: str, model: type[Row], faults: list[Fault]) -> list[tuple[str, Row]]:
    """Validate an array of tables; return the sound ones with their key paths."""
    rows = tables.get(key, [])
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        faults.append(Fault(key, f"at least one table [[{key}]] is needed"))
        return []
    sound: list[tuple[str, Row]] = []
    for i, row in enumerate(rows):
        where = f"{key}[{i}]" + (f" '{row['name']}'" if isinstance(row.get("name"), str) else "")
        try:
            sound.append((where, model.model_validate(row)))
        except ValidationError as error:
            faults += _faults_of_validation(error, where, model)
    return sound


def _faults_of_validation(error: ValidationError, where: str, model: type[BaseModel]) -> list[Fault]:
    faults = []
    for item in error.errors(include_url=False):
        place = ".".join([where, *(str(part) for part in item["loc"])])
        if item["type"] == "extra_forbidden":
            known = _keys_at(model, item["loc"][:-1])
            faults.append(_unknown_key(place, str(item["loc"][-1]), known))
        elif item["type"] == "missing":
            faults.append(Fault(place, "is missing"))
        else:
            message = item["msg"].removeprefix("Value error, ")
            found = f", found {item['input']!r}" if not isinstance(item["input"], dict | BaseModel) else ""
            faults.append(Fault(place, message[:1].lower() + message[1:] + found))
    return faults


def _keys_at(model: type[BaseModel], path: Sequence[int | str]) -> list[str]:
    """Keys that a nested table may have."""
    nested: dict[str, type[BaseModel]] = {"sensor": Sensor}
    methods: dict[str, type[BaseModel]] = {
        "motion": MotionAlignment, "redundant": RedundantAlignment, "trigger": TriggerAlignment, "fixed": FixedAlignment,
    }  # fmt: skip
    for part in path:
        model = nested.get(str(part)) or methods.get(str(part)) or model
    return list(model.model_fields)


def _unknown_key(place: str, key: str, known: Sequence[str]) -> Fault:
    nearest = nearest_first(key, sorted(known))
    return Fault(place, f"unknown key; did you mean `{nearest[0]}`? (known: {', '.join(sorted(known))})")


def _unknown_keys(table: Mapping[str, Any], known: set[str], prefix: str) -> list[Fault]:
    return [_unknown_key(f"{prefix}{key}", key, sorted(known)) for key in table if key not in known]


def _mechanism(table: Any, faults: list[Fault]) -> Mechanism | None:
    """Validate ``[mechanism]``: every value a finite number, every required one there."""
    if not isinstance(table, dict):
        faults.append(Fault("mechanism", "a table [mechanism] is needed"))
        return None
    symbols = set(Mechanism.symbols())
    known = symbols | {f"u_{s}" for s in symbols}
    before = len(faults)
    faults += _unknown_keys(table, known, "mechanism.")
    for key, value in table.items():
        number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if key in known and not number:
            faults.append(Fault(f"mechanism.{key}", f"must be a finite number, found {value!r}"))
        elif key in known and value < 0 and key.startswith("u_"):
            faults.append(Fault(f"mechanism.{key}", f"a standard uncertainty is not negative, found {value}"))
        elif key in Mechanism.POSITIVE and value <= 0:
            faults.append(Fault(f"mechanism.{key}", f"must be positive, found {value}"))
    faults += [Fault(f"mechanism.{key}", "is missing") for key in Mechanism.REQUIRED if key not in table]
    if len(faults) > before:
        return None
    values = {key: float(value) for key, value in table.items() if key in symbols}
    u = {key.removeprefix("u_"): float(value) for key, value in table.items() if key not in symbols}
    return Mechanism(**values, u=MappingProxyType(u))


def _faults_of_sources(
    sources: Sequence[tuple[str, Source]], channels: Sequence[tuple[str, ChannelSpec]], tables: Mapping[str, Any]
) -> list[Fault]:
    faults = []
    names = _names(tables, "source")
    for where, source in sources:
        if names.count(source.name) > 1:
            faults.append(Fault(f"{where}.name", "two sources have this name"))
    reference = tables.get("reference_clock")
    if isinstance(reference, str) and reference not in names:
        faults.append(Fault("reference_clock", f"{reference!r} is no source; {_did_you_mean(reference, names)}"))
    by_name = {c.name: c for _, c in channels}
    for where, source in sources:
        align = source.align
        if source.name == reference:
            if align is not None:
                faults.append(Fault(f"{where}.align", "the reference clock is not aligned to anything; leave it out"))
            continue
        if align is None:
            remedy = 'declare `align = { method = "motion" | "redundant" | "trigger" | "fixed", ... }`'
            faults.append(Fault(f"{where}.align", f"is missing; {remedy}"))
            continue
        if isinstance(align, MotionAlignment | RedundantAlignment):
            faults += _fault_of_pair(f"{where}.align.against", align.against, by_name, _names(tables, "channel"), source.name, False)
        if isinstance(align, RedundantAlignment | TriggerAlignment):
            faults += _fault_of_pair(f"{where}.align.channel", align.channel, by_name, _names(tables, "channel"), source.name, True)
        if isinstance(align, RedundantAlignment) and align.channel in by_name and align.against in by_name:
            own, other = by_name[align.channel].quantity, by_name[align.against].quantity
            if own != other:
                faults.append(Fault(f"{where}.align", f"a {own} does not repeat a {other}"))
    return faults


def _fault_of_pair(
    where: str, name: str, by_name: Mapping[str, ChannelSpec], names: Sequence[str], source: str, own: bool
) -> list[Fault]:
    """Check that a channel which an alignment names exists, on this source's clock or on another."""
    if name not in names:
        return [Fault(where, f"{name!r} is no channel; {_did_you_mean(name, names)}")]
    if name in by_name and (by_name[name].source == source) != own:
        return [Fault(where, f"{name!r} must be a channel of {'this source' if own else 'another clock'}")]
    return []


def _faults_of_channels(channels: Sequence[tuple[str, ChannelSpec]], tables: Mapping[str, Any]) -> list[Fault]:
    faults = []
    names = [c.name for _, c in channels]
    roles = [c.role for _, c in channels if c.role]
    sources = _names(tables, "source")
    for where, channel in channels:
        if names.count(channel.name) > 1:
            faults.append(Fault(f"{where}.name", "two channels have this name"))
        if channel.source not in sources:
            what = f"role {channel.role!r} has no source" if channel.role else "no such source"
            problem = f"{what}: {channel.source!r} is not declared; {_did_you_mean(channel.source, sources)}"
            faults.append(Fault(f"{where}.source", problem))
        faults += _faults_of_unit(where, channel)
        if channel.role and channel.role not in ROLES:
            nearest = nearest_first(channel.role, list(ROLES))[0]
            faults.append(Fault(f"{where}.role", f"unknown role {channel.role!r}; did you mean `{nearest}`?"))
        elif channel.role:
            if roles.count(channel.role) > 1:
                others = ", ".join(c.name for _, c in channels if c.role == channel.role and c.name != channel.name)
                faults.append(Fault(f"{where}.role", f"{channel.role!r} is also the role of {others}; one channel per role"))
            if channel.quantity in SI_UNITS and channel.quantity != ROLES[channel.role]:
                problem = f"role {channel.role!r} needs quantity {ROLES[channel.role]!r}, found {channel.quantity!r}"
                faults.append(Fault(f"{where}.quantity", problem))
    return faults


def _faults_of_unit(where: str, channel: ChannelSpec) -> list[Fault]:
    if channel.quantity not in SI_UNITS:
        nearest = nearest_first(channel.quantity, list(SI_UNITS))[0]
        return [Fault(f"{where}.quantity", f"unknown quantity {channel.quantity!r}; did you mean `{nearest}`?")]
    if channel.unit is None or channel.unit == "px":
        return []
    unit = find_unit(channel.unit)
    if unit is None:
        nearest = ", ".join(nearest_first(normalise_unit(channel.unit), sorted(UNITS))[:3])
        return [Fault(f"{where}.unit", f"unknown unit {channel.unit!r}; nearest known: {nearest}")]
    allowed = {channel.quantity} | ({"voltage"} if channel.sensor.sensitivity is not None else set())
    if not allowed & unit.quantities:
        fitting = ", ".join(u for u, v in UNITS.items() if channel.quantity in v.quantities)
        problem = f"{channel.unit!r} is no unit of {channel.quantity}; one of {fitting}"
        return [Fault(f"{where}.unit", problem)]
    return []


def _names(tables: Mapping[str, Any], key: str) -> list[str]:
    """Names in an array of tables, those of faulty tables too, so that one fault does not cause others."""
    rows = tables.get(key, [])
    return [str(row["name"]) for row in rows if isinstance(row, dict) and "name" in row] if isinstance(rows, list) else []


def _did_you_mean(name: str, names: Sequence[str]) -> str:
    return f"did you mean {nearest_first(name, names)[0]!r}?" if names else "none is declared"


def _databases(
    sources: Sequence[Source], path: Path, given: Mapping[str, str] | None, faults: list[Fault]
) -> Mapping[str, str]:
    """Read the CAN databases that the sources name, from beside the rig file unless they are given."""
    texts: dict[str, str] = {}
    for source in sources:
        if source.kind != "can" or source.database is None:
            continue
        if given is not None and source.database in given:
            texts[source.database] = given[source.database]
            continue
        file = path.parent / source.database
        try:
            # Vector's tools write DBC files in the Windows code page
            texts[source.database] = file.read_text(encoding="cp1252", errors="replace")
        except OSError as error:
            faults.append(Fault(f"source '{source.name}'.database", f"{file}: {error.strerror}"))
    return MappingProxyType(texts)
