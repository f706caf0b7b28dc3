"""Recorded files to the draft of a rig file: `draft_rig`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from recoil_acquisition.errors import (
    ErrorCode,
    FramingError,
    KeyPath,
    ReadError,
    RecoilDaqError,
    RigError,
    Row,
    StoreError,
    spelled,
    system_errors_as,
)
from recoil_acquisition.files.bounded_toml import parse_toml
from recoil_acquisition.files.new_file import give_name, partial_path
from recoil_acquisition.files.regular_file import check_regular
from recoil_acquisition.files.shot_name import composed, numbers_of
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_daq.arguments import shot_file_error
from recoil_daq.drafting.answer import Answer
from recoil_daq.drafting.draft import draft_tables
from recoil_daq.drafting.evidence import USUAL_NAME, Evidence, evidence_of
from recoil_daq.drafting.other_rig import OtherRig
from recoil_daq.drafting.recorded_source import (
    Database,
    RecordedSource,
    database_of,
    read_source,
)
from recoil_daq.drafting.rig_draft import RigDraft
from recoil_daq.drafting.role_proposal import ProposedRoles
from recoil_daq.recording.file_summary import is_database
from recoil_daq.terminal.result import Printed, Progress
from recoil_rigs.tables.certificate_table import USUAL_NAME as TABLE_OF_CERTIFICATES
from recoil_rigs.tables.certificate_table import read_certificates, same_twice
from recoil_rigs.tables.digital_certificate import is_digital_certificate
from recoil_rigs.tables.open_values import without_open_values
from recoil_rigs.tables.sensitivity import OUTPUTS

NOTHING: Mapping[str, Any] = MappingProxyType({})
_ORDER = "recoil-daq init FILES..."


@dataclass(frozen=True, repr=False)
class DraftedRig(Printed):
    """The draft of a rig file.

    Attributes
    ----------
    path
        Path at which it was written, or is to be.
    draft
        Tables of the file, with their reasons and questions.
    sources
        Files, each as a source with its signals.
    roles
        Roles of the signals, with the evidence for them.
    differences
        Sentences on what is not as another rig states it.
    notes
        Sentences on what was found, and what was not.
    left_out
        Errors of the files that could not be read, by their paths.
    lacks
        Sentences on what the draft lacks, so that it is none of the files given: a file that an optional library would
        read, roles of the other rig that no channel has any more.
    """

    path: Path
    draft: RigDraft
    sources: tuple[RecordedSource, ...]
    roles: ProposedRoles
    differences: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    left_out: Mapping[Path, RecoilDaqError] = field(default_factory=dict)
    lacks: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``init --json``."""
        questions = self.draft.questions()
        tables = parse_toml(self.draft.text())
        sound = without_open_values(tables)
        return {
            "schema": "recoil-daq/init/1",
            "file": str(self.path),
            "model": None if self.roles.model is None else self.roles.model.value,
            "stated": sound.stated,
            "open": [
                {
                    "key": spelled(one.parts), "question": one.question.meaning, "proposal": one.question.proposal,
                    "first": one.question.opens,
                }
                for one in questions
            ],
            "sources": [
                {
                    "name": one.name, "kind": one.kind, "file": one.file.name, "format": one.format_name,
                    "signals": len(one.signals),
                }
                for one in self.sources
            ],
            "channels": [
                {
                    "name": row.get("name"), "source": row.get("source"), "signal": row.get("signal"),
                    "quantity": row.get("quantity"), "unit": row.get("unit"), "role": row.get("role"),
                    "polarity": row.get("polarity"),
                }
                for row in sound.tables.get("channel", [])
            ],
            "roles": [
                {"signal": key, "role": one.role or None, "certain": one.certain, "reason": one.reason}
                for key, one in self.roles.by_signal.items()
            ],
            "left_out": [
                {"file": path.name, "code": error.code.value, "text": error.without_path()}
                for path, error in self.left_out.items()
            ],
            "differences": list(self.differences),
            "notes": list(self.notes),
            "lacks": list(self.lacks),
        }  # fmt: skip

    def show(self) -> None:
        """Print what was found, and what is open."""
        from recoil_daq.terminal.init import print_draft

        print_draft(self.to_json())

    def __repr__(self) -> str:
        return f"DraftedRig({self.path}: {len(self.draft.questions())} values open)"

    def with_answers(self, answers: Mapping[KeyPath, Answer]) -> DraftedRig:
        """Put answers in the places of questions."""
        values = {key: answer.value for key, answer in answers.items()}
        reasons = {key: f"typed as {answer.typed}" for key, answer in answers.items() if answer.typed}
        return replace(self, draft=self.draft.answered(values, reasons))

    def answered_tables(self, answers: Mapping[KeyPath, Answer]) -> dict[str, Any]:
        """Return the tables of a rig file that have answers, with what tells whose they are, for the next draft.

        Of a source all is returned by which its file is read; how its clock is found is to be looked for again.
        """
        tables = without_open_values(parse_toml(self.with_answers(answers).draft.text())).tables
        found: dict[str, Any] = {}
        for parts in answers:
            row, key = parts[0], str(parts[-1])
            if not isinstance(row, Row) or row.index is None:
                if len(parts) == 2 and key in tables[str(row)]:
                    found.setdefault(str(row), {})[key] = tables[str(row)][key]
                continue
            table = tables[row.table][row.index]
            kept = found.setdefault(row.table, {}).setdefault(row.index, {})
            if row.table == "source":
                kept |= {name: value for name, value in table.items() if name not in ("align", "database")}
                if "database" in table:
                    kept["database"] = str((self.path.parent / table["database"]).resolve())
            else:
                kept |= {name: table[name] for name in ("name", "source", "signal")}
            if len(parts) == 2 and key != "database" and key in table:
                kept[key] = table[key]
            elif len(parts) == 3 and row.table == "channel" and key in table.get(str(parts[1]), {}):
                kept.setdefault(str(parts[1]), {})[key] = table[str(parts[1])][key]
        return {key: list(one.values()) if key in ("source", "channel") else one for key, one in found.items()}

    def write(self, *, overwrite: bool = False) -> None:
        """Write the rig file.

        Raises
        ------
        StoreError
            If there is one already and it is not to be replaced, or it cannot be written.
        """
        check_free(self.path, overwrite=overwrite)
        temporary = partial_path(self.path)
        try:
            with system_errors_as(StoreError, self.path, "written", "check the folder and the space on the disk"):
                self.path.parent.mkdir(parents=True, exist_ok=True)
                temporary.write_text(self.draft.text(), encoding="utf-8", newline="\n")
                give_name(temporary, self.path, overwrite=overwrite)
        finally:
            temporary.unlink(missing_ok=True)


