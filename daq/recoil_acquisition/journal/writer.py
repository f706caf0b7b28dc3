"""The journal: everything that arrives is written here first, and survives a crash.

A journal is a folder of segment files with records of length, source, host time and CRC; the bytes
are described in `journal.layout`. It is only ever appended to. A process that is killed loses nothing
that `JournalWriter.append` took; a loss of power loses at most what came after the last synchronisation. It is
read back with `read_journal` and removed once the shot file that was made of it is verified.
"""

from __future__ import annotations

import contextlib
import json
import secrets
import struct
import threading
import time
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from recoil_acquisition.errors import StoreError
from recoil_acquisition.journal.layout import (
    CRC,
    LONGEST_PAYLOAD,
    RECORD_HEAD,
    RECORD_OVERHEAD,
    RELEASED,
    SUFFIX,
    UNKNOWN_SPAN,
    crc_seed,
    pack_header,
)
from recoil_acquisition.journal.records import JournalCounters
from recoil_acquisition.log.reserve import SegmentReserve
from recoil_acquisition.log.segment import sync_folder
from recoil_acquisition.log.sync import SegmentSync

__all__ = ["SEGMENT_BYTES", "JournalWriter"]

SEGMENT_BYTES = 64 << 20
"""Size of a segment unless told otherwise."""

_LONGEST_SYNC_INTERVAL_S = 0.25


