"""A capture: a range of a log in one file, which says itself what it is and whether it is complete."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

from recoil_acquisition.errors import CorruptFileError, ReadError, StoreError, system_errors_as
from recoil_acquisition.files.new_file import give_name, partial_path, remove_partials
from recoil_acquisition.files.regular_file import FileState, state_of
from recoil_acquisition.log.folder import Log, in_order
from recoil_acquisition.log.record import OWN, UNNUMBERED, Kind, Record, pack_json, pack_record
from recoil_acquisition.log.scan import Damage, FileScan, first_log_id
from recoil_acquisition.log.session import session_in
from recoil_acquisition.log.tally import Loss, Tally

HOLDS = "holds"
"""Key of what is added to a declaration: by source, the first and last number and the bytes of the range."""


@dataclass(frozen=True, eq=False)
class Capture:
    """The content of a capture.

    Attributes
    ----------
    session
        Statement of the log's writer on its sources and its rig; empty if it is damaged.
    declaration
        Statement of what the capture is of; empty if it is damaged.
    records
        Records in the order of the log, those before the range among them.
    losses
        Records that the capture should hold and does not.
    unfinished_bytes
        Bytes behind the last sound record.
    """

    path: Path
    session: Mapping[str, Any]
    declaration: Mapping[str, Any]
    records: tuple[Record, ...]
    losses: tuple[Loss, ...]
    damages: tuple[Damage, ...]
    unfinished_bytes: int

    @property
    def complete(self) -> bool:
        """Whether it says what it should hold, and holds it."""
        return bool(self.declaration) and not self.losses

    def of(self, source: int) -> tuple[Record, ...]:
        """Return the records of a source."""
        return tuple(record for record in self.records if record.source == source)


def write_capture(
    log: Log, path: Path, start_ns: int | None, stop_ns: int | None, declaration: Mapping[str, Any]
) -> None:
    """Copy a range of a log into a file, forced to the disk and read back before it gets its name.

    The records stand in it byte for byte as in the log, between the session, the clock and the declaration.

    Parameters
    ----------
    log
        Log, which may still be written; what was appended before the call counts.
    path
        Path of a file that is not there.
    start_ns, stop_ns
        Limits of the range, as for `Log.records`.
    declaration
        Statement of what the range is; JSON types.

    Raises
    ------
    StoreError
        If the file exists, cannot be written, or does not read back as it was written. Nothing is left then.
    """
    if path.exists():
        raise StoreError.exists(path, "move it elsewhere")
    holds = extents(log, start_ns, stop_ns)
    stated = pack_json({**declaration, HOLDS: {str(source): list(found) for source, found in holds.items()}})
    declared = pack_record(log.log_id, Record(UNNUMBERED, OWN, Kind.SHOT, 0, stated, None, None, 0, 0))
    remove_partials(path)  # of an attempt that a crash ended
    temporary = partial_path(path)
    digest = hashlib.sha256()
    try:
        with system_errors_as(StoreError, path, "written", "make room"):
            with temporary.open("wb") as stream:
                for content in _pieces(log, start_ns, stop_ns, holds, declared):
                    stream.write(content)
                    digest.update(content)
            with temporary.open("rb") as stream:
                if hashlib.file_digest(stream, "sha256").digest() != digest.digest():
                    raise StoreError("does not read back as it was written", path=path, remedy="check the disk")
            give_name(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


_HELD: WeakValueDictionary[FileState, Capture] = WeakValueDictionary()
"""Captures that somebody holds, by their files as they were read: each of a shot's sources asks for the same one."""


def read_capture(path: Path) -> Capture:
    """Read a capture with all its records; one that somebody holds, and that nobody changed since, is not read again.

    Raises
    ------
    ReadError
        If it cannot be read.
    CorruptFileError
        If not one record in it is sound.
    """
    try:
        key = state_of(path)
    except OSError:
        return _read(path)
    held = _HELD.get(key)
    if held is None:
        held = _HELD[key] = _read(path)
    return held


