"""Recorded files to the draft of a rig file: `draft_rig`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.bounded_toml import parse_toml
from recoil_acquisition.errors import ErrorCode, KeyPath, ReadError, StoreError, spelled, system_errors_as
from recoil_acquisition.linear_algebra import on_one_thread
from recoil_acquisition.new_file import give_name, partial_path
from recoil_acquisition.quantity import SI_UNITS, find_unit
from recoil_daq.drafting.clock_proposal import ClockProposal, Twin, by_motion, by_twin, find_twins
from recoil_daq.drafting.draft import Evidence, draft_tables
from recoil_daq.drafting.other_rig import OtherRig
from recoil_daq.drafting.recorded_source import (
    Database,
    RecordedSignal,
    RecordedSource,
    database_of,
    read_source,
    with_swing,
)
from recoil_daq.drafting.rig_draft import RigDraft
from recoil_daq.drafting.role_proposal import ProposedRoles, propose_roles
from recoil_daq.recording.file_summary import is_database
from recoil_daq.terminal.result import Printed, Progress
from recoil_rigs.certificate_table import Certificate, certificate_for, read_certificates
from recoil_rigs.open_values import count_stated, without_open_values
from recoil_rigs.sensitivity import Sensitivity, sensitivity_from_text

USUAL_NAME = "rig.toml"


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
    """

    path: Path
    draft: RigDraft
    sources: tuple[RecordedSource, ...]
    roles: ProposedRoles
    differences: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``init --json``."""
        questions = self.draft.questions()
        tables = parse_toml(self.draft.text())
        sound, _ = without_open_values(tables)
        return {
            "schema": "recoil-daq/init/1",
            "file": str(self.path),
            "model": None if self.roles.model is None else self.roles.model.value,
            "stated": count_stated(sound),
            "open": [
                {"key": spelled(one.parts), "question": one.question.meaning, "proposal": one.question.proposal}
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
                for row in sound.get("channel", [])
            ],
            "roles": [
                {"signal": key, "role": one.role or None, "certain": one.certain, "reason": one.reason}
                for key, one in self.roles.by_signal.items()
            ],
            "differences": list(self.differences),
            "notes": list(self.notes),
        }  # fmt: skip

    def show(self) -> None:
        """Print what was found, and what is open."""
        from recoil_daq.terminal.init import print_draft

        print_draft(self.to_json())

    def __repr__(self) -> str:
        return f"DraftedRig({self.path}: {len(self.draft.questions())} values open)"

    def with_answers(self, answers: Mapping[KeyPath, Any]) -> DraftedRig:
        """Put values in the places of questions."""
        return DraftedRig(
            self.path, self.draft.answered(answers), self.sources, self.roles, self.differences, self.notes
        )

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
        raise StoreError(
            "the rig file exists already", code=ErrorCode.EXISTS, path=path,
            remedy="give another --out, or --overwrite; with --from it takes over what the old one states",
        )  # fmt: skip


@on_one_thread
def draft_rig(
    files: Sequence[str | Path],
    *,
    databases: Sequence[str | Path] = (),
    sensors: str | Path | None = None,
    other: str | Path | None = None,
    out: str | Path = USUAL_NAME,
    progress: Progress = lambda _: None,
) -> DraftedRig:
    """Draft a rig file from the recorded files of one shot; nothing is written.

    What files and the shot itself tell is filled in with its reason; what only a person knows is a question.

    Parameters
    ----------
    files
        Recorded files, one for each recorder, bus, port or camera; CAN databases may be among them.
    databases
        CAN databases.
    sensors
        Table of certificates, see `recoil_rigs.certificate_table`.
    other
        Another rig file, finished or not, whose values are taken over.
    out
        Path of the rig file, from whose folder databases are named.
    progress
        Function called with the name of each step.

    Raises
    ------
    ReadError, RigError
        If a file cannot be read, or a table has faults.
    """
    path = Path(out)
    given = [Path(one) for one in files]
    of_buses = [*map(Path, databases), *(one for one in given if is_database(one))]
    recorded = [one for one in given if not is_database(one)]
    if not recorded:
        raise ReadError("no recorded file is given", path=given[0] if given else path, remedy="name those of one shot")
    certificates = () if sensors is None else read_certificates(Path(sensors))
    stated = None if other is None else OtherRig.read(Path(other))
    if stated is not None and not of_buses:
        of_buses = [one for one in stated.databases() if one.is_file()]
    known = [database_of(one, path.parent) for one in of_buses]
    sources: list[RecordedSource] = []
    for one in recorded:
        progress(one.name)
        sources += read_source(one, known, [source.name for source in sources], stated)
    sources = [_measured(source, certificates, stated) for source in sources]
    progress("compare the signals")
    reference = _reference(sources, stated)
    sources.sort(key=lambda one: one.name != reference)
    evidence = _evidence(path, sources, reference, certificates, stated)
    notes = (*(note for source in sources for note in source.notes), *_notes(evidence, known, sensors))
    return DraftedRig(
        path, draft_tables(evidence), tuple(sources), evidence.roles, tuple(_differences(evidence)), notes
    )


def _measured(source: RecordedSource, certificates: tuple[Certificate, ...], other: OtherRig | None) -> RecordedSource:
    """Take quantity and scale of signals whose file does not tell from the other rig and from certificates."""
    return replace(source, signals=tuple(_in_si(one, certificates, other) for one in source.signals))


def _in_si(signal: RecordedSignal, certificates: tuple[Certificate, ...], other: OtherRig | None) -> RecordedSignal:
    row = {} if other is None else other.channel_of(signal.source, signal.name)
    sensor = row.get("sensor")
    serial = str(sensor.get("serial", "")) if isinstance(sensor, dict) else ""
    unit = find_unit(signal.unit or str(row.get("unit", "")))
    certificate = certificate_for(certificates, serial=serial, signal=signal.name)
    quantity = str(row.get("quantity", "")) or ("" if certificate is None else certificate.quantity)
    if unit is None or quantity not in SI_UNITS:
        return signal
    if quantity in unit.quantities:
        measured = replace(signal, quantity=quantity, factor=unit.factor, offset=unit.offset)
    else:
        stated = _sensitivity(certificate, sensor)
        if stated is None or not stated[0].turned_into(unit) or quantity not in stated[0].per.quantities:
            return signal
        factor = unit.factor * stated[0].per_recorded(unit, stated[1])
        measured = replace(signal, quantity=quantity, factor=factor, offset=0.0)
    same = (measured.quantity, measured.factor, measured.offset) == (signal.quantity, signal.factor, signal.offset)
    return signal if same else with_swing(measured)


def _sensitivity(certificate: Certificate | None, sensor: Any) -> tuple[Sensitivity, float] | None:
    """Return the sensitivity that a certificate or the other rig states, and the amplifier behind it."""
    stated: dict[str, Any] = dict(sensor) if isinstance(sensor, dict) else {}
    if certificate is not None:
        stated |= certificate.sensor(None)
    try:
        return sensitivity_from_text(stated["sensitivity"]), float(stated.get("amplifier", 1.0))
    except (KeyError, TypeError, ValueError):
        return None


def _reference(sources: Sequence[RecordedSource], other: OtherRig | None) -> str:
    """Return the source whose clock is the reference: the other rig's, else the recorder with the highest rate."""
    names = [one.name for one in sources]
    stated = None if other is None else other.tables.get("reference_clock")
    if stated in names:
        return str(stated)

    def rank(source: RecordedSource) -> tuple[bool, float]:
        rates = [one.rate_hz for one in source.signals if math.isfinite(one.rate_hz)]
        return source.kind == "dewetron", max(rates, default=0.0)

    return max(sources, key=rank).name


