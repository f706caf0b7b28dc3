"""A log that was written, or is being written: opening it, reading a range of it, counting it, removing it."""

from __future__ import annotations

import contextlib
import heapq
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, islice, takewhile
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import StoreError, system_errors_as
from recoil_acquisition.files.file_lock import mark_path
from recoil_acquisition.log.record import HEAD_SIZE, OWN, UNNUMBERED, Kind, Record
from recoil_acquisition.log.scan import Damage, FileScan, Head, first_log_id, is_hole
from recoil_acquisition.log.segment import LOCK_NAME, SUFFIX, is_being_written, segment_paths
from recoil_acquisition.log.session import SessionText, session_in
from recoil_acquisition.log.tally import Loss, Tally

REORDER_BYTES = 64 << 20
"""Records behind a gap wait in memory for what fills it: a page that was moved, a copy in the spare folder."""

_NEAR = 1 << 18
"""Bytes before a range that are read in vain, at most, once it is found by halving."""
_HEADS = 8
"""Heads that are looked at behind a byte: the first ones may be copies within a payload."""
_END_BYTES = 8192
"""Most bytes behind the beginning of the last records, unless the log has some hundred sources."""
_SESSION_WITHIN = 64
"""Records at the beginning of a segment among which its session stands, damage or not."""


@dataclass(frozen=True)
class LogSegment:
    """One segment.

    Attributes
    ----------
    begin_ns
        Host time at which its first record was appended; None if its beginning is damaged or empty.
    longest_us
        Longest wait and span together of all records up to its end; None if that is not known.
    """

    path: Path
    begin_ns: int | None
    longest_us: int | None


@dataclass(frozen=True)
class LogSurvey:
    """Contents and losses of a log.

    Attributes
    ----------
    records
        Number of records that are there.
    losses
        Losses of each source.
    damages
        Places between sound records.
    unfinished_bytes
        Bytes behind the last sound record of each segment, up to the last that is not zero: damaged, or never finished.
    closed
        Whether it ended in order; else records may be missing at its end without a trace.
    """

    records: int
    lost_records: int
    released_records: int
    losses: tuple[Loss, ...]
    damages: tuple[Damage, ...]
    unfinished_bytes: int
    closed: bool

    @property
    def damaged_bytes(self) -> int:
        """Bytes that belong to no sound record."""
        return sum(damage.size for damage in self.damages) + self.unfinished_bytes

    @property
    def damaged(self) -> bool:
        """Whether something that was written is not there as it was written."""
        return bool(self.damages or self.unfinished_bytes or self.lost_records)


