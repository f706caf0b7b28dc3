"""The folder of one shot's reports: what is written into it appears whole or not at all.

A report is made in a hidden folder beside its place. Where one stands there already, that one is moved into the hidden
folder, the new one takes its place, and then the hidden folder goes. Whatever ends the program between two of these
steps, one whole report is in its place or in the hidden folder, from which the next run brings it back. What the new
one replaces is listed there before anything moves: it is not brought back beside the new one.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path, PureWindowsPath

from recoil_acquisition.errors import StoreError
from recoil_acquisition.files.new_file import partial_path, partials_of, sync_file, sync_folder
from recoil_acquisition.log.segment import FolderLock, is_being_written
from recoil_identification.report.page.html import PAGE_NAME

_NEW, _OLD, _REPLACED = "new", "old", "replaced.json"


def refuse_existing(folder: Path, names: Sequence[str]) -> None:
    """Refuse a folder that holds any of some files; what an interrupted run left of it is put in order before.

    Raises
    ------
    StoreError
        Naming the first of them.
    """
    _put_in_order(_real(folder))
    for name in names:
        if (folder / name).exists():
            raise StoreError.exists(folder / name, "give another --out, or --overwrite", "the report")


def refuse_unwritable(folder: Path) -> None:
    """Refuse a folder that cannot be made or written into, before the work that it is for.

    Raises
    ------
    StoreError
        Naming where it would stand.
    """
    nearest = next(place for place in (folder.absolute(), *folder.absolute().parents) if place.exists())
    reason = "Not a directory"
    if nearest.is_dir():
        if os.access(nearest, os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids):
            return
        reason = "Permission denied"
    raise StoreError(f"cannot write here: {reason}", path=folder.parent, remedy="choose --out")


def publish(folder: Path, write: Callable[[Path], None], obsolete: Sequence[str] = ()) -> None:
    """Let files be written beside their place, then put them there together.

    Parameters
    ----------
    folder
        Folder of the report; made if it is not there. In one that is, only the files that are written are replaced: it
        may hold somebody's notes.
    write
        Function that is given an empty folder, and writes the files into it.
    obsolete
        Paths in the folder of files that go with the ones that are replaced: they would tell of an older report.

    Raises
    ------
    StoreError
        If it cannot be written; what was there is there still.
    """
    folder = _real(folder)
    new_parents = [place for place in folder.parents if not place.exists()]
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        _put_in_order(folder)
        hidden = partial_path(folder)
        hidden.mkdir()
    except OSError as error:
        raise StoreError(f"cannot write here: {error.strerror}", path=folder.parent, remedy="choose --out") from error
    try:
        # says to other runs that this folder is none that was left over
        lock = FolderLock(hidden)
        try:
            (hidden / _NEW).mkdir()
            write(hidden / _NEW)
            _exchange(folder, hidden, {Path(name) for name in obsolete})
        finally:
            lock.release()
            _settle(folder, hidden)
            if not folder.exists():
                for place in new_parents:
                    with contextlib.suppress(OSError):
                        place.rmdir()  # refused where it holds something
    except StoreError as error:
        # nobody asked for the hidden folder
        if error.path is not None and error.path.is_relative_to(hidden):
            error.path = folder
        raise
    except OSError as error:
        raise StoreError(
            f"cannot be written: {error.strerror or error}",
            path=folder,
            remedy="check space and permissions, and close its files in other programs",
        ) from error


def way_to_page(home: Path, folder: Path, name: str = PAGE_NAME) -> str | None:
    """Return the way from a folder to the page in another, with slashes; None where there is no page, or no way."""
    if not (folder / name).exists():
        return None
    try:
        return Path(os.path.relpath(folder / name, home)).as_posix()
    except ValueError:  # another drive
        return None


def way_inside(home: Path, way: object, root: Path) -> Path | None:
    """Return where a way leads that somebody's document states; None where it is none, or leads out of a folder.

    Nothing is looked for on the disk before the way is known to be relative: a name of another computer would be asked.

    Parameters
    ----------
    home
        Folder of the document, from which the way goes.
    root
        Folder beyond which nothing is opened.
    """
    if not isinstance(way, str) or "\0" in way or "\\" in way or PureWindowsPath(way).anchor or way.startswith("/"):
        return None
    place = Path(os.path.realpath(home / way))
    return place if place.is_relative_to(os.path.realpath(root)) else None


def _exchange(folder: Path, hidden: Path, obsolete: set[Path]) -> None:
    """Put the new report into its place, and the one that is there into the hidden folder."""
    new = hidden / _NEW
    files = [file for file in new.rglob("*") if file.is_file()]
    for file in files:
        sync_file(file)
    if folder.exists():
        gone = obsolete | {file.relative_to(new) for file in files}

        def replaced(at: str, names: list[str]) -> set[str]:
            inside = Path(at).relative_to(folder)
            return {name for name in names if inside / name in gone}

        # what else is there comes along before anything moves, so that no interruption hides it
        shutil.copytree(folder, new, symlinks=True, ignore=replaced, copy_function=_link, dirs_exist_ok=True)
        (hidden / _REPLACED).write_text(json.dumps(sorted(map(str, gone))), encoding="utf-8", newline="\n")
        sync_file(hidden / _REPLACED)
        folder.rename(hidden / _OLD)
    new.rename(folder)
    sync_folder(folder.parent)


def _link(source: str, target: str) -> None:
    """Give a file a second name; copy it where the file system has no such names."""
    try:
        os.link(source, target, follow_symlinks=False)
    except (OSError, NotImplementedError):
        shutil.copy2(source, target, follow_symlinks=False)


def _put_in_order(folder: Path) -> None:
    """Bring back a report that an interrupted run had moved away, and remove what it left over."""
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        for hidden in partials_of(folder):
            if not is_being_written(hidden):
                _settle(folder, hidden)


def _settle(folder: Path, hidden: Path) -> None:
    """Remove a hidden folder; nothing goes with it that is not in the report's folder, except what was replaced."""
    old, replaced = hidden / _OLD, set()
    if old.exists() and not folder.exists():
        old.rename(folder)
    elif not (hidden / _NEW).exists() and (hidden / _REPLACED).exists():
        replaced = {old / name for name in json.loads((hidden / _REPLACED).read_text("utf-8"))}
    for file in sorted(old.rglob("*")) if old.exists() else ():
        place = folder / file.relative_to(old)
        if not file.is_dir() and file not in replaced and not os.path.lexists(place):
            # came while the folders changed places
            place.parent.mkdir(parents=True, exist_ok=True)
            file.rename(place)
    shutil.rmtree(old, ignore_errors=True)
    if not old.exists():
        # the list goes last: it says what of the older report is not to be brought back
        shutil.rmtree(hidden, ignore_errors=True)


def _real(folder: Path) -> Path:
    """Follow a link: the folder that it names is the one to be exchanged, not the link."""
    return Path(os.path.realpath(folder))
