"""The folder that a live session writes to: to nobody else meanwhile, and only while it is where it was."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from recoil_acquisition.errors import StoreError, quoted
from recoil_acquisition.files.file_lock import LockTakenError
from recoil_acquisition.files.new_file import remove_left_partials
from recoil_acquisition.files.temporary_folder import LEFT_AFTER_S
from recoil_acquisition.log.segment import LOCK_NAME, FolderLock


class OutputFolder:
    """Locks the folder of shots, and notices when it is gone. A process that dies gives the lock back.

    Parameters
    ----------
    path
        Folder of the shot files; made if it is missing, and removed at the end if nothing came into it.

    Raises
    ------
    StoreError
        If another session has it, or it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.moved_to: Path | None = None
        journals = path / "journal"
        self._made = [folder for folder in (journals, *journals.parents) if not folder.exists()]
        try:
            journals.mkdir(parents=True, exist_ok=True)
            self._lock = FolderLock(journals)
            self._watched = journals / LOCK_NAME
            self._descriptor = os.open(self._watched, os.O_RDONLY)
        except LockTakenError as error:
            raise StoreError(
                "another live session writes to this folder",
                path=path,
                found=error.holder,
                remedy="end that one first, or give this one a folder of its own with --out",
            ) from error
        except OSError as error:
            raise StoreError(f"cannot be written: {error.strerror or error}", path=path, expected="a folder") from error
        self._is = os.fstat(self._descriptor)
        for folder in (path, path / "captures"):  # of processes that were killed
            remove_left_partials(folder, idle_s=LEFT_AFTER_S)

    def __enter__(self) -> OutputFolder:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):
            os.close(self._descriptor)
        with contextlib.suppress(OSError):
            self._lock.release()
        with contextlib.suppress(OSError):  # the first that holds something stays, and so do those round it
            for folder in self._made:
                folder.rmdir()

    def fault(self, journal: Path) -> StoreError | None:
        """Return what became of the folder, or of the session's journal in it, if it is not where it was.

        Parameters
        ----------
        journal
            Folder of the session's journal.
        """
        try:
            found = self._watched.stat()
            there = (found.st_dev, found.st_ino) == (self._is.st_dev, self._is.st_ino)
            if there and journal.is_dir():
                return None
        except FileNotFoundError:
            there = False
        except OSError as error:
            return StoreError(
                f"the output folder cannot be reached: {error.strerror or error}; what is recorded is in no file",
                path=self.path,
                remedy="mount it again, and `recoil-daq recover` it: the journal up to now may still be there",
            )
        if there:
            return StoreError(
                "the session's journal was deleted or moved away: what it held of shots without captures is NOT kept",
                path=journal,
                remedy="arm again; leave the folder `journal` alone while a session runs",
            )
        if os.fstat(self._descriptor).st_nlink == 0:
            return StoreError(
                "the output folder was deleted while armed: shot files, captures and the journal in it are NOT kept",
                path=self.path,
                remedy="arm again with a folder that stays",
            )
        self.moved_to = self._place_now()
        where = "elsewhere" if self.moved_to is None else f"to {self.moved_to}"
        recover = f"recoil-daq recover {quoted(self.moved_to or 'FOLDER')}"
        return StoreError(
            f"the output folder was moved {where} while armed: what was recorded until then went with it",
            path=self.path,
            remedy=f"`{recover}`, and arm again",
        )

    def _place_now(self) -> Path | None:
        """Return where the folder is now, where the system says."""
        try:
            place = Path(f"/proc/self/fd/{self._descriptor}").readlink().parent.parent
        except OSError:
            return None
        return place if place.is_dir() else None
