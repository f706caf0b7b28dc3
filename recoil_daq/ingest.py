"""Recorded files to one verified shot file, with a verdict."""

from __future__ import annotations

import datetime as dt
import hashlib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from daq.channel import Step
from daq.errors import CorruptFileError, ReadError, StoreError, UnknownFormatError
from daq.readers.reader import Reader, Recording
from daq.readers.table import READERS, recognise
from daq.shot import InputFile, Shot
from daq.store import write_shot
from identification.clocks import align_clocks
from identification.shot_quality import check_shot
from recoil_daq import __version__
from rigs.assemble import assemble_channels, match_files
from rigs.rig import Rig

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Ingested:
    """A shot and where it was written.

    Attributes
    ----------
    shot : Shot
    path : Path
    """

    shot: Shot
    path: Path


def ingest_files(
    rig: Rig,
    files: Sequence[str | Path],
    *,
    shot: str | None = None,
    out: str | Path = "shots",
    overwrite: bool = False,
    accept_incomplete: bool = False,
    on: dt.date | None = None,
    progress: Progress = lambda _: None,
) -> Ingested:
    """Turn one shot's recorded files into a verified shot file.

    Parameters
    ----------
    rig : Rig
    files : sequence of path
        One per source of the rig, in any order; recognised by their content.
    shot : str, optional
        Identifier of the shot; the name of the reference clock's file without ending if left out.
    out : path
        Folder of the shot file.
    overwrite : bool
    accept_incomplete : bool
        Take what is there of a file that was cut off, and say so in the verdict.
    on : date, optional
        Day of the shot, for calibrations' due dates; today if left out.
    progress : callable
        Told the name of each step.

    Returns
    -------
    Ingested
        The shot with its verdict; a shot that is not usable is written all the same.

    Raises
    ------
    ReadError, RigError, StoreError
        If the data or the rig are at fault; nothing is written then.
    """
    progress("recognise")
    paths = [Path(f) for f in files]
    readers = {path: _reader_of(path, rig) for path in paths}
    matched = match_files(rig, [(path, readers[path].kind) for path in paths])
    if rig.reference_clock not in matched:
        raise ReadError(
            f"no file of the reference source {rig.reference_clock!r} among those given",
            path=rig.path,
            found=", ".join(f"{p.name} ({readers[p].name})" for p in paths) or "no files",
            remedy="add its file: all other clocks are aligned to it",
        )
    name = shot if shot is not None else matched[rig.reference_clock].stem
    if not re.fullmatch(r"[\w.+-]+", name) or name.startswith("."):
        raise StoreError(
            f"{name!r} is no shot identifier", expected="letters, digits, `_`, `-`, `+` and `.`", remedy="choose --shot"
        )
    target = Path(out) / f"{name}.h5"
    if target.exists() and not overwrite:
        raise StoreError("the shot file exists already", path=target, remedy="give another --shot, or --overwrite")
    progress("read")
    recordings: dict[str, Recording] = {}
    for source, path in matched.items():
        recordings[source] = readers[path].open(path, rig.declarations(rig.source(source)))
        if recordings[source].incomplete and not accept_incomplete:
            raise CorruptFileError(
                f"the file was cut off: {recordings[source].incomplete}",
                path=path,
                remedy="copy it again, or take what is there with --accept-incomplete",
            )
    channels = assemble_channels(rig, recordings, __version__)
    start = recordings[rig.reference_clock].absolute_start
    assembled = Shot(
        name=name,
        rig_name=rig.name,
        rig_text=rig.text,
        reference_clock=rig.reference_clock,
        channels=channels,
        inputs=tuple(
            InputFile(path.name, _sha256(path), path.stat().st_size, source, recordings[source].reader)
            for source, path in matched.items()
        ),
        started="" if start is None else start.text,
        databases=rig.databases,
    )
    progress("align")
    alignments = align_clocks(assembled, rig)
    progress("check")
    quality = check_shot(assembled, rig, alignments, recordings, on or dt.date.today())
    finished = assembled.with_results(alignments, quality, Step("ingest", __version__, {"rig": rig.path.name}))
    progress("write")
    write_shot(finished, target, overwrite=overwrite)
    return Ingested(finished, target)


def _reader_of(path: Path, rig: Rig) -> Reader:
    """Return the reader that claims a file; raw serial bytes are known by their source's pattern alone."""
    try:
        return recognise(path)
    except UnknownFormatError as error:
        serial = [s for s in rig.matching(path.name) if s.kind == "serial"]
        if error.candidates or not serial:
            raise
        return next(reader for reader in READERS if reader.kind == "serial")


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
