"""Where the records of a log go: into one segment after the other, and on in a spare folder where the disk fails.

::

    LogDisk              takes records, into the segment that is written
    +-- SegmentReserve   makes segments before they are needed: the space that is reserved
    +-- SegmentSync      forces segments to the disk, closes the full ones and removes the old ones
    +-- UnsyncedRecords  holds records in memory until they are on the disk, so that they can be written elsewhere
"""

from __future__ import annotations

import contextlib
import errno
import shutil
import threading
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from recoil_acquisition.errors import StoreError, system_errors_as
from recoil_acquisition.files.file_lock import LockTakenError
from recoil_acquisition.files.new_file import sync_folder
from recoil_acquisition.log.segment import FolderLock, WritingSegment, segment_name, segment_paths


class SegmentReserve:
    """A log's folder, its lock, and its segments that hold no record yet.

    Parameters
    ----------
    folder
        A folder without a log; made if it is missing.
    reserve_bytes
        Bytes to reserve, rounded up to whole segments, one at least.

    Raises
    ------
    StoreError
        If the folder holds a log, cannot be written, or its disk has not enough room. Nothing is left then.
    """

    def __init__(self, folder: Path, segment_bytes: int, reserve_bytes: int) -> None:
        self._folder = folder
        self._segment_bytes = segment_bytes
        self._wanted = max(1, -(-reserve_bytes // segment_bytes))
        self._making = threading.Lock()
        self._next_number = 1
        self._spare: deque[WritingSegment] = deque()
        self._made = [path for path in (folder, *folder.parents) if not path.exists()]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = FolderLock(folder)
            try:
                self._arm()
            except BaseException:
                self.close()
                raise
        except OSError as error:
            _remove_empty(self._made)
            raise _refusal(error, folder, self._wanted * segment_bytes) from error
        except BaseException:
            _remove_empty(self._made)
            raise

    def take(self) -> WritingSegment:
        """Return the next segment; it is made now if none is in reserve.

        Raises
        ------
        OSError
            If none is in reserve and none can be made.
        """
        # Numbers are the order of the records, so a segment that is being made elsewhere comes first
        with self._making:
            return self._spare.popleft() if self._spare else self._make()

    def top_up(self, in_use: int) -> None:
        """Make segments until those in use and in reserve are as many as at first, and one is in reserve.

        Raises
        ------
        OSError
            If one cannot be made; nothing is left of that one.
        """
        while len(self._spare) < max(1, self._wanted - in_use):
            with self._making:
                self._spare.append(self._make())

    @property
    def free_bytes(self) -> int:
        """Space for records in the segments that are in reserve."""
        return len(self._spare) * self._segment_bytes

    def close(self) -> None:
        """Give the space back and let go of the folder.

        Raises
        ------
        OSError
            If the system refuses to remove a file; the lock is released all the same.
        """
        try:
            with self._making:
                while self._spare:
                    self._spare.popleft().discard()
        finally:
            self._lock.release()

    def undo(self) -> None:
        """Give the space back, let go of the folder, and remove it with those above it if they were made for it."""
        self.close()
        _remove_empty(self._made)

    def _arm(self) -> None:
        needed = self._wanted * self._segment_bytes
        if segment_paths(self._folder):
            raise StoreError(
                "holds a log already",
                path=self._folder,
                remedy="recover what is in it with `recoil-daq recover`, or choose another folder",
            )
        # The system's own call would say so too, but only after it has filled the disk on some systems
        if (free := shutil.disk_usage(self._folder).free) < needed:
            raise _too_little_room(self._folder, needed, free)
        self.top_up(0)

    def _make(self) -> WritingSegment:
        path = self._folder / segment_name(self._next_number)
        segment = WritingSegment(path, self._segment_bytes)
        self._next_number += 1
        sync_folder(self._folder)
        return segment


def _too_little_room(folder: Path, needed: int, free: int | None) -> StoreError:
    return StoreError(
        "the disk has not enough room for the log",
        path=folder,
        expected=f"{needed / 1e6:.1f} MB",
        found="less" if free is None else f"{free / 1e6:.1f} MB free",
        remedy="make room, or choose a folder on another disk",
    )


def _refusal(error: OSError, folder: Path, needed: int) -> StoreError:
    if isinstance(error, LockTakenError):
        return StoreError(
            "another recording writes here", path=folder, found=error.holder,
            remedy="close it, or choose another folder",
        )  # fmt: skip
    if error.errno in (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EFBIG):
        return _too_little_room(folder, needed, None)
    return StoreError(f"cannot be written: {error.strerror or error}", path=folder, remedy="choose another folder")


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            # Somebody else put something into it meanwhile, or it was never made
            return


class SegmentSync:
    """The segments of a log that hold records, apart from the one that is written."""

    def __init__(self) -> None:
        self._lock = threading.Lock()  # nothing is closed or removed while it is forced to the disk
        self._full: deque[WritingSegment] = deque()
        self._finished: deque[WritingSegment] = deque()

    @property
    def count(self) -> int:
        """Number of segments."""
        return len(self._full) + len(self._finished)

    def retire(self, segment: WritingSegment) -> None:
        """Take over a segment that is full; it is closed when it is next forced to the disk."""
        self._full.append(segment)

    def sync(self, current: WritingSegment) -> None:
        """Force the segment that is written, or was a moment ago, and all retired ones to the disk.

        Raises
        ------
        OSError
            If the system cannot.
        """
        with self._lock:
            # In this order: it may be among the retired by now, which are closed here
            current.sync()
            self._finish_full()

    def finish(self) -> OSError | None:
        """Force all retired segments to the disk and close them, whatever fails; return the first failure."""
        first: OSError | None = None
        with self._lock:
            while self._full:
                try:
                    self._finish_full()
                except OSError as error:
                    first = first or error
        return first

    def abandon(self) -> None:
        """Close the retired segments as they are: the disk refuses them, and what they hold is written elsewhere."""
        with self._lock:
            while self._full:
                self._full.popleft().abandon()

    def releasable(self, before_ns: int, kept: Sequence[tuple[int, int]]) -> list[WritingSegment]:
        """Return the closed segments of which all arrived before a time and nothing within a span that is kept."""
        with self._lock:
            return [
                segment
                for segment in self._finished
                if segment.newest_ns < before_ns
                and not any(segment.oldest_ns < stop_ns and segment.newest_ns >= start_ns for start_ns, stop_ns in kept)
            ]

    def remove(self, segments: Sequence[WritingSegment]) -> None:
        """Remove some of the segments that `releasable` returned.

        Raises
        ------
        StoreError
            If the system refuses.
        """
        with self._lock:
            for segment in segments:
                with system_errors_as(StoreError, segment.path, "removed"):
                    segment.path.unlink(missing_ok=True)
                self._finished.remove(segment)

    def _finish_full(self) -> None:
        while self._full:
            segment = self._full.popleft()
            self._finished.append(segment)
            segment.finish()


KEPT_BYTES = 64 << 20
"""Most bytes that are held; beyond them the oldest go."""


class UnsyncedRecords:
    """The records that may not be on the disk yet, in the order of their numbers."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, bytes, bytes]] = deque()
        self._bytes = 0

    def keep(self, number: int, head: bytes, data: bytes | memoryview) -> None:
        """Hold a record."""
        self._kept.append((number, head, bytes(data)))
        self._bytes += len(head) + len(data)
        while self._bytes > KEPT_BYTES:
            self._forget_first()

    def forget(self, until: int) -> None:
        """Let go of the records before a number: they are on the disk."""
        while self._kept and self._kept[0][0] < until:
            self._forget_first()

    def take_all(self) -> list[tuple[bytes, bytes]]:
        """Return heads and payloads of all of them, and hold none any more."""
        taken = [(head, data) for _, head, data in self._kept]
        self._kept.clear()
        self._bytes = 0
        return taken

    def _forget_first(self) -> None:
        _, head, data = self._kept.popleft()
        self._bytes -= len(head) + len(data)


class LogDisk:
    """The segments of a log and the space that is reserved for more.

    Parameters
    ----------
    folder, reserve_bytes, spare, segment_bytes
        Parameters of `recoil_acquisition.log.writer.LogWriter`.

    Attributes
    ----------
    segment
        Segment that is written.
    written, unsynced
        Segments before that one; records that may not be on the disk yet.
    spared
        Reason why the log goes on in the spare folder; empty if it does not.

    Raises
    ------
    StoreError
        If a folder holds a log, cannot be written, or its disk has not enough room. Nothing is left then.
    """

    def __init__(self, folder: Path, reserve_bytes: int, spare: Path | None, segment_bytes: int) -> None:
        self._folder, self._spare = folder, spare
        self.spared = ""
        self.written = SegmentSync()
        self.unsynced = UnsyncedRecords()
        self._reserve = SegmentReserve(folder, segment_bytes, reserve_bytes)
        self._spare_reserve: SegmentReserve | None = None
        try:
            if spare is not None:
                self._spare_reserve = SegmentReserve(spare, segment_bytes, segment_bytes)
            self.segment = self._reserve.take()
        except BaseException:
            self._give_back()
            raise

    @property
    def folder(self) -> Path:
        """The folder that is written to."""
        return self._spare if self.spared and self._spare is not None else self._folder

    @property
    def free_bytes(self) -> int:
        """Space that is reserved and not yet used."""
        return self.segment.room + self._reserve.free_bytes

    def write(self, number: int, head: bytes, data: bytes | memoryview) -> None:
        """Write a record, for which there must be room; OSError if the disk fails."""
        if self._spare_reserve is not None:
            self.unsynced.keep(number, head, data)
        try:
            self.segment.write(head, data)
        except OSError:
            raise
        except BaseException:
            # Ctrl-C in the middle: half a record may be there, and is skipped when it is read
            self.segment.settle()
            raise

    def next_segment(self) -> None:
        """Go on in another segment; OSError if there is none and none can be made."""
        full, self.segment = self.segment, self._reserve.take()
        self.written.retire(full)

    def top_up(self) -> None:
        """Reserve as much as at first; OSError if that cannot be done."""
        self._reserve.top_up(self.written.count + 1)

    def go_on_elsewhere(self, error: OSError) -> None:
        """Go on in the spare folder with all that may not be on the disk.

        Raises
        ------
        OSError
            The error given, if there is no spare folder, or it is the one that failed; or that of the spare folder.
        """
        if self._spare_reserve is None or self.spared:
            raise error
        self.spared = str(error.strerror or error)
        given_up, first = self.segment, self._reserve
        self._reserve, self._spare_reserve = self._spare_reserve, first
        waiting = self.unsynced.take_all()
        self.written.abandon()
        given_up.abandon()
        self.segment = self._reserve.take()
        for head, data in waiting:
            if self.segment.room < len(head) + len(data):
                self.next_segment()
            self.segment.write(head, data)
            self.segment.note(-(1 << 63), (1 << 63) - 1)  # never released

    def close(self) -> OSError | None:
        """Force everything to the disk and give back the space that was not used; return the first failure."""
        self.written.retire(self.segment)
        failure = self.written.finish()
        try:
            if self._spare_reserve is not None:
                with contextlib.suppress(OSError):  # that of a folder that was given up
                    self._spare_reserve.undo()
            self._reserve.close()
            sync_folder(self.folder)
        except OSError as error:
            failure = failure or error
        return failure

    def undo(self) -> None:
        """Leave nothing of what could not be begun."""
        self.segment.discard()
        self._give_back()

    def _give_back(self) -> None:
        for reserve in (self._reserve, self._spare_reserve):
            if reserve is not None:
                reserve.undo()
