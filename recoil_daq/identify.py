"""A shot file to a report."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daq.errors import ReadError, StoreError
from daq.shot import InputFile
from daq.store import read_shot
from identification.analysis import Options, identify_shot
from identification.report.document import report_document, write_document, write_trace
from identification.report.figures import report_figures
from identification.report.html import write_report_page
from recoil_daq import __version__
from rigs.rig import parse_rig

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Reported:
    """A report and where it was written.

    Attributes
    ----------
    document : dict
        The contents of ``report.json``.
    folder : Path
        Holds ``report.json``, ``report.html``, ``mass.csv`` and the script of the figures.
    """

    document: dict[str, Any]
    folder: Path


def find_shot_files(paths: list[Path]) -> list[Path]:
    """Expand folders to the shot files in them, in order of their names.

    Raises
    ------
    ReadError
        If a path does not exist or a folder holds no shot file.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(path.glob("*.h5"))
            if not inside:
                raise ReadError("no shot file in this folder", path=path, expected="files that end in .h5")
            found += inside
        elif path.exists():
            found.append(path)
        else:
            raise ReadError("no such file", path=path, remedy="check the name and the folder")
    return found


def identify_file(
    path: str | Path,
    *,
    out: str | Path = "reports",
    options: Options | None = None,
    truth: Mapping[str, Any] | None = None,
    overwrite: bool = False,
    progress: Progress = lambda _: None,
) -> Reported:
    """Identify the mass of one shot file and write its report into ``out/<shot>``.

    The report appears complete or not at all: it is written beside its place and then renamed.

    Parameters
    ----------
    path : path
    out : path
    options : Options, optional
    truth : mapping, optional
        Of a virtual shot, for comparison in the report.
    overwrite : bool
    progress : callable
        Told the name of each step.

    Raises
    ------
    StoreError
        If the file is no shot file, or the report exists or cannot be written.
    RigError
        If the rig stored in the shot file is at fault.
    IdentificationError
        If no number can be given at all.
    """
    source = Path(path)
    progress("read")
    shot = read_shot(source)
    folder = Path(out) / shot.name
    if folder.exists() and not overwrite:
        raise StoreError("the report exists already", path=folder, remedy="give another --out, or --overwrite")
    rig = parse_rig(shot.rig_text, source, shot.databases)
    progress("identify")
    found = identify_shot(shot, rig, options or Options())
    progress("report")
    with source.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    itself = InputFile(source.name, digest, source.stat().st_size, "", "shot file")
    document = report_document(shot, found, version=__version__, shot_file=itself, truth=truth)
    figures = report_figures(found)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=f".{shot.name}.", suffix=".partial", dir=folder.parent))
    except OSError as error:
        raise StoreError(f"cannot write here: {error.strerror}", path=folder.parent, remedy="choose --out") from error
    try:
        write_document(partial, document)
        write_trace(partial, found.chosen)
        write_report_page(partial, document, figures)
        # a temporary folder is private to its owner; a report is not
        partial.chmod(0o777 & ~_umask())
        if folder.exists():
            # only the report's own files are replaced: the folder may hold somebody's notes
            for part in sorted(partial.iterdir()):
                part.replace(folder / part.name)
        else:
            partial.rename(folder)
    except OSError as error:
        raise StoreError(
            f"cannot be written: {error.strerror}", path=folder, remedy="check space and permissions"
        ) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return Reported(document, folder)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
