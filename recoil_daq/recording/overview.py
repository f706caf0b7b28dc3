"""Overviews of shots: lowest and highest sample of each piece of a record, as scripts that a page reads from a file.

A page that was opened from a file may fetch nothing, but reads scripts. ``overviews/ID`` in the folder of the shot
files holds::

    overview.js     every channel in at most `COLUMNS` pieces: what is drawn first
    NNN.js          one channel in at most `FINE_COLUMNS` pieces, or every sample of it: what is drawn when zoomed
    filtered.js     the curves of its report, behind the low-pass

and ``overviews/index.js`` names the shots that have one. Each says the SHA-256 of the shot file that it was made of.
"""

from __future__ import annotations

import base64
import contextlib
import json
import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import AlignmentError, IdentificationError, RecoilDaqError, StoreError
from recoil_acquisition.files.new_file import partial_path, remove_left_partials
from recoil_acquisition.files.temporary_folder import LEFT_AFTER_S
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.quantities.unit_choice import SI, UnitChoice
from recoil_acquisition.shot.shot import InputFile, Shot
from recoil_acquisition.store import read_shot
from recoil_processing.shot.onset import find_onset
from recoil_rigs.rig import parse_rig

FOLDER, OVERVIEW, FILTERED, INDEX = "overviews", "overview.js", "filtered.js", "index.js"
SCHEMA = "recoil-daq/overview/1"
COLUMNS = 2_048
"""Pieces of a channel that are drawn first: more than a screen has columns."""
FINE_COLUMNS = 131_072
"""Pieces of a channel that is zoomed: of up to twice as many samples every one is kept."""
_HEAD = re.compile(r'"sha256":"([0-9a-f]{64})","size":(\d+),"changed_ns":(\d+)')
_HEAD_BYTES = 1_000


def write_overview(shot: Shot, file: Path) -> str:
    """Write the overview of a shot beside its file.

    Parameters
    ----------
    file
        Shot file that holds it.

    Returns
    -------
    str
        SHA-256 of the shot file.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    status, digest, name = file.stat(), InputFile.of(file).sha256, file.stem  # by which a page asks, whatever it holds
    folder = file.parent / FOLDER / name
    channels, fine = [], {}
    for number, channel in enumerate(shot.channels.values()):
        times_s, aligned = _instants(shot, channel)
        told = {
            "name": channel.name, "role": channel.role or "", "quantity": channel.quantity, "unit": channel.unit,
            "aligned": aligned, "samples": len(times_s), "pieces": _pieces(times_s, channel.samples, COLUMNS),
            "fine": None,
        }  # fmt: skip
        if len(times_s) > 2 * COLUMNS:
            told["fine"] = script = f"{number:03d}.js"
            fine[script] = _pieces(times_s, channel.samples, FINE_COLUMNS)
        channels.append(told)
    head = {
        "schema": SCHEMA, "shot": name, "sha256": digest, "size": status.st_size,
        "changed_ns": status.st_mtime_ns, "zero_s": _zero_s(shot), "units": _units(shot).to_json(),
    }  # fmt: skip
    try:
        folder.mkdir(parents=True, exist_ok=True)
        remove_left_partials(folder, idle_s=LEFT_AFTER_S)
        for script, pieces in fine.items():
            _write(folder / script, "fine", f"{name}/{script}", {"sha256": digest, "pieces": pieces})
        for left in folder.glob("[0-9]*.js"):
            if left.name not in fine:
                left.unlink(missing_ok=True)
        _write(folder / OVERVIEW, "overviews", name, {**head, "channels": channels})
        write_index(file.parent)
    except OSError as error:
        raise StoreError(f"the overview cannot be written: {error.strerror or error}", path=folder) from error
    return digest


def write_filtered(out: Path, shot: str, zero_s: float, times_s: Array, curves: Mapping[str, Array]) -> None:
    """Write the curves of a report for pages that are opened from a file.

    Parameters
    ----------
    out
        Folder of the shot files.
    zero_s
        Onset of force on the reference clock.
    times_s : ndarray, shape (n,)
        Times after it.
    curves : mapping of str to ndarray, shape (n,)
        Values by the names of the report's peaks.
    """
    packed = {"time_s": _packed(times_s), **{name: _packed(values) for name, values in curves.items()}}
    folder = out / FOLDER / shot
    folder.mkdir(parents=True, exist_ok=True)
    _write(folder / FILTERED, "filtered", shot, {"zero_s": zero_s, "curves": packed})


def write_index(out: Path) -> None:
    """Write which shots of a folder have an overview."""
    found = [
        {"shot": name, "sha256": digest, "filtered": (out / FOLDER / name / FILTERED).is_file()}
        for name, digest in digests_of(out).items()
    ]
    _replace(out / FOLDER / INDEX, f"window.shots = {json.dumps(found)};\n")


def refresh_overviews(out: Path) -> list[str]:
    """Write the overviews of a folder of shots that are missing, or of other shot files than are there now.

    Returns
    -------
    list of str
        Lines on the shots that have none, and why.
    """
    problems = []
    files = sorted(path for path in out.glob("[!.]*.h5") if path.is_file())
    for file in files:
        if _is_current(file):
            continue
        try:
            write_overview(read_shot(file), file)
        except (RecoilDaqError, OSError) as error:
            problems.append(f"no curves of {file.name}: {error}")
    if files:
        with contextlib.suppress(OSError):
            for folder in (out / FOLDER).iterdir():  # a shot may have come meanwhile, with its overview
                gone = not (out / f"{folder.name}.h5").exists()
                if gone and folder.is_dir() and not folder.is_symlink() and _is_own(folder):
                    shutil.rmtree(folder)
            write_index(out)
    return problems


def overview_of(task: Path) -> str:
    """Write the overview of a shot file in the process that stays warm, which may hold its shot yet."""
    return write_overview(read_shot(task), task)


def refresh(task: Path) -> tuple[list[str], dict[str, str]]:
    """Do as `refresh_overviews` in the process that stays warm; return the digests of the shots that have one, too."""
    return refresh_overviews(task), digests_of(task)


def digests_of(out: Path) -> dict[str, str]:
    """Return the SHA-256 of the shot files of a folder that have an overview, by the names of the shots."""
    heads = ((path.parent.name, _head_of(path)) for path in sorted((out / FOLDER).glob(f"*/{OVERVIEW}")))
    return {name: head[0] for name, head in heads if head is not None and (out / f"{name}.h5").is_file()}


def _is_own(folder: Path) -> bool:
    """Return whether a folder holds an overview, and nothing else."""
    names = {path.name for path in folder.iterdir()}
    return OVERVIEW in names and all(re.fullmatch(r"overview\.js|filtered\.js|\d{3}\.js", name) for name in names)


def _is_current(file: Path) -> bool:
    """Return whether a shot file has an overview of it as it is: size and time of change tell, else its digest."""
    head = _head_of(file.parent / FOLDER / file.stem / OVERVIEW)
    if head is None:
        return False
    digest, *were = head
    status = file.stat()
    return were == [status.st_size, status.st_mtime_ns] or digest == InputFile.of(file).sha256


def _head_of(path: Path) -> tuple[str, int, int] | None:
    """Return digest, size and time of change of the shot file that an overview was made of; None if there is none."""
    try:
        with path.open("rb") as file:
            found = _HEAD.search(file.read(_HEAD_BYTES).decode("ascii", "replace"))
    except OSError:
        return None
    return None if found is None else (found[1], int(found[2]), int(found[3]))


def _instants(shot: Shot, channel: Channel) -> tuple[Array, bool]:
    """Return the instants of a channel on the reference clock, and whether its clock is aligned to that."""
    try:
        return shot.reference_times_s(channel.name), True
    except AlignmentError:
        return channel.time_base.times_s, False


def _units(shot: Shot) -> UnitChoice:
    """Return the units that the shot's rig chose; SI where its text is no rig any more."""
    try:
        return parse_rig(shot.rig_text, Path("rig"), shot.databases or {}, refuse_doubts=False).read_in
    except RecoilDaqError:
        return SI


