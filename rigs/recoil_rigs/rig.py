"""The rig file: the stand, its sources, its channels and the mechanism under test.

A rig file is TOML. `load_rig` reads one and reports every fault at once (`recoil_acquisition.errors.RigError`),
each with its key path and what would be right.
"""

from __future__ import annotations

import codecs
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

from recoil_acquisition.devices.can_device import delivers_several_buses
from recoil_acquisition.errors import Fault, FaultCode, KeyPath, ReadError, RigError, Row
from recoil_acquisition.files.bounded_toml import LARGEST_BYTES
from recoil_acquisition.files.regular_file import check_regular, read_small
from recoil_acquisition.files.shot_name import composed
from recoil_acquisition.listing import Listed, Listing
from recoil_acquisition.quantities.unit_choice import UnitChoice
from recoil_acquisition.readers.can.messages import CanDatabase, load_database
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.trigger.detector import Trigger
from recoil_rigs.checks.fault_causes import causes
from recoil_rigs.checks.plausible import foreign_keys, implausible_values, unusual_values
from recoil_rigs.checks.rig_alignments import motion_channels
from recoil_rigs.checks.rig_faults import faults_of_tables, unstated_uncertainties
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig_file import SCHEMA, read_tables
from recoil_rigs.tables.calibration_day import CalibrationDay
from recoil_rigs.tables.channel_table import ChannelSpec, Sensor
from recoil_rigs.tables.force_input import ForceInput
from recoil_rigs.tables.issue import NOTHING_STATED, REPORT, Issue
from recoil_rigs.tables.knowledge import NOTHING_KNOWN, Knowledge
from recoil_rigs.tables.rig_tables import (
    MOTIONS,
    ROLES,
    AbsoluteAlignment,
    AbsoluteTime,
    Alignment,
    ExposureAlignment,
    FixedAlignment,
    MotionAlignment,
    RedundantAlignment,
    Source,
    SourceKind,
    TriggerAlignment,
)
from recoil_rigs.tables.specification import Specification

__all__ = [
    "MOTIONS",
    "ROLES",
    "SCHEMA",
    "AbsoluteAlignment",
    "AbsoluteTime",
    "Alignment",
    "ChannelSpec",
    "ExposureAlignment",
    "FixedAlignment",
    "MotionAlignment",
    "RedundantAlignment",
    "Rig",
    "Sensor",
    "Source",
    "SourceKind",
    "TriggerAlignment",
    "bundled_rigs",
    "find_rig",
    "load_rig",
    "parse_rig",
]

_HEAD_BYTES = 4096
"""Number of bytes in which a rig file says what it is."""
LARGEST_DATABASE_BYTES = 4_000_000
"""Size beyond which a database is not parsed: some 15,000 signals have 2 MB; parsing takes 300 bytes of memory for each
byte."""