def check_free(path: Path, *, overwrite: bool) -> None:
    """Raise StoreError where a rig file is there already that is not to be replaced."""
    if path.exists() and not overwrite:
        remedy = "give another --out, or --overwrite; with --from it takes over what the old one states"
        raise StoreError.exists(path, remedy, "the rig file")


@on_one_thread
def draft_rig(
    files: Sequence[str | Path],
    *,
    databases: Sequence[str | Path] = (),
    sensors: str | Path | Sequence[str | Path] | None = None,
    other: str | Path | None = None,
    answered: Mapping[str, Any] = NOTHING,
    out: str | Path = USUAL_NAME,
    progress: Progress = lambda _: None,
) -> DraftedRig:
    """Draft a rig file from the recorded files of one shot; nothing is written.

    What files and the shot itself tell is filled in with its reason; what only a person knows is a question. A file
    that cannot be read is named with what to do, and the others are drafted without it; so is a shot file, which a rig
    made already.

    Parameters
    ----------
    files
        Recorded files, one for each recorder, bus, port or camera; CAN databases may be among them.
    databases
        CAN databases.
    sensors
        Table of certificates, see `recoil_rigs.tables.certificate_table`, or digital certificates; these may be among
        the files, too.
    other
        Another rig file, finished or not, whose values are taken over.
    answered
        Tables of what was answered of an earlier draft, see `DraftedRig.answered_tables`; it stands before `other`.
    out
        Path of the rig file, from whose folder databases are named.
    progress
        Function called with the name of each step.

    Raises
    ------
    ReadError, RigError
        If a file is not there or given twice, or is a rig; none of them can be read, or a table has faults.
    """
    path = Path(out)
    given = [Path(one) for one in files]
    of_buses = [*map(Path, databases), *(one for one in given if is_database(one))]
    of_sensors = (
        [] if sensors is None else [Path(sensors)] if isinstance(sensors, str | Path) else [*map(Path, sensors)]
    )
    of_sensors += [one for one in given if is_digital_certificate(one)]
    recorded = [one for one in given if not (is_database(one) or is_digital_certificate(one))]
    if not recorded:
        raise ReadError("no recorded file is given", path=given[0] if given else path, remedy="name those of one shot")
    _refuse_others(recorded)
    certificates = tuple(found for one in of_sensors for found in read_certificates(one))
    if of_sensors and (twice := same_twice(certificates)):
        raise RigError(of_sensors[-1], twice)
    stated = None if other is None else OtherRig.read(Path(other))
    if stated is not None and not of_buses:
        of_buses = [one for one in stated.databases() if one.is_file()]
    before = stated
    if answered:
        stated = (stated or OtherRig(path, {}, {})).with_answers(answered)
        typed = [one for one in OtherRig(path, answered, {}).databases() if one.is_file()]
        of_buses += [one for one in typed if one.resolve() not in {known.resolve() for known in of_buses}]
    known = [database_of(one, path.parent) for one in of_buses]
    sources: list[RecordedSource] = []
    left_out: dict[Path, RecoilDaqError] = {}
    shot_files: list[Path] = []
    for one in recorded:
        progress(one.name)
        shot_file = shot_file_error(one, _ORDER)
        if shot_file is not None:
            left_out[one] = shot_file
            shot_files.append(one)
            continue
        try:
            sources += read_source(one, known, [source.name for source in sources], stated)
        except (ReadError, FramingError) as error:
            left_out[one] = error
    if not sources:
        if left_out:
            raise next(iter(left_out.values()))
        raise ReadError("no source that a rig knows is in it", path=recorded[0], remedy="give the files of one shot")
    progress("compare the signals")
    lacking = [(one.name, error.without_path()) for one, error in left_out.items() if one not in shot_files]
    # a bus whose messages nothing explains may have what would be larger than all that is known
    unexplained = any(source.kind == "can" and not source.signals for source in sources)
    evidence = evidence_of(path, sources, certificates, stated, complete=not lacking and not unexplained)
    notes = (*(note for source in sources for note in source.notes), *_notes(evidence, known, of_sensors))
    draft = draft_tables(evidence, lacking)
    differences = tuple(_differences(evidence, before))
    lacks = (*_unread(left_out), *_lost_roles(evidence, draft, before))
    return DraftedRig(path, draft, tuple(evidence.sources), evidence.roles, differences, notes, left_out, lacks)