def _zero_s(shot: Shot) -> float | None:
    """Return the onset of force on the reference clock, where shots are laid together; None if none shows."""
    for role in ("breech_pressure", "recoil_acceleration"):
        channel = shot.by_role(role)
        if channel is None or channel.time_base.clock != shot.reference_clock:
            continue
        try:
            return float(find_onset(channel.time_base.times_s, {role: np.asarray(channel.samples, dtype=np.float64)}))
        except IdentificationError:
            continue
    return None


def _pieces(times_s: Array, samples: NDArray[np.floating[Any]], most: int) -> dict[str, Any]:
    """Return the samples themselves, or the lowest and the highest of each of so many pieces of equal length."""
    count = len(times_s)
    if count == 0:
        return {"first_s": 0.0, "step_s": 0.0, "times": None, "low": "", "high": None}
    first_s, last_s = float(times_s[0]), float(times_s[-1])
    if count <= 2 * most:
        step_s = (last_s - first_s) / max(count - 1, 1)
        even = bool(np.all(np.abs(times_s - (first_s + step_s * np.arange(count))) <= 1e-3 * step_s))
        times = None if even else _packed(times_s - first_s)
        return {"first_s": first_s, "step_s": step_s, "times": times, "low": _packed(samples), "high": None}
    step_s = (last_s - first_s) / most
    begins = np.searchsorted(times_s, first_s + step_s * np.arange(most))
    empty = np.diff(begins, append=count) == 0
    begins = np.minimum(begins, count - 1)
    low, high = (np.where(empty, np.nan, extreme.reduceat(samples, begins)) for extreme in (np.fmin, np.fmax))
    middle_s = first_s + step_s / 2
    return {"first_s": middle_s, "step_s": step_s, "times": None, "low": _packed(low), "high": _packed(high)}


def _packed(values: NDArray[np.floating[Any]]) -> str:
    """Write numbers as a page unpacks them: 32 bits each, little-endian, in base 64."""
    with np.errstate(over="ignore"):
        return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def _write(path: Path, variable: str, key: str, document: Mapping[str, Any]) -> None:
    text = json.dumps(document, separators=(",", ":"), allow_nan=False)
    _replace(path, f"(window.{variable} ??= Object.create(null))[{json.dumps(key)}] = {text};\n")


def _replace(path: Path, text: str) -> None:
    """Write a file in one step; a page that reads it has this or the one before."""
    partial = partial_path(path)
    try:
        partial.write_text(text, encoding="ascii", newline="\n")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
