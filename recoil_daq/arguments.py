"""Names on a command line: of a shot its file or its own, and one thing in another's place."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path

from recoil_acquisition.errors import ReadError, RecoilDaqError, nearest_first
from recoil_acquisition.files.regular_file import check_regular, read_beginning
from recoil_acquisition.store import is_shot_file
from recoil_acquisition.store.shot_log import SHOT_LOG, meant_shot, shots_beside

SHOTS, REPORTS = "shots", "reports"
"""Usual folders of shot files, and of their reports."""
SUFFIX = ".h5"
_DATABASES = frozenset({".dbc", ".arxml", ".kcd", ".sym"})
_HEAD_BYTES = 4096


class FileKind(StrEnum):
    """Kind of a file or a folder; the value is what it is called."""

    FOLDER = "a folder"
    RIG = "a rig file"
    SHOT = "a shot file"
    REPORT = "a report"
    CAMPAIGN = "the answer of a campaign"
    LOG = "a shot log"
    DATABASE = "a CAN database"
    RECORDING = "an instrument's file"
    OTHER = "another file"


_GOES = {
    FileKind.FOLDER: "name the files in it; `ingest` takes one folder of many shots' files with --batch",
    FileKind.RIG: "a rig comes first, or behind --rig; `init` takes one behind --from",
    FileKind.SHOT: "`recoil-daq identify SHOTS...` takes it",
    FileKind.REPORT: "`recoil-daq explain REPORT` takes it",
    FileKind.CAMPAIGN: "it is made of shots: name these",
    FileKind.LOG: "it is read where it stands, beside the shot files",
    FileKind.DATABASE: "name it in the rig file, as `database` of its source",
    FileKind.RECORDING: "`recoil-daq ingest RIG FILES...` makes a shot file of it",
}
"""Command to which each kind of file belongs."""


def kind_of(path: Path) -> tuple[FileKind, str]:
    """Return what a path is, and which instrument's; ReadError if there is nothing, or no file that can be read."""
    if path.is_dir():
        return FileKind.FOLDER, ""
    check_regular(path)
    suffix, head = path.suffix.lower(), read_beginning(path, _HEAD_BYTES)
    if suffix == ".toml":
        return FileKind.RIG, ""
    if suffix in _DATABASES:
        return FileKind.DATABASE, ""
    if path.name == SHOT_LOG:
        return FileKind.LOG, ""
    for kind, schema in ((FileKind.REPORT, b"recoil-daq/report/"), (FileKind.CAMPAIGN, b"recoil-daq/campaign/")):
        if head.lstrip().startswith(b"{") and schema in head:
            return kind, ""
    if is_shot_file(path):
        return FileKind.SHOT, ""
    from recoil_acquisition.readers.table import recognise

    try:
        return FileKind.RECORDING, recognise(path).name
    except RecoilDaqError:
        return FileKind.OTHER, ""


def refuse_no_rig(word: str, order: str) -> None:
    """Refuse what is something else in the place of a rig.

    Parameters
    ----------
    order
        Way in which the command is called, for the message.

    Raises
    ------
    ReadError
        If it is known to be something else; what a rig file lacks is told when it is read.
    """
    path = Path(word)
    if not word or (path.suffix.lower() == ".toml" and not path.is_dir()):
        return
    if not (path.is_dir() or path.is_file()):
        return
    kind, maker = kind_of(path)
    if kind not in (FileKind.RIG, FileKind.OTHER):
        raise _misplaced(path, kind, maker, "a rig file (TOML) or the name of a bundled rig", f"the order is `{order}`")


def refuse_no_recordings(files: Sequence[Path], order: str) -> None:
    """Refuse rigs, shot files and folders in the place of instruments' files; as `refuse_no_rig`."""
    for path in files:
        kind = _other_than_recorded(path)
        if kind is not None:
            raise _no_recording(path, kind, order)


def shot_file_error(path: Path, order: str) -> ReadError | None:
    """Return the error of a shot file in the place of an instrument's file, which no rig is drafted from; else None.

    Raises
    ------
    ReadError
        If it is a rig or a folder.
    """
    kind = _other_than_recorded(path)
    if kind is None:
        return None
    error = _no_recording(path, kind, order)
    if kind is FileKind.SHOT:
        return error
    raise error


def _other_than_recorded(path: Path) -> FileKind | None:
    if not (path.is_dir() or path.is_file()):
        return None
    if path.is_dir():
        return FileKind.FOLDER
    if path.suffix.lower() == ".toml":
        return FileKind.RIG
    return FileKind.SHOT if path.suffix == SUFFIX and is_shot_file(path) else None


def _no_recording(path: Path, kind: FileKind, order: str) -> ReadError:
    return _misplaced(path, kind, "", "an instrument's file", f"{_GOES[kind]}; the order is `{order}`")


def named_shot(path: Path) -> Path:
    """Return the shot file that is meant: by its path, or by its shot's name, here or in the folder ``shots``.

    Raises
    ------
    ReadError
        If there is none, or what is there is known to be something else.
    """
    if path.exists():
        if path.is_file() and path.suffix != SUFFIX:
            kind, maker = kind_of(path)
            if kind not in (FileKind.SHOT, FileKind.OTHER):
                raise _misplaced(path, kind, maker, "a shot file", _GOES[kind])
        return path
    known: list[str] = []
    for folder in (path.parent, path.parent / SHOTS) if path.parent == Path() else (path.parent,):
        shots = shots_beside(folder / SHOT_LOG)
        known += sorted(shots)
        name = path.stem if path.suffix == SUFFIX else path.name
        if (meant := meant_shot(name, shots)) in shots:
            return folder / f"{meant}{SUFFIX}"
    raise ReadError(
        "no such file, and no shot of this name", path=path,
        found=", ".join(nearest_first(path.stem, known)[:8]) or None, remedy="check the name and the folder",
    )  # fmt: skip


def named_report(path: Path) -> Path:
    """Return the report that is meant: by its path, or by its shot's name, in the folder ``reports``."""
    if path.exists() or path.parent != Path():
        return path
    there = {one.name for one in Path(REPORTS).glob("*") if one.is_dir()}
    meant = meant_shot(path.name, there)
    return Path(REPORTS) / meant if meant in there else path


def _misplaced(path: Path, kind: FileKind, maker: str, expected: str, remedy: str) -> ReadError:
    called = f"{kind}{f' ({maker})' if maker else ''}"
    return ReadError(f"this is {called}", path=path, expected=expected, remedy=remedy)