@dataclass(frozen=True)
class Rig(Listed):
    """A validated rig.

    Attributes
    ----------
    reference_clock
        Name of the source whose clock all others are aligned to.
    text
        Text of the rig file, verbatim.
    databases
        Text of every CAN database that a source names, by the name it uses.
    trigger
        Conditions of a live shot's beginning, and how much is kept around it.
    knowledge
        Knowledge of forces beside the gauges' certificates.
    report
        Identity of the reports, and the tolerance of the mass.
    twin
        The table ``[twin]`` of a virtual rig, as read; empty if there is none.
    doubts
        Faults for which a rig file is refused and a shot that was recorded all the same is not valid, see `parse_rig`.
    added_mass_kg, u_added_mass_kg
        Mass that `with_added_mass` has added to the recoiling part, which is in the mechanism's ``m3``, and its
        standard uncertainty.
    """

    name: str
    reference_clock: str
    mechanism: Mechanism
    sources: tuple[Source, ...]
    channels: tuple[ChannelSpec, ...]
    text: str
    path: Path
    databases: Mapping[str, str] = field(default_factory=dict)
    trigger: Trigger | None = None
    knowledge: Knowledge = NOTHING_KNOWN
    report: Issue = NOTHING_STATED
    twin: Mapping[str, Any] = field(default_factory=dict)
    doubts: tuple[Fault, ...] = ()
    added_mass_kg: float = 0.0
    u_added_mass_kg: float | None = 0.0

    def __repr__(self) -> str:
        return f"Rig({self.name!r}: {len(self.channels)} channels of {len(self.sources)} sources, {self.path})"

    def listing(self) -> Listing:
        """List the channels with their sensors."""
        rows = [
            (
                channel.name, channel.role or None, channel.quantity, channel.unit, channel.source,
                channel.sensor.serial or None, channel.sensor.u_rel if channel.sensor.states_u_rel else None,
            )
            for channel in self.channels
        ]  # fmt: skip
        return Listing(repr(self), ("channel", "role", "quantity", "unit", "source", "serial", "u_rel"), tuple(rows))

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
        """Return the (first) channel of a role, or None."""
        return next(iter(self.with_role(role)), None)

    def with_role(self, role: str) -> tuple[ChannelSpec, ...]:
        """Return all channels of a role: several gauges may measure one pressure."""
        return tuple(c for c in self.channels if c.role == role)

    @cached_property
    def forces(self) -> tuple[ForceInput, ...]:
        """Measured forces, in the order of every table of forces."""
        return self.mechanism.forces(self.channels)

    def force(self, name: str) -> ForceInput:
        """Return a measured force by its name; KeyError if there is none."""
        for force in self.forces:
            if force.name == name:
                return force
        raise KeyError(name)

    @property
    def camera_on_ground(self) -> bool:
        """Whether the recoil displacement is seen from the ground, and not along the tipping part."""
        spec = self.by_role("recoil_displacement")
        sees = None if spec is None else self.source(spec.source).sees
        return sees == "ground" and self.mechanism.needs_carriage("recoil_displacement")

    def with_camera_on_ground(self, on_ground: bool) -> Rig:
        """Let the camera of the recoil displacement stand on the ground, or see along the tipping part."""
        spec = self.by_role("recoil_displacement")
        sees = "ground" if on_ground else "tipping_part"
        return replace(
            self,
            sources=tuple(
                s.model_copy(update={"sees": sees}) if spec is not None and s.name == spec.source else s
                for s in self.sources
            ),
        )

    def without_channel(self, name: str) -> Rig:
        """Leave a channel out."""
        return replace(self, channels=tuple(c for c in self.channels if c.name != name))

    def with_added_mass(self, added_mass_kg: float, u_added_mass_kg: float | None) -> Rig:
        """Add a mass to the recoiling part, as one shot was fired.

        ``m3`` is the sum of both masses then, its standard uncertainty the root of the sum of both squares.
        Centre of mass and moment of inertia stay as the rig file has them: neither enters the mass.

        Parameters
        ----------
        added_mass_kg
            Mass that was added; negative if some was taken off.
        u_added_mass_kg
            Standard uncertainty of the added mass; None if nothing states it: it is taken as exact, which the
            assumptions then say.

        Raises
        ------
        RigError
            If no recoiling part is left.
        """
        m3 = self.mechanism.m3 + added_mass_kg
        if not 0.0 < m3 < math.inf:
            problem = f"{self.mechanism.m3:g} kg with {added_mass_kg:g} kg added, as the shot log has it, are no mass"
            raise RigError(self.path, [Fault(("mechanism", "m3"), problem, FaultCode.RANGE)])
        u = dict(self.mechanism.u)
        if u_added_mass_kg:
            u["m3"] = math.hypot(u.get("m3", 0.0), u_added_mass_kg)
        mechanism = replace(self.mechanism, m3=m3, u=MappingProxyType(u))
        return replace(self, mechanism=mechanism, added_mass_kg=added_mass_kg, u_added_mass_kg=u_added_mass_kg)

    def with_muzzle_velocity(self, measured_m_s: float, u_m_s: float | None) -> Rig:
        """Take the muzzle velocity that was measured of one shot; a rig that states no projectile stays as it is.

        Parameters
        ----------
        u_m_s
            Standard uncertainty of it; None where nothing states one: that of the rig stands then.

        Raises
        ------
        RigError
            If it is no velocity.
        """
        if self.knowledge.projectile is None:
            return self
        if not 0.0 < measured_m_s < math.inf:
            problem = f"{measured_m_s:g} m/s, as the shot log has it, is no muzzle velocity"
            where = ("knowledge", "projectile", "muzzle_velocity_m_s")
            raise RigError(self.path, [Fault(where, problem, FaultCode.RANGE)])
        projectile = self.knowledge.projectile.at(measured_m_s, u_m_s)
        return replace(self, knowledge=self.knowledge.model_copy(update={"projectile": projectile}))

    @property
    def read_in(self) -> UnitChoice:
        """Units in which people read it; SI of what its ``[report]`` chooses none of."""
        return UnitChoice.named(self.report.units or ())

    @property
    def specification(self) -> Specification:
        """Mass that the recoiling part should have as it was fired."""
        m, u_added_kg = self.mechanism, self.u_added_mass_kg or 0.0
        u = m.u.get("m3", 0.0)
        return Specification(
            # to a microgram, which is what the sum of both masses is exact to
            m3_kg=round(m.m3 - self.added_mass_kg, 9),
            u_m3_kg=round(math.sqrt(max(u**2 - u_added_kg**2, 0.0)), 9),
            added_kg=self.added_mass_kg,
            u_added_kg=u_added_kg,
            carried_kg=m.carried_mass,
            u_carried_kg=m.u.get("carried_mass", 0.0),
        )

    def channels_of(self, source: str) -> tuple[ChannelSpec, ...]:
        """Return the channels of one source, in the file's order."""
        return tuple(c for c in self.channels if c.source == source)

    def motion_channel(self, source: Source) -> ChannelSpec | None:
        """Return the channel of a source whose motion its alignment compares; None if it is not aligned by motion."""
        if not isinstance(source.align, MotionAlignment | ExposureAlignment) or source.align.against is None:
            return None
        wanted = source.align.channel if isinstance(source.align, MotionAlignment) else None
        return next(iter(motion_channels(source.name, wanted, source.align.against, self.channels)), None)

    def declarations(self, source: Source) -> Declarations:
        """Return what the rig declares about a source because its files do not carry it."""
        return Declarations(
            clock=source.name,
            database=None if source.database is None else self.databases[source.database],
            bus=source.bus,
            captured_bus=source.bus if delivers_several_buses(source.device) else None,
            counters=source.counters or (),
            framing=source.framing,
            frame_rate_hz=source.frame_rate,
            scale_mm_per_px=source.scale_mm_per_px,
            layout=source.layout,
        )

    def is_own_file(self, path: Path) -> bool:
        """Return whether a file is a rig file or one of the rig's databases, which no instrument wrote."""
        if path.name in {self.path.name, *(Path(name).name for name in self.databases)}:
            return True
        try:
            with path.open("rb") as file:
                return path.suffix.casefold() == ".toml" and SCHEMA.encode() in file.read(_HEAD_BYTES)
        except OSError:
            return False

    def matching(self, file_name: str) -> tuple[Source, ...]:
        """Return the sources whose ``match`` pattern fits a file name, without regard to case."""
        return tuple(s for s in self.sources if s.pattern is not None and s.pattern.fullmatch(composed(file_name)))

    @property
    def warnings(self) -> tuple[Fault, ...]:
        """Values that a rig may have and few do."""
        sources, channels = self._rows
        doubts = [fault.below((REPORT,)) for fault in self.report.shared_number]
        return (*unusual_values(self.mechanism, sources, channels), *self.foreign_keys, *doubts)

    @property
    def foreign_keys(self) -> tuple[Fault, ...]:
        """Keys of channels' ``sensor`` that say nothing of what the channel measures, or that nothing hangs on."""
        return tuple(foreign_keys(self.mechanism, *self._rows))

    @property
    def _rows(self) -> tuple[list[tuple[KeyPath, Source]], list[tuple[KeyPath, ChannelSpec]]]:
        """Sources and channels with their places in the file."""
        sources: list[tuple[KeyPath, Source]] = [((Row("source", one.name),), one) for one in self.sources]
        return sources, [((Row("channel", one.name),), one) for one in self.channels]

    def not_calibrated(self, day: CalibrationDay) -> tuple[Fault, ...]:
        """Return the calibrations that do not cover a day: past their due date, or made later."""
        found = []
        for c in self.channels:
            late, early = day.faults(c.sensor.calibrated, c.sensor.due)
            for key, problem, code in (("due", late, FaultCode.OVERDUE), ("calibrated", early, FaultCode.LATER)):
                if problem:
                    found.append(Fault((Row("channel", c.name), "sensor", key), problem, code))
        return tuple(found)


