"""Dewesoft's own recordings (.dxd, .d7d), by the vendor's library.

The library comes with ``dwdatareader`` (extra ``dewesoft``), for Windows and Linux on x86-64. It runs in a child
process (`recoil_acquisition.readers.dewesoft.child_process`), once per file: a crash or a hang of it becomes a
`CorruptFileError`. That is no precaution: of 25 copies of a real file cut short it crashed over 24 and hung over one.
The samples wait in a temporary file of 8 bytes per sample (16 where stamped), which goes with the recording.

The library does not say whether it read all that was once in a file, nor are there checksums to see a flipped bit by.

What the file says, and what it does not:

- time counts from the start of the measurement, which may be long before the first stored sample;
- wall-clock times carry no zone;
- CAN channels cannot be read (the vendor's word: route them through a formula channel); they are named in the notes;
- channels of a single value go to the metadata, under ``single_values``;
- the stamps of asynchronous channels repeat: of equal ones the last sample is kept
  (`recoil_acquisition.readers.time.increasing_stamps`).
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
import tempfile
import weakref
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import CorruptFileError, ReadError, system_errors_as
from recoil_acquisition.files.temporary_folder import PREFIX, remove_left_folders
from recoil_acquisition.packages.extras import DEWESOFT
from recoil_acquisition.processes.child_process import isolated
from recoil_acquisition.readers.containers.stored_time import selected
from recoil_acquisition.readers.dewesoft import child_process as child
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.statements import Statements
from recoil_acquisition.readers.time.increasing_stamps import keep_increasing, left_out_note
from recoil_acquisition.remark import Note, NoteCode, Remark

MAGIC = b"MULTI_STREAM_FILE_VER"
FEWEST_BYTES = 4096
OLDEST = (1, 3, 0)
"""Version of the library before which it scales some channels wrongly."""
LIMIT_S = 30.0
BYTES_PER_SECOND = 2e6
"""Speed below which it hangs, beyond `LIMIT_S`: the library was measured at ten times that and more."""
LONGEST_SETUP = 1 << 16
"""Bytes of a setup beyond which it is kept by its digest."""

_REMEDY = "open it in DewesoftX and store it again, or export it as text"
_GAPS = {2: "fast on trigger", 3: "fast on trigger, slow otherwise"}


class DewesoftReader:
    """Reader of Dewesoft's recordings."""

    name = "Dewesoft recording"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Read a recording.

        Raises
        ------
        ReadError
            If the library is too old, or refuses the file.
        CorruptFileError
            If the library crashes or hangs over it, or what it gives contradicts itself.
        """
        with system_errors_as(ReadError, path, "read"):
            size = path.stat().st_size
            with path.open("rb") as file:
                head = file.read(len(MAGIC))
        if head != MAGIC or size < FEWEST_BYTES:
            raise CorruptFileError(
                "this is no recording of Dewesoft", path=path, place="byte 0",
                expected=f"{MAGIC.decode()} and {FEWEST_BYTES} bytes", found=f"{head!r} and {size} bytes",
            )  # fmt: skip
        _check_library(path)
        remove_left_folders()
        folder = Path(tempfile.mkdtemp(prefix=PREFIX))
        try:
            return _Found(path, folder, _run(path, folder, size), declared.clock).recording()
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise


def _check_library(path: Path) -> None:
    version = metadata.version(DEWESOFT.module)
    if tuple(int(part) for part in version.split(".")[:3] if part.isdecimal()) < OLDEST:
        raise ReadError(
            "Dewesoft's library is too old: it scales some channels wrongly", path=path,
            expected="dwdatareader 1.3.0 or newer", found=version, remedy=DEWESOFT.remedy,
        )  # fmt: skip


def _run(path: Path, folder: Path, size: int) -> dict[str, Any]:
    """Let a child read the file; return what it says."""
    limit_s = LIMIT_S + size / BYTES_PER_SECOND
    try:
        done = isolated(child.__name__, str(path.resolve()), str(folder), limit_s=limit_s)
    except TimeoutError as error:
        raise CorruptFileError(
            f"Dewesoft's library did not come back within {limit_s:.0f} s", path=path, remedy=_REMEDY
        ) from error
    except OSError as error:
        raise ReadError(f"Dewesoft's library cannot be run: {error}", path=path) from error
    try:
        found = json.loads((folder / child.RECORDING).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CorruptFileError(
            f"Dewesoft's library failed over this file (exit code {done.code})", path=path,
            found=done.said or None, remedy=_REMEDY,
        ) from error  # fmt: skip
    if "no_library" in found:
        raise ReadError(
            f"Dewesoft's library cannot be loaded: {found['no_library']}", path=path,
            remedy="it runs on Windows and Linux on x86-64 alone; elsewhere export the file as text",
        )  # fmt: skip
    if "refused" in found:
        raise CorruptFileError(f"Dewesoft's library refuses it: {found['refused']}", path=path, remedy=_REMEDY)
    return dict(found)


class _Found:
    """A recording as a child wrote it, in a folder that goes when nobody holds this any more.

    Parameters
    ----------
    found
        Statements of the child process.
    clock
        Name of the source.
    """

    def __init__(self, path: Path, folder: Path, found: dict[str, Any], clock: str) -> None:
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self._path, self._folder, self._found, self._clock = path, folder, found, clock
        self._start = AbsoluteStart(found["start_measure_time"], "unknown", "start of the measurement")

    def recording(self) -> Recording:
        """Return the recording; its channels hold this."""
        found, channels, empty = self._found, [], []
        notes: list[Remark] = []
        single: dict[str, Any] = {}
        for channel in found["channels"]:
            name = channel["name"]
            if "refused" in channel:
                notes.append(Note(NoteCode.LEFT_OUT, name, f"{name}: left out: {channel['refused']}"))
            elif not channel["count"]:
                empty.append(name)
            elif channel["kind"] == child.SINGLE:
                single[name] = {"value": _plain(self._stored(channel, 0, 1)[0]), "unit": channel["unit"]}
            else:
                channels.append(self._channel(name, channel, notes))
        if empty:
            notes.append(Note(NoteCode.LEFT_OUT, None, f"channels without a sample: {', '.join(empty)}"))
        if not channels:
            raise ReadError(
                "there are no samples that can be read", path=self._path, found="; ".join(notes) or "no channels",
                remedy=_REMEDY,
            )  # fmt: skip
        storing = found.get("storing_type", 0)
        if storing in _GAPS:
            text = f"it was stored {_GAPS[storing]}: there may be gaps, and each is in the time bases"
            notes.append(Note(NoteCode.LOST, None, text))
        for key, said in found.get("failed", {}).items():
            notes.append(Note(NoteCode.LEFT_OUT, None, f"the library does not give its {key}: {said}"))
        kept = ("sample_rate_hz", "start_measure_time", "start_store_time", "duration_s", "header", "events", "version")
        said = {**{key: found.get(key) for key in (*kept, "storing_type")}, "single_values": single, **self._setup()}
        return Recording(
            self._path, DewesoftReader.name, channels, metadata=said, notes=notes, absolute_start=self._start
        )

    def _setup(self) -> dict[str, Any]:
        try:
            setup = (self._folder / child.SETUP).read_bytes()
        except OSError:
            return {}  # that it was not given is among the notes
        digest = {"setup_sha256": hashlib.sha256(setup).hexdigest()}
        return digest if len(setup) > LONGEST_SETUP else {**digest, "setup": setup.decode("utf-8", "replace")}

    def _channel(self, name: str, channel: dict[str, Any], notes: list[Remark]) -> StoredChannel:
        count = channel["count"]
        if name != channel["long_name"]:
            text = f"{name}: another channel is named {channel['long_name']!r} too"
            notes.append(Note(NoteCode.NAMES, name, text))
        if "\ufffd" in name + channel["unit"]:
            text = f"{name}: its name or unit {channel['unit']!r} has letters that are not UTF-8"
            notes.append(Note(NoteCode.NAMES, name, text))
        chosen: NDArray[np.int64] | None = None
        if "rate_hz" not in channel:
            stamps_s = self._stored(channel, count, 2 * count)
            kept, repeated, backward = keep_increasing(stamps_s)
            notes += left_out_note(name, count, repeated, backward)
            if repeated or backward:
                chosen = np.flatnonzero(kept)
                count = int(chosen.size)
                stamps_s = stamps_s[kept]
            if channel["kind"] == child.SYNC and count > 1:
                steps = np.diff(stamps_s)
                gaps = int((steps > 1.5 * np.median(steps)).sum())
                text = f"{name}: its samples are not evenly spaced ({gaps} gaps): instants are as stored"
                notes.append(Note(NoteCode.TIME, name, text))
        metadata = {key: channel[key] for key in ("description", "data_type") if channel.get(key)}
        header = SignalHeader(name, channel["unit"], count, metadata=metadata)
        return StoredChannel(
            header, partial(self._instants, name, channel, chosen), partial(self._samples, channel, chosen),
            beside=Statements({"description": channel.get("description", "")}),
        )  # fmt: skip

    def _stored(self, channel: dict[str, Any], start: int, stop: int) -> NDArray[np.float64]:
        """Read what the child wrote of one channel: its samples, and behind them its stamps."""
        try:
            with (self._folder / child.SAMPLES).open("rb") as file:
                file.seek(channel["at"] + 8 * start)
                stored = np.fromfile(file, "<f8", max(stop - start, 0))
        except OSError as error:
            raise ReadError(f"its temporary samples cannot be read: {error}", path=self._path) from error
        if stored.size < stop - start:
            raise ReadError("its temporary samples are gone", path=self._path, remedy="is the disk full?")
        return stored.astype(np.float64, copy=False)

    def _samples(
        self, channel: dict[str, Any], chosen: NDArray[np.int64] | None, start: int, stop: int
    ) -> NDArray[np.float64]:
        return selected(chosen, partial(self._stored, channel), start, stop)

    def _instants(self, name: str, channel: dict[str, Any], chosen: NDArray[np.int64] | None) -> TimeBase:
        """Return the instants of one channel, in seconds after the start of the measurement."""
        count = channel["count"]
        try:
            if "rate_hz" in channel:
                return TimeBase.uniform(self._clock, channel["start_s"], 1.0 / channel["rate_hz"], count, self._start)
            stamps_s = self._stored(channel, count, 2 * count)
            return TimeBase.stamped(self._clock, stamps_s if chosen is None else stamps_s[chosen], self._start)
        except ValueError as error:
            raise CorruptFileError(f"the times of {name} cannot be used: {error}", path=self._path) from error


def _plain(value: float) -> float | None:
    """Return a number that JSON can hold."""
    return float(value) if math.isfinite(value) else None