def _refuse_others(files: Sequence[Path]) -> None:
    """Refuse what is no recorded file of a shot, or there twice, before any of them is read."""
    for k, path in enumerate(files):
        check_regular(path)
        if path.name.casefold() == TABLE_OF_CERTIFICATES:
            raise ReadError("this is a table of certificates", path=path, remedy="name it behind --sensors")
        if path.resolve() in [one.resolve() for one in files[:k]]:
            raise ReadError("is given twice", path=path, remedy="name each file of the shot once")


def _unread(left_out: Mapping[Path, RecoilDaqError]) -> Iterator[str]:
    """Say which files an optional library would read."""
    for path, error in left_out.items():
        if error.code is ErrorCode.NOT_INSTALLED:
            yield f"{path.name} is not in the draft: {error.without_path()}, and draft again"


def _lost_roles(evidence: Evidence, draft: RigDraft, other: OtherRig | None) -> Iterator[str]:
    """Say which roles of the other rig's channels no channel of the draft has, or is asked for."""
    if other is None:
        return
    asked = {one.question.proposal for one in draft.questions() if one.parts[-1] == "role"}
    kept = {table.value("role") for table in draft.tables if table.heading == "[[channel]]" and not table.left_out}
    for role, channel in other.roles_of({one.name for one in evidence.sources}).items():
        if role not in asked | {one for one in kept if isinstance(one, str)}:
            yield f"no channel has the role {role} that {other.path.name} gives {channel!r}: correct its `signal` there"


def _differences(evidence: Evidence, other: OtherRig | None) -> list[str]:
    """Say what is not as the other rig states it."""
    if other is None:
        return []
    pairs = frozenset((one.source, one.name) for one in evidence.signals)
    found = list(other.unmatched([one.name for one in evidence.sources], pairs))
    for one in evidence.signals:
        row = other.channel_of(one.source, one.name)
        if not row:
            moves = one.swing is not None and one.swing.moves
            if moves and one.key in evidence.roles.by_signal:
                found.append(f"{one.name!r} is new: {other.path.name} has no channel of it")
            continue
        if one.unit and row.get("unit") not in (None, one.unit):
            found.append(f"{row.get('name')}: {other.path.name} says {row['unit']!r}, the file {one.unit!r}")
        proposal = evidence.roles.by_signal.get(one.key)
        if proposal is not None and proposal.role and row.get("role") not in (None, "", proposal.role):
            found.append(f"{row.get('name')}: {other.path.name} says {row['role']}, but {proposal.reason}")
    return found


def _notes(evidence: Evidence, databases: Sequence[Database], sensors: Sequence[Path]) -> list[str]:
    """Say what speaks against the draft, or is missing in it."""
    notes = [
        f"{one.name} and {other.name} differ in a number alone: give the files of one shot"
        for one, other in _alike([source.file for source in evidence.sources])
    ]
    if evidence.roles.model is None:
        notes.append("the files show no shot of a gun or of one body on a line: no role is proposed")
        moving = [one for one in evidence.signals if one.swing is not None and one.swing.moves]
        volts = [one.name for one in moving if one.quantity in OUTPUTS]
        if volts:
            shown = ", ".join(volts[:8])
            notes.append(f"volts behind sensors: state the sensitivity of each, with its `signal`, in a table: {shown}")
    buses = [one.name for one in evidence.sources if one.kind == "can"]
    if databases and not buses:
        notes.append("a database is given, and no bus log")
    notes += [f"{one.file}: {one.said}" for one in evidence.certificates if one.said]
    if sensors:
        known = {composed(one.signal) for one in evidence.certificates if one.signal}
        lost = sorted(known - {composed(one.name) for one in evidence.signals})
        notes += [f"{sensors[0].name}: no file has the signal {name!r}" for name in lost]
    return notes


def _alike(files: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Return the pairs of files whose names differ in the number alone that may be a shot's."""
    return [
        (one, other)
        for k, other in enumerate(files)
        for one in files[:k]
        if one.name != other.name
        and numbers_of(one) != numbers_of(other)
        and re.sub(r"\d+", "", one.name) == re.sub(r"\d+", "", other.name)
    ]