def bundled_rigs() -> tuple[str, ...]:
    """Names of the rigs that ship with the package."""
    folder = resources.files("recoil_rigs")
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
        return Path(str(resources.files("recoil_rigs") / f"{name_or_path}.toml"))
    expected = f"a TOML file or one of the bundled rigs {', '.join(bundled_rigs())}"
    if path.exists():
        check_regular(path)
    raise ReadError("no such rig file", path=path, expected=expected)


def load_rig(name_or_path: str | Path, *, refuse_doubts: bool = True) -> Rig:
    """Read and validate a rig file, or a bundled rig by its name; parameters otherwise as of `parse_rig`.

    Raises
    ------
    ReadError
        If there is no such file, it is larger than a rig file is, or not readable UTF-8.
    RigError
        With every fault of the file.
    """
    path = find_rig(str(name_or_path))
    return parse_rig(rig_text(path), path, refuse_doubts=refuse_doubts)


def rig_text(path: Path) -> str:
    """Return the text of a rig file, with the line ends of Unix.

    Raises
    ------
    ReadError
        If there is no such file, it is larger than a rig file is, or not readable UTF-8.
    """
    content = read_small(path, LARGEST_BYTES, "a rig file")
    try:
        text = content.decode("utf-8-sig")  # Windows editors begin a file with a byte order mark
    except UnicodeDecodeError as error:
        raise ReadError("is not UTF-8 text", path=path, place=f"byte {error.start}", expected="a TOML file") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parse_rig(text: str, path: Path, databases: Mapping[str, str] | None = None, *, refuse_doubts: bool = True) -> Rig:
    """Validate the text of a rig file.

    Some faults do not keep a shot from being read, they only leave its result in doubt: that the uncertainty of a
    sensor is not stated, or that a value is one which no such rig has.

    Parameters
    ----------
    path
        Path of the rig file; the files it names are looked up beside it.
    databases
        Text of the CAN databases by name, where they are at hand already (in a shot file).
    refuse_doubts
        Whether such faults are enough to refuse it. Where the shot has been recorded they are kept in the rig.

    Raises
    ------
    RigError
        With every fault of the text, and with every value that is still open (``TODO``), whatever is refused.
    """
    file = read_tables(text, path)
    sources, channels = file.sources.sound, file.channels.sound
    faults = causes([*file.faults, *faults_of_tables(file)], file)
    texts = _databases([source for _, source in sources], path, databases, faults)
    doubts = [*unstated_uncertainties(channels), *implausible_values(file.mechanism, sources, channels)]
    if file.open:
        places = file.places_of_open_values
        wrong = [fault for fault in (*faults, *doubts) if fault.parts not in places]
        raise RigError(path, [*wrong, *(one.fault() for one in file.open)], stated=file.stated)
    if faults or file.mechanism is None or (refuse_doubts and doubts):
        raise RigError(path, [*faults, *doubts])
    return Rig(
        name=file.texts["name"],
        reference_clock=file.texts["reference_clock"],
        mechanism=file.mechanism,
        sources=tuple(s for _, s in sources),
        channels=tuple(c for _, c in channels),
        text=text,
        path=path,
        databases=texts,
        trigger=file.trigger,
        knowledge=file.knowledge,
        report=file.report,
        twin=file.twin,
        doubts=tuple(doubts),
    )


