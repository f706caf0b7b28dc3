"""The log that is written: everything that arrives is appended here first, and survives a crash.

A process that is killed loses nothing that `LogWriter.append` took; a loss of power loses at most what came after the
last synchronisation. Where the disk fails, the log goes on in a spare folder with all that may not be on the disk.
Records may be given back on purpose: their spans of numbers, within the log and within each source, are `Released`.
"""

from __future__ import annotations

import contextlib
import secrets
import struct
import threading
import time
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.clocks.host_clock import anchor
from recoil_acquisition.errors import StoreError
from recoil_acquisition.log.disk import LogDisk
from recoil_acquisition.log.record import (
    HEAD_SIZE,
    LONGEST_PAYLOAD,
    OWN,
    UNKNOWN,
    Kind,
    crc_seed,
    pack_head,
    pack_json,
)
from recoil_acquisition.log.session import SessionText

WHOLE = -1
"""Key of the numbers within the log, beside those of the sources."""

Span = tuple[int, int, int]
"""First and last number, and bytes of payload."""


class Released:
    """Spans that were released so far, of the log and of each source."""

    def __init__(self, spans: Mapping[int, Sequence[Span]] | None = None) -> None:
        self._spans = {key: merged(found) for key, found in (spans or {}).items()}

    @classmethod
    def from_json(cls, said: Mapping[str, Any]) -> Released:
        """Read what `to_json` gave.

        Raises
        ------
        ValueError, TypeError, KeyError, AttributeError, OverflowError
            If it is anything else.
        """
        spans = {WHOLE: said["records"]} | {int(source): found for source, found in said["sources"].items()}
        return cls({key: [(int(a), int(b), int(size)) for a, b, size in found] for key, found in spans.items()})

    def to_json(self) -> dict[str, Any]:
        """Return the content of a record that says so."""
        sources = {str(source): found for source, found in self._spans.items() if source != WHOLE}
        return {"records": self.of(WHOLE), "sources": sources}

    def add(self, spans: Mapping[int, Sequence[int]]) -> None:
        """Add one span of each key."""
        for key, (first, last, size) in spans.items():
            self._spans[key] = merged([*self.of(key), (first, last, size)])

    def of(self, key: int) -> list[Span]:
        """Return the spans of a source, or of the whole log, in their order."""
        return self._spans.get(key, [])

    @property
    def records(self) -> int:
        """Number of records of the log."""
        return sum(last - first + 1 for first, last, _ in self.of(WHOLE))


def merged(spans: Sequence[Span]) -> list[Span]:
    """Join spans (first, last, bytes) of numbers that follow one another."""
    joined: list[Span] = []
    for first, last, size in sorted(spans):
        if joined and joined[-1][1] + 1 == first:
            joined[-1] = (joined[-1][0], last, joined[-1][2] + size)
        else:
            joined.append((first, last, size))
    return joined


SEGMENT_BYTES = 64 << 20
"""Size of a segment unless another is stated."""

PAGE_BYTES = 4096
"""Bytes that a disk and a file system write, and lose, at a time."""
_SESSION_SHARE = 8
"""Part of the first segment that blanks between the session's copies may take: a small one has none."""
CLOCK_EVERY_S = 10.0
_AT_ONCE = frozenset((Kind.DECISION, Kind.SHOT, Kind.EVENT))
"""Kinds of records that are forced to the disk at once: they are small, and all else hangs on them."""
_OF_THE_LOG = frozenset((Kind.SESSION, Kind.CLOCK, Kind.RELEASED))
"""Kinds of records that no one needs of a segment for their own sake: they do not date it."""
_LONGEST_SYNC_INTERVAL_S = 0.25


@dataclass(frozen=True)
class LogCounters:
    """Counts of what a log has taken so far.

    Attributes
    ----------
    records
        Number of records, those of the log itself among them.
    bytes
        Bytes of these records, heads included.
    reserved_bytes
        Space that is reserved and not yet used.
    unsynced_s
        Age of the oldest record that is not yet forced to the disk; 0 if all are.
    released
        Records that were released.
    spare
        Reason why the log goes on in the spare folder; empty if it does not.
    """

    records: int
    bytes: int
    reserved_bytes: int
    unsynced_s: float
    released: int = 0
    spare: str = ""


