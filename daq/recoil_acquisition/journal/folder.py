"""A journal that was written: opening, finding and removing it.

A damaged record costs itself: what follows it is read all the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import StoreError
from recoil_acquisition.journal.layout import RELEASED, SUFFIX, SegmentHeader, header_size_stated, parse_header
from recoil_acquisition.journal.records import JournalRecord, Segment, scan_segment, survey_segment
from recoil_acquisition.log.lock import NAME as LOCK_NAME
from recoil_acquisition.log.lock import is_being_written
from recoil_acquisition.log.segment import segment_paths

OUT_OF_ORDER_NS = 30_000_000_000
"""Records of several threads, and what a stalled one held back, are written nearly in the order in which they arrived:
never further apart than this."""

_FIRST_BYTES = 64


@dataclass(frozen=True, eq=False)
class Journal:
    """A journal as it was when it was opened.

    Attributes
    ----------
    folder : Path
    session : mapping
        What the writer said of its sources, clocks and rig.
    segments : tuple of Segment
    damaged_headers : int
        Segments whose header is damaged; it is the same in all of them.
    """

    folder: Path
    session: Mapping[str, Any]
    segments: tuple[Segment, ...]
    damaged_headers: int = 0

    @property
    def count(self) -> int:
        """Number of whole records, those that list what was released among them."""
        return sum(segment.count for segment in self.segments)

    @property
    def cut_bytes(self) -> int:
        """Bytes of damaged or unfinished records that are not returned."""
        return sum(segment.cut_bytes for segment in self.segments)

    @property
    def released_records(self) -> int:
        """Records that the writer released: watched, nothing in them, and no longer there."""
        listed = next((segment.released for segment in reversed(self.segments) if segment.released), ())
        there = [(segment.first_sequence, segment.last_sequence) for segment in self.segments if segment.count]
        # what was listed a moment before a crash may be there all the same
        still = sum(max(min(b, last) - max(a, first) + 1, 0) for first, last in listed for a, b in there)
        return sum(last - first + 1 for first, last in listed) - still

    @property
    def lost_records(self) -> int:
        """Records missing before the last that is there; how many are cut at the very end cannot be known."""
        last = max((segment.last_sequence for segment in self.segments if segment.count), default=-1)
        return last + 1 - self.count - self.released_records

    @property
    def damaged(self) -> bool:
        """Whether something that was written is not there as it was written."""
        return bool(self.cut_bytes or self.lost_records or self.damaged_headers)

    def records(
        self, source: int | None = None, start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[JournalRecord]:
        """Read the records in the order in which they were written.

        Parameters
        ----------
        source : int or None
            Only those of this source; None for all.
        start_ns, stop_ns : int or None
            Only those of which something may have arrived in ``start_ns <= t < stop_ns``; None for no limit. A record
            of unknown span counts with the host time of its read alone.

        Yields
        ------
        JournalRecord

        Raises
        ------
        StoreError
            If a segment can no longer be read as it was when the journal was opened.
        """
        for segment in self.segments:
            late = stop_ns is not None and segment.oldest_ns >= stop_ns
            early = start_ns is not None and segment.newest_ns < start_ns
            if late or early or not segment.count:
                continue
            found = 0
            scanned = scan_segment(segment.path, segment.header, segment.first_sequence)
            for record in islice(scanned, segment.count):
                found += 1
                if record.source == RELEASED:
                    continue
                if source is not None and record.source != source:
                    continue
                if start_ns is not None and record.host_ns < start_ns:
                    continue
                if stop_ns is not None and record.from_ns >= stop_ns:
                    continue
                yield record
            if found < segment.count:
                raise StoreError(
                    "this journal changed while it was read",
                    path=segment.path,
                    expected=f"{segment.count} records",
                    found=str(found),
                    remedy="leave the folder alone and read it again",
                )

    def remove(self) -> None:
        """Remove the journal once its shot file is verified; see `remove_journal`."""
        remove_journal(self.folder)


def read_journal(folder: Path, start_ns: int | None = None, stop_ns: int | None = None) -> Journal:
    """Open a journal and count what is whole in it.

    Parameters
    ----------
    folder : Path
    start_ns, stop_ns : int or None
        Leave out segments that cannot hold records of this span of host time: those that begin more than
        `OUT_OF_ORDER_NS` after it, and those whose next one begins as long before it. Losses are not counted then.

    Returns
    -------
    Journal

    Raises
    ------
    StoreError
        If the folder cannot be read, holds no journal, or holds segments of two sessions.
    """
    folder = Path(folder)
    try:
        paths = segment_paths(folder, SUFFIX)
        if not paths:
            raise StoreError("holds no journal", path=folder, expected="segments such as 000001.journal")
        headers = {path: _read_header(path) for path in paths.values()}
        header = _one_header(folder, headers)
        damaged_headers = sum(one is None for one in headers.values())
        segments: list[Segment] = []
        following = 0
        for path in _within(list(paths.values()), header, start_ns, stop_ns):
            segment = survey_segment(path, header, following)
            segments.append(segment)
            following = segment.last_sequence + 1 if segment.count else following
    except OSError as error:
        raise StoreError(f"cannot be read: {error.strerror or error}", path=folder) from error
    return Journal(folder, header.session, tuple(segments), damaged_headers)


def find_journals(folder: Path) -> tuple[Path, ...]:
    """Find journals that were left over: in a folder or anywhere below it, written by nobody at present.

    Returns
    -------
    tuple of Path
        Their folders, sorted; empty if `folder` does not exist.

    Raises
    ------
    StoreError
        If the folder cannot be searched.
    """
    try:
        folders = {path.parent for path in Path(folder).rglob("*.journal")}
        return tuple(sorted(path for path in folders if segment_paths(path, SUFFIX) and not is_being_written(path)))
    except OSError as error:
        raise StoreError(f"cannot be searched: {error.strerror or error}", path=folder) from error


def remove_journal(folder: Path) -> None:
    """Remove the segments of a journal, and the folder if nothing else is in it.

    Raises
    ------
    StoreError
        If a writer still holds it, or the system refuses.
    """
    folder = Path(folder)
    try:
        if is_being_written(folder):
            raise StoreError("this journal is being written", path=folder, remedy="close the recording first")
        for path in segment_paths(folder, SUFFIX).values():
            path.unlink()
        (folder / LOCK_NAME).unlink(missing_ok=True)
        if not any(folder.iterdir()):
            folder.rmdir()
    except OSError as error:
        raise StoreError(f"cannot be removed: {error.strerror or error}", path=folder) from error


def _within(paths: list[Path], header: SegmentHeader, start_ns: int | None, stop_ns: int | None) -> list[Path]:
    """Return the segments that can hold records of a span; one whose beginning cannot be read is among them."""
    if start_ns is None and stop_ns is None:
        return paths
    begins = []
    for path in paths:
        first = next(scan_segment(path, header, 0), None)
        begins.append(None if first is None else first.host_ns)
    chosen = []
    for path, begin_ns, next_ns in zip(paths, begins, [*begins[1:], None], strict=True):
        late = stop_ns is not None and begin_ns is not None and begin_ns > stop_ns + OUT_OF_ORDER_NS
        early = start_ns is not None and next_ns is not None and next_ns < start_ns - OUT_OF_ORDER_NS
        if not late and not early:
            chosen.append(path)
    return chosen


def _read_header(path: Path) -> SegmentHeader | None:
    with path.open("rb") as stream:
        size = header_size_stated(stream.read(_FIRST_BYTES))
        if size is None or size > path.stat().st_size:
            return None
        stream.seek(0)
        return parse_header(stream.read(size))


def _one_header(folder: Path, headers: Mapping[Path, SegmentHeader | None]) -> SegmentHeader:
    """Return the header that all segments share; a damaged one is made good by the others."""
    intact = {path: header for path, header in headers.items() if header is not None}
    if not intact:
        raise StoreError("no segment of this journal has an undamaged header", path=folder)
    first, *others = intact.items()
    for path, header in others:
        if header.session_id != first[1].session_id:
            raise StoreError(
                f"belongs to another session than {first[0].name}",
                path=path,
                remedy="keep every journal in a folder of its own",
            )
    return first[1]