def _evidence(
    path: Path,
    sources: Sequence[RecordedSource],
    reference: str,
    certificates: tuple[Certificate, ...],
    other: OtherRig | None,
) -> Evidence:
    """Compare the sources, and look what each signal does."""
    of_reference = next(one for one in sources if one.name == reference)
    others = [one for one in sources if one.name != reference]
    twins: dict[str, Twin] = {}
    supposed: dict[str, str] = {}
    found: dict[str, tuple[Twin, ...]] = {}
    for source in others:
        tried = source.signals if source.dated else ()
        found[source.name] = find_twins(tried, of_reference.signals, found_in_bytes=source.found_in_bytes)
        twins |= {twin.signal.key: twin for twin in found[source.name]}
        supposed |= _angular_rates(source, found[source.name])
    signals = [*of_reference.signals, *(one for source in others for one in source.signals)]
    as_measured = [_supposed(one, supposed) for one in signals]
    roles = propose_roles(as_measured, frozenset(twins))
    roles = _doubted(roles, supposed)
    clocks = {}
    for source in others:
        proposal = _clock(source, found[source.name], signals, roles)
        if proposal is not None:
            clocks[source.name] = proposal
    name = path.resolve().parent.name if path.stem == Path(USUAL_NAME).stem else path.stem
    return Evidence(name or "rig", sources, reference, roles, clocks, twins, supposed, certificates, other)


