"""One conversion of a live shot, in the process that stays warm for it: as ``recoil-daq ingest --json`` does it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.processes.shortage import is_shortage, shortage_of
from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.terminal.session import FAULT, NOT_VALID, OK, error_document
from recoil_rigs.rig import Rig, parse_rig

_HELD: list[Shot] = []
"""The last shot: whoever identifies it in this process does not read its file again."""


@dataclass(frozen=True)
class ConversionTask:
    """A shot that is to be converted.

    Attributes
    ----------
    rig
        Path of the rig file.
    rig_text, databases
        Text of the rig file and of its CAN databases as the shot was acquired with them, whatever became of the files.
    shot
        Name of the shot.
    out
        Folder of the shot file.
    replaces
        Line on why a shot file that is there is made anew; empty if none may be.
    overwrite
        Whether one that is there is of this conversion, begun before by a process that ended.
    without
        Sources that are left out of it.
    """

    rig: Path
    rig_text: str
    databases: Mapping[str, str]
    files: tuple[Path, ...]
    shot: str
    out: Path
    replaces: str = ""
    overwrite: bool = False
    without: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, rig: Rig, files: Sequence[Path], shot: str, out: Path, replaces: str = "", without: Sequence[str] = ()
    ) -> ConversionTask:
        """Return the conversion of a shot that was acquired with a rig."""
        path, text, databases = rig.path, rig.text, dict(rig.databases)
        return cls(path, text, databases, tuple(files), shot, out, replaces, without=tuple(without))


def convert(task: ConversionTask) -> tuple[int, dict[str, Any]]:
    """Make a shot file; return the exit code and the document of the command."""
    try:
        rig = parse_rig(task.rig_text, task.rig, task.databases)
        done = ingest_files(
            rig, task.files, shot=task.shot, out=task.out, overwrite=task.overwrite, replaces=task.replaces,
            without=task.without,
        )  # fmt: skip
        _HELD[:] = [done.shot]
    except RecoilDaqError as error:
        return FAULT, error_document(error)
    except Exception as error:
        if is_shortage(error):
            return FAULT, error_document(shortage_of(error))
        raise
    return OK if done.shot.usable else NOT_VALID, done.to_json()