@dataclass(frozen=True, eq=False)
class Log:
    """A log as it was when it was opened; what is appended later may be read too.

    Attributes
    ----------
    session
        Statement of the writer on its sources and its rig; empty if it is damaged wherever it stands, and nobody has
        stated it again.
    segments
        Segments in the order in which they were written.
    """

    folder: Path
    log_id: bytes
    session: Mapping[str, Any]
    segments: tuple[LogSegment, ...]

    def records(
        self, source: int | None = None, start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[Record]:
        """Read the records in the order of their numbers, each once; damaged ones are left out.

        Parameters
        ----------
        source
            Number of the source that is wanted; None for all.
        start_ns, stop_ns
            Limits of the range, the only part of the log that is read: records of which something may have arrived in
            ``start_ns <= t < stop_ns``; None for no limit. A record of unknown span counts with the host time of its
            read alone.

        Raises
        ------
        StoreError
            If a segment cannot be read.
        """
        for record in self.around(start_ns, stop_ns):
            if (source is None or record.source == source) and record.within(start_ns, stop_ns):
                yield record

    def around(self, start_ns: int | None, stop_ns: int | None) -> Iterator[Record]:
        """Read the records of a span as `records` does, with what stands around it in the log."""
        return in_order(self._range(start_ns, stop_ns), None if start_ns is not None else 0)

    def session_records(self) -> list[Record]:
        """Return the records in which the session stands; those that are sound, else made of what is stated of it."""
        parts: dict[int, Record] = {}
        for record in _beginnings([segment.path for segment in self.segments], self.log_id):
            if record.source == OWN and record.kind == Kind.SESSION:
                with contextlib.suppress(ValueError, TypeError, KeyError, OverflowError):
                    parts.setdefault(int(record.said["part"]), record)
        if not parts and self.session:
            payloads = SessionText(self.session).payloads(None)
            return [Record(UNNUMBERED, OWN, Kind.SESSION, 0, payload, None, None, 0, 0) for payload in payloads]
        return [parts[i] for i in sorted(parts)]

    def clock_before(self, start_ns: int | None) -> Record | None:
        """Return the last record of the host's clocks at the beginning of a segment before an instant, or the first."""
        found: Record | None = None
        for record in _beginnings([segment.path for segment in self.segments], self.log_id):
            if record.source != OWN or record.kind != Kind.CLOCK:
                continue
            if found is None or (start_ns is not None and record.host_ns <= start_ns):
                found = record
        return found

    def survey(self) -> LogSurvey:
        """Read everything and say what is missing; raises StoreError if a segment cannot be read."""
        tally, damages, unfinished = Tally(), [], 0

        def every() -> Iterator[Record]:
            nonlocal unfinished
            for segment in self.segments:
                with FileScan(segment.path, self.log_id) as scan:
                    yield from scan
                    damages.extend(scan.damages)
                    unfinished += scan.unfinished

        for record in in_order(every(), 0):
            try:
                tally.take(record)
            except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
                raise StoreError(f"record {record.number} cannot be understood: {error}", path=self.folder) from error
        return LogSurvey(
            tally.records, tally.lost_records, tally.released_records, tally.losses, tuple(damages), unfinished,
            tally.closed,
        )  # fmt: skip

    def remove(self) -> None:
        """Remove the log; see `remove_log`. Of a spare folder, what is of this log goes."""
        remove_log(self.folder)
        with system_errors_as(StoreError, self.folder, "removed"):
            elsewhere = [segment.path for segment in self.segments if segment.path.parent != self.folder]
            for path in elsewhere:
                path.unlink()
            for folder in {path.parent for path in elsewhere}:
                if not any(folder.iterdir()):
                    folder.rmdir()

    def _range(self, start_ns: int | None, stop_ns: int | None) -> Iterator[Record]:
        """Yield the sound records of the segments and parts of segments in which a span can be, as they stand."""
        _, *ends_ns = (segment.begin_ns for segment in self.segments)
        for segment, end_ns in zip(self.segments, [*ends_ns, None], strict=True):
            # waits are rounded up: nothing that was appended before a record arrived behind the time it says
            if start_ns is not None and end_ns is not None and end_ns < start_ns:
                continue
            until_ns = None
            if stop_ns is not None and segment.longest_us is not None:
                until_ns = stop_ns + 1000 * (segment.longest_us + 2)
            if until_ns is not None and segment.begin_ns is not None and segment.begin_ns >= until_ns:
                continue
            with FileScan(segment.path, self.log_id) as scan:
                if start_ns is not None:
                    scan.at = _begin_of(scan, start_ns)
                for record in scan:
                    if until_ns is not None and record.logged_ns is not None and record.logged_ns >= until_ns:
                        break
                    yield record


def open_log(folder: Path) -> Log:
    """Open a log, without reading more of it than the beginning of each segment.

    Returns
    -------
    Log
        Log, with the segments of the spare folder where it went on in one.

    Raises
    ------
    StoreError
        If the folder cannot be read, holds no log, or holds segments of two logs.
    """
    folder = Path(folder)
    paths = _segments_in(folder)
    if not paths:
        raise StoreError("holds no log", path=folder, expected=f"segments such as 000001{SUFFIX}")
    log_id = _one_log_id(paths)
    if _is_capture(paths[0], log_id):
        raise StoreError("holds captures and no log", path=folder, remedy="name the folder of the log itself")
    session = session_in(_beginnings(paths, log_id)) or {}
    spare = session.get("spare")
    # absolute there, while `folder` may be relative
    if isinstance(spare, str) and Path(spare).is_dir() and Path(spare) != folder.resolve():
        paths += [path for path in _segments_in(Path(spare)) if first_log_id(path) == log_id]
    begins = [_begin(path, log_id) for path in paths]
    longest = [longest_us for _, longest_us in begins[1:]] + [_closing_longest_us(paths[-1], log_id)]
    segments = zip(paths, begins, longest, strict=True)
    return Log(folder, log_id, session, tuple(LogSegment(path, begin[0], last) for path, begin, last in segments))


def find_logs(folder: Path) -> tuple[Path, ...]:
    """Find logs that were left over: in a folder or anywhere below it, written by nobody at present.

    Returns
    -------
    tuple of Path
        Folders of the logs, sorted; empty if `folder` does not exist.

    Raises
    ------
    StoreError
        If the folder cannot be searched.
    """
    with system_errors_as(StoreError, folder, "searched"):
        folders = {path.parent for path in Path(folder).rglob(f"*{SUFFIX}")}
        left = sorted(path for path in folders if segment_paths(path) and not is_being_written(path))
    return tuple(path for path in left if not _holds_captures(path))


def remove_log(folder: Path) -> None:
    """Remove the segments of a log, and the folder if nothing else is in it.

    Raises
    ------
    StoreError
        If a writer still holds it, or the system refuses.
    """
    folder = Path(folder)
    with system_errors_as(StoreError, folder, "removed"):
        if is_being_written(folder):
            raise StoreError("this log is being written", path=folder, remedy="close the recording first")
        for path in segment_paths(folder).values():
            path.unlink()
        for left in (folder / LOCK_NAME, mark_path(folder / LOCK_NAME)):
            left.unlink(missing_ok=True)
        if not any(folder.iterdir()):
            folder.rmdir()


def in_order(records: Iterable[Record], following: int | None) -> Iterator[Record]:
    """Yield records in the order of their numbers, each once.

    Parameters
    ----------
    records
        Records as they stand in the files: some may be missing, moved, or there twice.
    following
        Number of the first; None for that of the first record, whatever it is.
    """
    standing = iter(records)
    first = next(standing, None)
    if first is None:
        return
    awaited = first.number if following is None else following
    waiting: list[tuple[int, int, Record]] = []
    size = 0
    for came, record in enumerate(chain([first], standing, [None])):
        if record is not None:
            heapq.heappush(waiting, (record.number, came, record))
            size += HEAD_SIZE + len(record.payload)
        # behind the last one nothing fills a gap any more
        while waiting and (record is None or size > REORDER_BYTES or waiting[0][0] <= awaited):
            number, _, lowest = heapq.heappop(waiting)
            size -= HEAD_SIZE + len(lowest.payload)
            if number >= awaited:
                awaited = number + 1
                yield lowest


def _segments_in(folder: Path) -> list[Path]:
    """Return the segments of a folder in which something was written."""
    with system_errors_as(StoreError, folder, "read"):
        return [path for path in segment_paths(folder).values() if not is_hole(path)]


def _holds_captures(folder: Path) -> bool:
    """Return whether files that are named like segments are captures: a shot may be called 100000."""
    for path in segment_paths(folder).values():
        log_id = None if is_hole(path) else first_log_id(path)
        if log_id is not None:
            return _is_capture(path, log_id)
    return False


def _is_capture(path: Path, log_id: bytes) -> bool:
    """Return whether a file declares what it holds, before the first record of a device."""
    with FileScan(path, log_id) as scan:
        own = takewhile(lambda record: record.source == OWN, scan)
        return any(record.number == UNNUMBERED for record in own)


def _one_log_id(paths: list[Path]) -> bytes:
    """Return the random bytes that the segments share."""
    first: tuple[Path, bytes] | None = None
    for path in paths:
        found = first_log_id(path)
        if found is None:
            continue
        if first is None:
            first = path, found
        elif found != first[1]:
            raise StoreError(
                f"belongs to another log than {first[0].name}",
                path=path,
                remedy="keep every log in a folder of its own",
            )
    if first is None:
        raise StoreError("not one record of this log is sound", path=paths[0].parent)
    return first[1]


def _begin(path: Path, log_id: bytes) -> tuple[int | None, int | None]:
    """Return when a segment begins, and the longest wait and span before it; None for what is not known."""
    with FileScan(path, log_id) as scan:
        head = scan.head_from(0, 1)
        if head is None:
            return None, None
        first = next(iter(scan), None)
        stated = None if scan.damages else _longest_us(first, Kind.SESSION)
        return head.record.logged_ns, stated


def _closing_longest_us(path: Path, log_id: bytes) -> int | None:
    """Return the longest wait and span of a log that says so at its end; None if it does not."""
    with FileScan(path, log_id) as scan:
        scan.at = max(scan.size - _END_BYTES, 0)
        last = None
        for last in scan:  # noqa: B007 - the last one is wanted
            pass
        return _longest_us(last, Kind.CLOSED)


def _longest_us(record: Record | None, kind: Kind) -> int | None:
    if record is None or record.source != OWN or record.kind != kind:
        return None
    try:
        stated = record.said.get("longest_us")
    except ValueError:
        return None
    return stated if isinstance(stated, int) else None


def _beginnings(paths: list[Path], log_id: bytes) -> Iterator[Record]:
    """Yield the first records of each segment."""
    for path in paths:
        with FileScan(path, log_id) as scan:
            yield from islice(scan, _SESSION_WITHIN)


def _begin_of(scan: FileScan, start_ns: int) -> int:
    """Return a byte of a file before which everything was appended before an instant."""
    low, high = 0, scan.size
    lowest = -1
    while high - low > _NEAR:
        middle = (low + high) // 2
        heads = list(islice(_heads(scan, middle, high), _HEADS))
        numbers = [head.record.number for head in heads]
        times = [head.record.logged_ns for head in heads]
        latest_ns = max((time_ns for time_ns in times if time_ns is not None), default=None)
        if latest_ns is None or None in times or latest_ns >= start_ns or max(numbers) <= lowest:
            high = middle
        else:
            low, lowest = middle, max(numbers)
    return low


def _heads(scan: FileScan, at: int, until: int) -> Iterator[Head]:
    while (head := scan.head_from(at, until)) is not None:
        yield head
        at = head.end