def _angular_rates(source: RecordedSource, twins: Sequence[Twin]) -> dict[str, str]:
    """Return the fields of an inertial sensor that are likely to be angular rates, and why."""
    repeating = {twin.signal.key: twin for twin in twins}
    of = next((twin for twin in twins if twin.of.quantity == "acceleration"), None)
    if not source.found_in_bytes or of is None:
        return {}
    return {
        one.key: f"{of.signal.name} of the same device repeats an acceleration, so this may be a rate; device's manual"
        for one in source.signals
        if one.key not in repeating and not one.unit and one.swing is not None and one.swing.moves
    }


def _supposed(signal: RecordedSignal, supposed: Mapping[str, str]) -> RecordedSignal:
    return replace(signal, quantity="angular_rate") if signal.key in supposed else signal


def _doubted(roles: ProposedRoles, supposed: Mapping[str, str]) -> ProposedRoles:
    """Ask for the roles of signals whose quantity is supposed."""
    by_signal = {key: replace(one, certain=False) if key in supposed else one for key, one in roles.by_signal.items()}
    return ProposedRoles(roles.model, by_signal)


def _clock(
    source: RecordedSource, twins: Sequence[Twin], signals: Sequence[RecordedSignal], roles: ProposedRoles
) -> ClockProposal | None:
    """Find the way in which a source's clock is found; None if none holds."""
    if twins or not source.dated:
        return by_twin(twins[0]) if twins else None
    by_role = {one.role: key for key, one in roles.by_signal.items() if one.role}
    own = [one for one in source.signals if roles.by_signal.get(one.key) and one.quantity == "displacement"]
    feels = next((one for one in signals if one.key == by_role.get("recoil_acceleration")), None)
    if not own or feels is None or feels.source == source.name:
        return None
    return by_motion(own[0], feels)


def _differences(evidence: Evidence) -> list[str]:
    """Say what is not as the other rig states it."""
    other = evidence.other
    if other is None:
        return []
    pairs = frozenset((one.source, one.name) for one in evidence.signals)
    found = list(other.unmatched(pairs))
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


def _notes(evidence: Evidence, databases: Sequence[Database], sensors: str | Path | None) -> list[str]:
    """Say what speaks against the draft, or is missing in it."""
    notes = []
    if evidence.roles.model is None:
        notes.append("the files show no shot of a gun or of one body on a line: no role is proposed")
    buses = [one.name for one in evidence.sources if one.kind == "can"]
    if databases and not buses:
        notes.append("a database is given, and no bus log")
    if sensors is not None:
        known = {one.signal for one in evidence.certificates if one.signal}
        lost = sorted(known - {one.name for one in evidence.signals})
        notes += [f"{Path(sensors).name}: no file has the signal {name!r}" for name in lost]
    return notes
