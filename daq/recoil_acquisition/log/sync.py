"""Forcing a log's segments to the disk, closing the full ones and removing the old ones."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence

from recoil_acquisition.errors import StoreError, system_errors_as
from recoil_acquisition.log.segment import WritingSegment


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