def _read(path: Path) -> Capture:
    found: dict[int, Record] = {}
    stated: list[Record] = []
    declaration: dict[str, Any] = {}
    try:
        with capture_scan(path) as scan:
            for record in scan:
                if record.number != UNNUMBERED:
                    found.setdefault(record.number, record)
                elif record.kind == Kind.SESSION:
                    stated.append(record)
                elif not declaration and record.kind == Kind.SHOT:
                    declaration = _said(record)
            damages, unfinished = tuple(scan.damages), scan.unfinished
        records = tuple(found[number] for number in sorted(found))
        session = session_in(records) or session_in(stated) or {}
    except StoreError as error:
        raise ReadError(error.problem, path=path, expected=error.expected, found=error.found) from error
    return Capture(path, session, declaration, records, _losses(records, declaration), damages, unfinished)


def capture_holds(log: Log, path: Path, start_ns: int | None, stop_ns: int | None) -> bool:
    """Return whether a capture holds every record that a log has of a range, byte for byte.

    What the log says itself is dated by what it is about, and may have been appended when the capture was there
    already: of a part of a log only what devices gave is compared.
    """
    part = start_ns is not None or stop_ns is not None
    try:
        with capture_scan(path) as scan:
            if scan.log_id != log.log_id:
                return False
            there = in_order((record for record in scan if record.number != UNNUMBERED), None)
            for record in log.records(start_ns=start_ns, stop_ns=stop_ns):
                if part and record.source == OWN:
                    continue
                found = next((one for one in there if one.number >= record.number), None)
                if found != record:
                    return False
    except (StoreError, CorruptFileError):
        return False
    return True


def capture_scan(path: Path) -> FileScan:
    """Open a capture record by record.

    Raises
    ------
    StoreError
        If it cannot be read.
    CorruptFileError
        If not one record at its beginning is sound.
    """
    log_id = first_log_id(path)
    if log_id is None:
        raise CorruptFileError("holds not one sound record of a log", path=path)
    return FileScan(path, log_id)


def extents(log: Log, start_ns: int | None, stop_ns: int | None) -> dict[int, tuple[int, int, int]]:
    """Return what a log has of a range: by source, but for its own, the first and last number, and bytes."""
    found: dict[int, tuple[int, int, int]] = {}
    begins: dict[int, int] = {}
    for record in log.records(start_ns=start_ns, stop_ns=stop_ns):
        if record.source != OWN:
            begin = begins.setdefault(record.source, record.position)
            first = found[record.source][0] if record.source in found else record.source_number
            found[record.source] = first, record.source_number, record.position + len(record.payload) - begin
    return found


def _pieces(
    log: Log,
    start_ns: int | None,
    stop_ns: int | None,
    holds: Mapping[int, tuple[int, int, int]],
    declared: bytes,
) -> Iterator[bytes]:
    session = [pack_record(log.log_id, record) for record in log.session_records()]
    yield from session
    clock = log.clock_before(start_ns)
    if clock is not None:
        yield pack_record(log.log_id, clock)
    yield declared
    for record in log.around(start_ns, stop_ns):
        # all of a source from the first to the last, so that a number that is missing is one that is lost
        first, last, _ = holds.get(record.source, (0, -1, 0))
        if first <= record.source_number <= last or (record.source == OWN and record.within(start_ns, stop_ns)):
            yield pack_record(log.log_id, record)
    yield declared
    yield from session


def _said(record: Record) -> dict[str, Any]:
    try:
        return record.said
    except ValueError:
        return {}


def _losses(records: tuple[Record, ...], declaration: Mapping[str, Any]) -> tuple[Loss, ...]:
    """Return what is missing of each source by its numbers, and by what the declaration says there must be."""
    tally = Tally()
    ends: dict[int, int] = {}
    stated = declaration.get(HOLDS)
    for source, extent in stated.items() if isinstance(stated, dict) else ():
        try:
            number, first, last = int(source), int(extent[0]), int(extent[1])
        except (ValueError, TypeError, LookupError, OverflowError):
            continue
        tally.begin(number, first)
        ends[number] = last + 1
    for record in records:
        if record.source != OWN:
            tally.begin(record.source, record.source_number)
            tally.take(record)
    for number, end in ends.items():
        tally.reach(number, end)
    return tuple(sorted(tally.losses, key=lambda loss: (loss.source, loss.first)))
