"""Where the records of a log go: into one segment after the other, and on in a spare folder where the disk fails."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from recoil_acquisition.log.reserve import SegmentReserve
from recoil_acquisition.log.segment import WritingSegment
from recoil_acquisition.log.sync import SegmentSync
from recoil_acquisition.log.unsynced import UnsyncedRecords
from recoil_acquisition.new_file import sync_folder


class LogDisk:
    """The segments of a log and the space that is reserved for more.

    Parameters
    ----------
    folder, reserve_bytes, spare, segment_bytes
        As of `recoil_acquisition.log.writer.LogWriter`.

    Attributes
    ----------
    segment
        The one that is written.
    spared
        Why it goes on in the spare folder; empty if it does not.

    Raises
    ------
    StoreError
        If a folder holds a log, cannot be written, or its disk has not enough room. Nothing is left then.
    """

    def __init__(self, folder: Path, reserve_bytes: int, spare: Path | None, segment_bytes: int) -> None:
        self._folder, self._spare = folder, spare
        self.spared = ""
        self._written = SegmentSync()
        self._unsynced = UnsyncedRecords()
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

    @property
    def full_segments(self) -> int:
        """Number of segments before the one that is written."""
        return self._written.count

    def write(self, number: int, head: bytes, data: bytes | memoryview) -> None:
        """Write a record, for which there must be room; OSError if the disk fails."""
        if self._spare_reserve is not None:
            self._unsynced.keep(number, head, data)
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
        self._written.retire(full)

    def top_up(self) -> None:
        """Reserve as much as at first; OSError if that cannot be done."""
        self._reserve.top_up(self._written.count + 1)

    def sync(self, segment: WritingSegment) -> None:
        """Force a segment, which is written or was a moment ago, and all before it to the disk; raises OSError."""
        self._written.sync(segment)

    def synced(self, until: int) -> None:
        """Let go of the records before a number: they are on the disk."""
        self._unsynced.forget(until)

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
        waiting = self._unsynced.take_all()
        self._written.abandon()
        given_up.abandon()
        self.segment = self._reserve.take()
        for head, data in waiting:
            if self.segment.room < len(head) + len(data):
                self.next_segment()
            self.segment.write(head, data)
            self.segment.note(-(1 << 63), (1 << 63) - 1)  # never released

    def releasable(self, before_ns: int, kept: Sequence[tuple[int, int]]) -> list[WritingSegment]:
        """Return the closed segments of which all arrived before a time and nothing within a span that is kept."""
        return self._written.releasable(before_ns, kept)

    def remove(self, segments: Sequence[WritingSegment]) -> None:
        """Remove some of the segments that `releasable` returned; StoreError if the system refuses."""
        self._written.remove(segments)

    def close(self) -> OSError | None:
        """Force everything to the disk and give back the space that was not used; return the first failure."""
        self._written.retire(self.segment)
        failure = self._written.finish()
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
