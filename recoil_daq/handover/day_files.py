"""The files of a day, by what they are: what is copied, packed, and named where it is lost."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError, RecoilDaqError, quoted
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.log.folder import find_logs
from recoil_acquisition.log.segment import LOCK_NAME, SUFFIX, is_being_written
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.store import shot_summary

_PARTIAL = re.compile(r"\..+\.[0-9a-f]+\.partial")
_OWN = (".lock", ".seen", ".held")
"""Ends of the hidden files by which commands know what others do: of this computer, and of no use elsewhere."""
_KINDS = (
    ("*.h5", "shot files: every channel in SI and as recorded, clocks, verdict, the rig file"),
    ("*shotlog.csv*", "shot log, and what a command replaced in it"),
    ("reports", "reports: mass, uncertainty, figures"),
    ("campaign", "what the shots say together"),
    ("day.*", "this page, and its numbers for machines"),
    ("live.*", "how the session was doing at its end, and its page"),
    ("pages", "scripts of that page"),
    ("zoom.*", "page that overlays channels of shots"),
    ("overviews", "what that page draws"),
    ("captures", "all that was received of each shot, byte for byte"),
    ("recovered", "all that could be read of a journal that was left over"),
    ("journal", "recorded and in no capture: `recoil-daq recover` first"),
    ("incoming", "files that other instruments dropped"),
    ("sessions", "what each session decided, and what went wrong"),
)
"""Names in the folder of a day, and what is there."""
_LOSSES = frozenset(
    {
        Check.MISSING_FRAMES, Check.STREAM, Check.CONNECTION, Check.KERNEL_DROPS, Check.DAMAGED_ENTRIES,
        Check.ERROR_FRAMES, Check.UNANSWERED, Check.JOURNAL, Check.PRE_TIME, Check.LOSSES, Check.LOST_FRAMES,
    }
)  # fmt: skip
"""Findings of a shot that say that something is missing."""
_LARGEST_SESSION = 1 << 28


@dataclass(frozen=True)
class DayFiles:
    """Files in the folder of a day.

    Attributes
    ----------
    folder
        Folder of the shot files.
    files
        Regular files of it in the order of their names, without locks and what was not finished.
    left_out
        Links and what else is no regular file.
    """

    folder: Path
    files: tuple[Path, ...]
    left_out: tuple[Path, ...]

    @classmethod
    def of(cls, folder: Path) -> DayFiles:
        """List a folder.

        Raises
        ------
        ReadError
            If there is no such folder, it has no shot file and no capture, or cannot be read.
        """
        if not folder.is_dir():
            raise ReadError("no such folder", path=folder, remedy="name the folder of the day's shot files")
        files = list[Path]()
        others = list[Path]()
        try:
            for path in _under(folder):
                (files if path.is_file() and not path.is_symlink() else others).append(path)
        except OSError as error:
            raise ReadError(f"cannot be read: {error.strerror or error}", path=folder) from error
        if not any(path.suffix in (".h5", SUFFIX) for path in files):
            raise ReadError(
                "no shot file and no capture in this folder", path=folder, expected="the folder of a day's shot files",
                remedy="name the --out of `recoil-daq ingest`",
            )  # fmt: skip
        key = {path: path.relative_to(folder).as_posix() for path in files}
        return cls(folder, tuple(sorted(files, key=key.__getitem__)), tuple(sorted(others)))

    def copied(self) -> list[dict[str, Any]]:
        """Say what there is to copy, each with ``path``, ``what``, ``files`` and ``bytes``."""
        found, left = [], set(self.files)
        for pattern, what in _KINDS:
            these = {path for path in left if fnmatchcase(path.relative_to(self.folder).parts[0], pattern)}
            left -= these
            found += [_entry(pattern, what, these)] if these else []
        return found + ([_entry("others", "what somebody else put there", left)] if left else [])

    def lost(self) -> list[dict[str, str]]:
        """Say what of the day is missing, each with ``of`` and ``text``."""
        return [{"of": of, "text": text} for of, text in self._lost()]

    def _lost(self) -> Iterator[tuple[str, str]]:
        shots = {path.stem: path for path in self.folder.glob("*.h5")}
        for name, path in sorted(shots.items()):
            try:
                findings = shot_summary(path)["findings"]
            except RecoilDaqError as error:
                yield name, str(error)
                continue
            yield from ((name, str(one["text"])) for one in findings if one["code"] in _LOSSES and _weighs(one))
        for path in sorted((self.folder / "captures").glob(f"*{SUFFIX}")):
            if path.stem not in shots:
                yield path.stem, f"captured, and no shot file of it: {path}"
        for session in sorted((self.folder / "sessions").glob("*.json")):
            yield from _of_session(session, shots)
        for journal in find_logs(self.folder / "journal"):
            text = f"this journal holds what is in no shot file: `recoil-daq recover {quoted(journal)}` says what"
            yield journal.name, text


def refuse_armed(folder: Path) -> None:
    """Raise a ReadError where a live session writes to a folder at present."""
    if is_being_written(folder / "journal"):
        raise ReadError("a live session writes to this folder", path=folder, remedy="end it first, with q")


def _weighs(finding: Mapping[str, Any]) -> bool:
    return str(finding["severity"]) != "note"


def _under(folder: Path) -> Iterator[Path]:
    """Yield what is in a folder at any depth; a link is not followed."""
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            if not _PARTIAL.fullmatch(path.name):
                yield from _under(path)
        elif not (_PARTIAL.fullmatch(path.name) or path.name == LOCK_NAME or path.suffix in _OWN):
            yield path


def _entry(path: str, what: str, files: Sequence[Path] | set[Path]) -> dict[str, Any]:
    return {"path": path, "what": what, "files": len(files), "bytes": sum(one.stat().st_size for one in files)}


def _of_session(path: Path, shots: Mapping[str, Path]) -> Iterator[tuple[str, str]]:
    """Say of a session what went wrong, and which of its shots are in no shot file."""
    name = f"session {path.stem}"
    try:
        document = read_json(read_small(path, _LARGEST_SESSION, "the log of a session"))
        if document["error"]:
            yield name, str(document["error"])
        for shot in document["shots"]:
            if shot["shot"] not in shots and shot["capture"] is None:
                yield str(shot["shot"]), f"{shot['state']}: {shot['problem']}"
    except (RecoilDaqError, ValueError, LookupError, TypeError, RecursionError) as error:
        yield name, f"its log cannot be read: {error}"