def _databases(
    sources: Sequence[Source], path: Path, given: Mapping[str, str] | None, faults: list[Fault]
) -> Mapping[str, str]:
    """Read the CAN databases that the sources name, used or not, from beside the rig file unless they are given.

    Their texts go into every shot file, so that each must be a database: what else a rig names stays where it is.
    """
    texts: dict[str, str] = {}
    for source in sources:
        if source.kind != "can" or source.database is None:
            continue
        key = (Row("source", source.name), "database")
        if given is not None:
            # a shot file names no files of this computer
            if source.database in given:
                texts[source.database] = given[source.database]
            else:
                faults.append(Fault(key, f"{source.database} is not in {path.name}", FaultCode.FILE))
            continue
        try:
            texts[source.database], _ = read_database(path.parent / source.database)
        except ReadError as error:
            faults.append(Fault(key, str(error), FaultCode.FILE))
    return MappingProxyType(texts)


def read_database(file: Path) -> tuple[str, CanDatabase]:
    """Read a CAN database: its text, and what it says.

    Raises
    ------
    ReadError
        If there is no such file, it is larger than a database is, or none.
    """
    text = _database_text(read_small(file, LARGEST_DATABASE_BYTES, "a CAN database"))
    return text, load_database(text, file)


_XML_ENCODING = re.compile(
    rb"""\s*<\?xml[^>]{1,100}?encoding\s*=\s*["']((?:utf|iso|windows|latin|us|cp)[\w.-]{0,40})["']""",
    re.ASCII | re.IGNORECASE,
)


def _database_text(content: bytes) -> str:
    """Decode a CAN database: what its mark or XML declaration says, UTF-8, else the code page of Vector's tools.

    A text of the code page that has a degree sign or a superscript is never valid UTF-8 by chance:
    each would have to stand in a run of continuation bytes. The code page leaves five bytes
    undefined; they occur in comments of other code pages only, and become U+FFFD.
    """
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", errors="replace")
    declared = _XML_ENCODING.match(content)
    if declared is not None:
        try:
            return content.decode(declared[1].decode())
        except (LookupError, UnicodeError):
            pass  # the declaration is wrong, as those are that a tool copied
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")
