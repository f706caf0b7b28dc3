"""The space that a log has reserved: segments that are made before they are needed."""

from __future__ import annotations

import errno
import shutil
import threading
from collections import deque
from pathlib import Path

from recoil_acquisition.errors import StoreError
from recoil_acquisition.log.lock import FolderLock
from recoil_acquisition.log.segment import WritingSegment, segment_name, segment_paths
from recoil_acquisition.new_file import sync_folder


class SegmentReserve:
    """A log's folder, its lock, and its segments that hold no record yet.

    Parameters
    ----------
    folder
        A folder without a log; made if it is missing.
    reserve_bytes
        Rounded up to whole segments, one at least.

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
    if isinstance(error, BlockingIOError):
        return StoreError("another recording writes here", path=folder, remedy="close it, or choose another folder")
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