class JournalWriter:
    """A journal that is written; safe to append to from several threads.

    Making it reserves the space. It is forced to the disk in the background, and as segments are
    released or used up new ones are reserved there too, so that the reserved space stays as large.

    Parameters
    ----------
    folder : Path
        A folder without a journal; made if it is missing.
    session : mapping
        What the records cannot say: sources by number, the rig's text, a pair of wall-clock and monotonic
        time. JSON types. It stands in every segment.
    reserve_bytes : int
        Space to reserve; rounded up to whole segments.
    segment_bytes : int
        Size of a segment; a record must fit into one.
    sync_interval_s : float
        Time between two synchronisations, at most 0.25 s.

    Raises
    ------
    StoreError
        If the folder holds a journal, cannot be written, or its disk has not enough room. Nothing is left then.
    ValueError, TypeError
        If a number is out of its range, or `session` is not JSON.
    """

    def __init__(
        self,
        folder: Path,
        session: Mapping[str, Any],
        reserve_bytes: int,
        *,
        segment_bytes: int = SEGMENT_BYTES,
        sync_interval_s: float = 0.2,
    ) -> None:
        if not 0 < sync_interval_s <= _LONGEST_SYNC_INTERVAL_S:
            raise ValueError(f"sync_interval_s must be above 0 and at most 0.25, not {sync_interval_s!r}")
        if reserve_bytes < 0:
            raise ValueError(f"reserve_bytes must not be negative, not {reserve_bytes!r}")
        session_id = secrets.token_bytes(8)
        header = pack_header(session_id, json.dumps(dict(session), allow_nan=False).encode())
        if segment_bytes < len(header) + RECORD_OVERHEAD + 1:
            raise ValueError(f"segment_bytes {segment_bytes!r} does not hold the header of {len(header)} bytes")
        self.folder = Path(folder)
        self._session_id = session_id
        self._seed = crc_seed(session_id)
        self._largest_payload = min(segment_bytes - len(header) - RECORD_OVERHEAD, LONGEST_PAYLOAD)
        self._lock = threading.Lock()  # over the order of the records
        self._sync_turn = threading.Lock()  # one synchronisation at a time; taken before the other
        self._written = SegmentSync()
        self._sequence = 0
        self._released: list[tuple[int, int]] = []
        self._records = 0
        self._bytes = 0
        self._unsynced_since: float | None = None
        self._syncing_since: float | None = None
        self._interrupted = False
        self._fault: StoreError | None = None
        self._closed = False
        self._reserve = SegmentReserve(self.folder, segment_bytes, reserve_bytes, suffix=SUFFIX, header=header)
        self._segment = self._reserve.take()
        self._stop = threading.Event()
        self._space_wanted = threading.Event()
        self._threads = (
            threading.Thread(target=self._keep_synced, args=(sync_interval_s,), name="journal sync", daemon=True),
            threading.Thread(target=self._keep_reserved, args=(sync_interval_s,), name="journal space", daemon=True),
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
        source, kind : int
            From 0 to 65535.
        host_ns : int
            Monotonic host time, nanoseconds.
        payload : bytes-like
            Contiguous.
        empty_ns : int or None
            Monotonic host time at which the source was last found empty: what the payload holds arrived after it.

        Returns
        -------
        int
            Sequence number of the record.

        Raises
        ------
        StoreError
            If the record cannot be written, at this or an earlier call; all records before the first error are intact.
        ValueError
            If a number does not fit, the payload does not fit into a segment, or the journal is closed.
        """
        data = payload if isinstance(payload, bytes) else _flat(payload)
        if len(data) > self._largest_payload:
            raise ValueError(f"a payload must not exceed {self._largest_payload} bytes, not {len(data)}")
        needed = RECORD_OVERHEAD + len(data)
        payload_crc = zlib.crc32(data, self._seed)
        span_us = UNKNOWN_SPAN if empty_ns is None else min(-(-(host_ns - empty_ns) // 1000), UNKNOWN_SPAN)
        with self._lock:
            if self._closed:
                raise ValueError("this journal is closed")
            if self._fault is not None:
                raise StoreError(self._fault.problem, path=self.folder, remedy=self._fault.remedy) from self._fault
            sequence = self._sequence
            try:
                head = RECORD_HEAD.pack(self._session_id, len(data), source, kind, span_us, host_ns, sequence)
            except struct.error as error:
                raise ValueError(f"source {source!r}, kind {kind!r} or host_ns {host_ns!r} does not fit") from error
            try:
                self._sequence += 1
                if self._interrupted or self._segment.room < needed:
                    self._next_segment()
                self._segment.write(head + CRC.pack(zlib.crc32(head, payload_crc)), data)
            except OSError as error:
                raise self._break(error) from error
            except BaseException:
                # Ctrl-C in the middle: half a record may be there, and only a new segment is read after it
                self._interrupted = True
                raise
            self._segment.note(sequence, host_ns if span_us == UNKNOWN_SPAN else host_ns - 1000 * span_us, host_ns)
            self._records += 1
            self._bytes += needed
            if self._unsynced_since is None:
                self._unsynced_since = time.monotonic()
        return sequence

    def sync(self) -> None:
        """Force everything that was appended before this call to the disk.

        Raises
        ------
        StoreError
            If the system cannot. The journal takes no more records then: what a failed
            synchronisation left in memory cannot be trusted to be written by a later one.
        """
        with self._sync_turn:
            with self._lock:
                if self._closed or self._unsynced_since is None:
                    return
                self._syncing_since, self._unsynced_since = self._unsynced_since, None
                current = self._segment
            try:
                self._written.sync(current)
            except OSError as error:
                with self._lock:
                    self._unsynced_since = self._syncing_since
                raise self._break(error) from error
            finally:
                self._syncing_since = None

    def release(self, before_ns: int, kept: Sequence[tuple[int, int]] = ()) -> int:
        """Remove the segments of which nobody needs anything, and record that this was on purpose.

        Parameters
        ----------
        before_ns : int
            Host time; what arrived at or after it stays.
        kept : sequence of (start_ns, stop_ns)
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
        segments = self._written.releasable(before_ns, kept)
        if not segments:
            return 0
        for segment in segments:
            if segment.count:
                self._released.append((segment.first_sequence, segment.first_sequence + segment.count - 1))
        self._released = _merged(self._released)
        # listed on the disk first: after a crash what is missing without a list would count as lost
        payload = b"".join(struct.pack("<QQ", *pair) for pair in self._released)
        self.append(RELEASED, 0, time.monotonic_ns(), payload)
        self.sync()
        self._written.remove(segments)
        self._space_wanted.set()
        return sum(segment.count for segment in segments)

    @property
    def counters(self) -> JournalCounters:
        """What the journal has taken so far."""
        with self._lock:
            waiting = [since for since in (self._syncing_since, self._unsynced_since) if since is not None]
            return JournalCounters(
                self._records,
                self._bytes,
                self._segment.room + self._reserve.free_bytes,
                time.monotonic() - min(waiting) if waiting else 0.0,
                self._written.largest_s,
                sum(last - first + 1 for first, last in self._released),
            )

    def close(self) -> None:
        """Force everything to the disk and give back the space that was not used.

        Raises
        ------
        StoreError
            If the system cannot force it to the disk, unless an earlier call has said so. It is closed all the same.
        """
        with self._lock:
            if self._closed:
                return
            self._closed = True
        self._stop.set()
        self._space_wanted.set()
        for thread in self._threads:
            thread.join()
        already_broken = self._fault is not None
        with self._sync_turn:
            self._written.retire(self._segment)
            failure = self._written.finish()
            try:
                self._reserve.close()
                sync_folder(self.folder)
            except OSError as error:
                failure = failure or error
        self._unsynced_since = None
        if failure is not None and not already_broken:
            raise self._break(failure) from failure

    def __enter__(self) -> JournalWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _next_segment(self) -> None:
        full, self._segment = self._segment, self._reserve.take()
        self._written.retire(full)
        self._interrupted = False
        self._space_wanted.set()

    def _break(self, error: OSError) -> StoreError:
        fault = StoreError(
            f"the journal cannot be written: {error.strerror or error}",
            path=self.folder,
            remedy="what was written before is intact; make room or change the disk, then start a new recording",
        )
        if self._fault is None:
            self._fault = fault
        return fault

    def _keep_synced(self, interval_s: float) -> None:
        wait_s = interval_s
        while not self._stop.wait(wait_s):
            started = time.monotonic()
            # The fault is kept: the next append raises it
            with contextlib.suppress(StoreError):
                self.sync()
            wait_s = max(0.0, interval_s - (time.monotonic() - started))

    def _keep_reserved(self, interval_s: float) -> None:
        while not self._stop.is_set():
            self._space_wanted.wait(interval_s)
            self._space_wanted.clear()
            # The append that needs a segment tries again, and its error is the one that counts
            with contextlib.suppress(OSError):
                self._reserve.top_up(self._written.count + 1)


def _merged(spans: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Join spans of sequence numbers that follow one another."""
    joined: list[tuple[int, int]] = []
    for first, last in sorted(spans):
        if joined and joined[-1][1] + 1 == first:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return joined


def _flat(payload: bytearray | memoryview) -> memoryview:
    view = memoryview(payload)
    if not view.c_contiguous:
        raise ValueError("the payload must be contiguous")
    return view.cast("B") if view.nbytes else memoryview(b"")