class LogWriter:
    """A log that is written; safe to append to from several threads.

    Making it reserves the space. It is forced to the disk in the background, and as segments are
    released or used up new ones are reserved there too, so that the reserved space stays as large.

    Parameters
    ----------
    folder
        A folder without a log; made if it is missing.
    session
        Statement of what the records cannot tell: sources by number, the rig's text, its databases. JSON types. It
        stands in every segment.
    reserve_bytes
        Space to reserve; rounded up to whole segments.
    spare
        Folder on another disk, where the log goes on if the first one fails. One segment is reserved.
    segment_bytes
        Size of a segment; a record must fit into one.
    sync_interval_s
        Time between two synchronisations, at most 0.25 s.

    Raises
    ------
    StoreError
        If a folder holds a log, cannot be written, or its disk has not enough room. Nothing is left then.
    ValueError, TypeError
        If a number is out of its range, or `session` is not JSON.
    """

    def __init__(
        self,
        folder: Path,
        session: Mapping[str, Any],
        reserve_bytes: int,
        *,
        spare: Path | None = None,
        segment_bytes: int = SEGMENT_BYTES,
        sync_interval_s: float = 0.2,
    ) -> None:
        if not 0 < sync_interval_s <= _LONGEST_SYNC_INTERVAL_S:
            raise ValueError(f"sync_interval_s must be above 0 and at most 0.25, not {sync_interval_s!r}")
        if reserve_bytes < 0:
            raise ValueError(f"reserve_bytes must not be negative, not {reserve_bytes!r}")
        stated = dict(session) if spare is None else {**session, "spare": str(Path(spare).resolve())}
        self._session = SessionText(stated)
        # twice in the first segment, with the clock's record behind each
        begin = 2 * (self._session.record_bytes + 512)
        if segment_bytes < begin + HEAD_SIZE + 1:
            held = self._session.record_bytes
            raise ValueError(f"segment_bytes {segment_bytes!r} does not hold the session of {held} bytes twice")
        self.folder = Path(folder)
        self.spare = None if spare is None else Path(spare)
        self.log_id = secrets.token_bytes(8)
        self._seed = crc_seed(self.log_id)
        self._largest_payload = min(segment_bytes - begin - HEAD_SIZE, LONGEST_PAYLOAD)
        self._lock = threading.Lock()  # over the order of the records
        self._sync_turn = threading.Lock()  # one synchronisation at a time; taken before the other
        self._number = 0
        self._sources: dict[int, list[int]] = {}  # next number and position of each
        self._logged_ns = 0
        self._longest_us: int | None = 0
        self._clock_s = 0.0
        self._released = Released()
        self._records = self._bytes = 0
        self._unsynced_since: float | None = None
        self._syncing_since: float | None = None
        self._fault: StoreError | None = None
        self._untold = False  # whether no caller has met the fault yet
        self._in_doubt = False  # whether the disk refused what it was asked to force
        self._begun = self._closed = False
        self._disk = LogDisk(self.folder, reserve_bytes, self.spare, segment_bytes)
        try:
            self._begin()
        except BaseException:
            self._disk.undo()
            raise
        self._stop = threading.Event()
        self._sync_wanted = threading.Event()
        self._space_wanted = threading.Event()
        self._threads = (
            threading.Thread(target=self._keep_synced, args=(sync_interval_s,), name="log sync", daemon=True),
            threading.Thread(target=self._keep_reserved, args=(sync_interval_s,), name="log space", daemon=True),
        )
        for thread in self._threads:
            thread.start()

    def append(
        self,
        source: int,
        kind: int,
        host_ns: int,
        payload: bytes | bytearray | memoryview,
        *,
        empty_ns: int | None = None,
    ) -> int:
        """Write one record.

        Parameters
        ----------
        source, kind
            Numbers from 0 to 65535.
        host_ns
            Monotonic host time at which the read returned, nanoseconds.
        payload
            Data, contiguous, at most 1 MiB.
        empty_ns
            Monotonic host time at which the source was last found empty: what the payload holds arrived after it.

        Returns
        -------
        int
            Number of the record within the log.

        Raises
        ------
        StoreError
            If the record cannot be written, at this or an earlier call; all records before the first error are intact.
        ValueError
            If a number does not fit, the payload does not fit into a segment, or the log is closed.
        """
        data = payload if isinstance(payload, bytes) else _flat(payload)
        if len(data) > self._largest_payload:
            raise ValueError(f"a payload must not exceed {self._largest_payload} bytes, not {len(data)}")
        payload_crc = zlib.crc32(data, self._seed)
        span_us = UNKNOWN if empty_ns is None else min(max(-(-(host_ns - empty_ns) // 1000), 0), UNKNOWN)
        with self._lock:
            if self._closed:
                raise ValueError("this log is closed")
            try:
                self._refuse_if(self._fault)
                return self._append(source, kind, host_ns, data, payload_crc, span_us)
            except StoreError:
                self._untold = False
                raise

    def say(self, kind: Kind, host_ns: int, content: Mapping[str, Any]) -> int:
        """Write one record of the log itself; as `append`."""
        return self.append(OWN, kind, host_ns, pack_json(content))

    def sync(self) -> None:
        """Force everything that was appended before this call to the disk.

        Raises
        ------
        StoreError
            If the system cannot, or could not before, and there is no spare folder to go on in. The log takes no more
            records then: what a failed synchronisation left in memory cannot be trusted to be written by a later one.
        """
        try:
            self._sync()
        except StoreError:
            self._untold = False
            raise

    def release(self, before_ns: int, kept: Sequence[tuple[int, int]] = ()) -> int:
        """Remove the segments of which nobody needs anything, and record that this was on purpose.

        Parameters
        ----------
        before_ns
            Host time; what arrived at or after it stays.
        kept
            Spans of host time of which everything stays.

        Returns
        -------
        int
            Number of records that went. The segment being written always stays.

        Raises
        ------
        StoreError
            If the system refuses.
        """
        segments = self._disk.written.releasable(before_ns, kept)
        if not segments:
            return 0
        for segment in segments:
            self._released.add(segment.spans)
        # listed on the disk first: after a crash what is missing without a list would count as lost
        self.say(Kind.RELEASED, time.monotonic_ns(), self._released.to_json())
        self.sync()
        self._disk.written.remove(segments)
        self._space_wanted.set()
        return sum(segment.count for segment in segments)

    @property
    def counters(self) -> LogCounters:
        """Counts of what the log has taken so far."""
        with self._lock:
            waiting = [since for since in (self._syncing_since, self._unsynced_since) if since is not None]
            return LogCounters(
                self._records,
                self._bytes,
                self._disk.free_bytes,
                time.monotonic() - min(waiting) if waiting else 0.0,
                self._released.records,
                self._disk.spared,
            )

    def close(self, *, in_order: bool = True) -> None:
        """Force everything to the disk and give back the space that was not used.

        Parameters
        ----------
        in_order
            Whether the log ends as it should, and says so with the totals of its sources.

        Raises
        ------
        StoreError
            If the system cannot force it to the disk, unless an earlier call has said so. It is closed all the same.
        """
        with self._lock:
            if self._closed:
                return
            if in_order and self._fault is None:
                with contextlib.suppress(StoreError):  # it is in `_fault`, and raised below
                    self._end()
            self._closed = True
        self._stop.set()
        self._sync_wanted.set()
        self._space_wanted.set()
        for thread in self._threads:
            thread.join()
        with self._sync_turn:
            failure = self._disk.close()
        self._unsynced_since = None
        if failure is not None and self._fault is None:
            self._break(failure)
        if self._fault is not None and self._untold:
            self._untold = False
            raise self._fault from failure

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(self, _kind: object, error: object, _trace: object) -> None:
        self.close(in_order=error is None)

    def _append(
        self, source: int, kind: int, host_ns: int, data: bytes | memoryview, payload_crc: int, span_us: int
    ) -> int:
        """Write one record with its numbers, under the lock; the next segment is begun first if it does not fit."""
        while self._disk.segment.room < HEAD_SIZE + len(data):
            try:
                self._next_segment()
            except OSError as error:
                self._go_on_elsewhere(error)
        now_ns = max(time.monotonic_ns(), self._logged_ns, host_ns)
        wait_us = min(-(-(now_ns - host_ns) // 1000), UNKNOWN)
        counted = self._sources.get(source) or [0, 0]
        number, (source_number, position) = self._number, counted
        try:
            head = pack_head(
                self.log_id, self._seed, len(data), source, kind, span_us, wait_us,
                source_number, number, position, host_ns, payload_crc,
            )  # fmt: skip
        except struct.error as error:
            raise ValueError(f"source {source!r}, kind {kind!r} or host_ns {host_ns!r} does not fit") from error
        self._number = number + 1
        counted[0], counted[1] = source_number + 1, position + len(data)
        self._sources[source] = counted
        self._logged_ns = now_ns
        reach_us = wait_us + (0 if span_us == UNKNOWN else span_us)
        if wait_us == UNKNOWN:
            self._longest_us = None
        elif self._longest_us is not None:
            self._longest_us = max(self._longest_us, reach_us)
        try:
            self._disk.write(number, head, data)
        except OSError as error:
            self._go_on_elsewhere(error)
        segment = self._disk.segment
        spans = segment.spans
        for key, counter in ((source, source_number), (WHOLE, number)):
            span = spans.get(key)
            if span is None:
                spans[key] = [counter, counter, len(data)]
            else:
                span[1] = counter
                span[2] += len(data)
        if kind in _OF_THE_LOG:
            segment.count += 1
        else:
            segment.note(host_ns if span_us == UNKNOWN else host_ns - 1000 * span_us, host_ns)
        self._records += 1
        self._bytes += HEAD_SIZE + len(data)
        if self._unsynced_since is None:
            self._unsynced_since = time.monotonic()
        if kind in _AT_ONCE:
            self._sync_wanted.set()
        return number

    def _sync(self) -> None:
        with self._sync_turn:
            with self._lock:
                if self._closed or self._unsynced_since is None:
                    return
                self._refuse_if(self._fault if self._in_doubt else None)
                self._syncing_since, self._unsynced_since = self._unsynced_since, None
                current, until = self._disk.segment, self._number
            try:
                self._disk.written.sync(current)
            except OSError as error:
                self._in_doubt = True
                with self._lock:
                    self._unsynced_since = self._syncing_since
                    self._go_on_elsewhere(error)
                    current, until = self._disk.segment, self._number
                try:
                    self._disk.written.sync(current)
                except OSError as again:
                    raise self._break(again) from again
                self._in_doubt = False
            finally:
                self._syncing_since = None
            with self._lock:
                self._disk.unsynced.forget(until)

    def _say(self, kind: Kind, host_ns: int, payload: bytes) -> None:
        self._append(OWN, kind, host_ns, payload, zlib.crc32(payload, self._seed), UNKNOWN)

    def _begin(self) -> None:
        """Begin the first segment: what it says of the session stands there twice, the second time in other pages.

        A disk that loses a page, or a first one that was never written, then leaves one of them.
        """
        segment = self._disk.segment
        end = sum(HEAD_SIZE + len(payload) for payload in self._session.payloads(self._longest_us))
        filling = -end % PAGE_BYTES
        self._say_session(filling if filling <= segment.size // _SESSION_SHARE else 0)
        self._say_session()
        try:
            self._disk.written.sync(self._disk.segment)
        except OSError as error:
            raise self._break(error) from error
        self._begun = True

    def _say_session(self, filling: int = 0) -> None:
        for payload in self._session.payloads(self._longest_us, filling):
            self._say(Kind.SESSION, time.monotonic_ns(), payload)
        self._say_clock()

    def _say_clock(self) -> None:
        clock = anchor()
        self._say(Kind.CLOCK, clock.monotonic_ns, pack_json(asdict(clock)))
        self._clock_s = time.monotonic()

    def _end(self) -> None:
        """Say the totals twice; of several segments in the last two, so that whichever is missing is missed."""
        totals = {str(source): counted for source, counted in self._sources.items() if source != OWN}
        payload = pack_json({"sources": totals, "longest_us": self._longest_us})
        self._say(Kind.CLOSED, time.monotonic_ns(), payload)
        if self._disk.written.count:
            with contextlib.suppress(OSError):  # without room for another one, both stand in this one
                self._next_segment()
        self._say(Kind.CLOSED, time.monotonic_ns(), payload)

    def _next_segment(self) -> None:
        self._disk.next_segment()
        self._space_wanted.set()
        self._say_session()

    def _go_on_elsewhere(self, error: OSError) -> None:
        """Go on in the spare folder with all that may not be on the disk.

        Raises
        ------
        StoreError
            If there is none, or it fails too, or the log has not begun: it is refused then.
        """
        if not self._begun:
            raise self._break(error) from error
        try:
            self._disk.go_on_elsewhere(error)
            self._space_wanted.set()
            self._say_session()
        except OSError as again:
            raise self._break(again) from again

    def _break(self, error: OSError) -> StoreError:
        fault = StoreError(
            f"the log cannot be written: {error.strerror or error}",
            path=self._disk.folder,
            remedy="what was written before is intact; make room or change the disk, then start a new recording",
        )
        if self._fault is None:
            self._untold, self._fault = True, fault
        return fault

    def _refuse_if(self, fault: StoreError | None) -> None:
        if fault is not None:
            raise StoreError(fault.problem, path=self.folder, remedy=fault.remedy) from fault

    def _keep_synced(self, interval_s: float) -> None:
        wait_s = interval_s
        while not self._stop.is_set():
            self._sync_wanted.wait(wait_s)
            self._sync_wanted.clear()
            started = time.monotonic()
            # The fault is kept: the next call raises it
            with contextlib.suppress(StoreError):
                if self._fault is None and started - self._clock_s >= CLOCK_EVERY_S:
                    with self._lock:
                        self._say_clock()
                self._sync()
            wait_s = max(0.0, interval_s - (time.monotonic() - started))

    def _keep_reserved(self, interval_s: float) -> None:
        while not self._stop.is_set():
            self._space_wanted.wait(interval_s)
            self._space_wanted.clear()
            # The append that needs a segment tries again, and its error is the one that counts
            with contextlib.suppress(OSError):
                self._disk.top_up()


def _flat(payload: bytearray | memoryview) -> memoryview:
    view = memoryview(payload)
    if not view.c_contiguous:
        raise ValueError("the payload must be contiguous")
    return view.cast("B") if view.nbytes else memoryview(b"")
