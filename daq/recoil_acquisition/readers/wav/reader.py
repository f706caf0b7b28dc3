"""WAVE sound files (WAV, RF64, BW64): integers of 8 to 32 bits or floats, one rate.

A WAVE file states no unit. Its samples are read as shares of full scale, 1 being full scale, for
integers as for floats; what full scale is in volts or pascals only the recorder's setting says.
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.containers.stored_channels import container_recording
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel, map_to_corrupt_file
from recoil_acquisition.readers.statements import Statements
from recoil_acquisition.readers.wav.riff import (
    FLOAT,
    FORMAT,
    FORMS,
    PCM,
    SAMPLES,
    SMALL_CHUNK_BYTES,
    Chunk,
    SoundFormat,
    is_wave,
    iter_chunks,
    parse_broadcast,
    parse_format,
    parse_info,
)
from recoil_acquisition.remark import Note, NoteCode

_DATE = re.compile(r"(\d{4})[-_:/. ](\d\d)[-_:/. ](\d\d)")
_TIME = re.compile(r"(\d\d)[-_:/. ](\d\d)[-_:/. ](\d\d)")
SUPPORTED = {(PCM, 8), (PCM, 16), (PCM, 24), (PCM, 32), (FLOAT, 32), (FLOAT, 64)}
CODINGS = {2: "Microsoft ADPCM", 6: "A-law", 7: "mu-law", 17: "IMA ADPCM", 80: "MPEG", 85: "MPEG layer 3"}
"""Codings that are not read, by their numbers in RFC 2361."""
UNSCALED = "WAVE states no unit: samples are shares of full scale (1), and what full scale is must come from the rig"


class WavReader:
    """Reader of WAVE sound files."""

    name = "WAV"

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file; its samples are not read.

        Raises
        ------
        ReadError
            If its samples are compressed, or it holds a second recording.
        CorruptFileError
            If it has no format or no samples.
        """
        with map_to_corrupt_file(path, "a WAVE file"):
            return _open(path, declared.clock)


def _open(path: Path, clock: str) -> Recording:
    size = path.stat().st_size
    found: dict[bytes, tuple[Chunk, bytes]] = {}
    info: dict[str, str] = {}
    with path.open("rb") as file:
        if not is_wave(file.read(12)):
            raise CorruptFileError("no WAVE file", path=path, place="byte 0", expected="RIFF....WAVE")
        for chunk in iter_chunks(file, size):
            file.seek(chunk.start)
            content = b"" if chunk.name == SAMPLES else file.read(min(chunk.size, SMALL_CHUNK_BYTES))
            if chunk.name in FORMS or (chunk.name == SAMPLES and chunk.name in found):
                raise ReadError(
                    f"a second recording begins at byte {chunk.start - 8}",
                    path=path,
                    expected="one recording in a file",
                    found=f"a further {chunk.name.decode()} chunk",
                    remedy="export one recording per file",
                )
            if chunk.name == b"LIST":
                info |= parse_info(content)
            found.setdefault(chunk.name, (chunk, content))
    if FORMAT not in found or SAMPLES not in found:
        missing = "fmt" if FORMAT not in found else "data"
        raise CorruptFileError(f"no {missing} chunk", path=path, expected="a format and samples", found=f"{size} bytes")
    try:
        form = parse_format(found[FORMAT][1])
    except ValueError as error:
        raise CorruptFileError(
            "the format is damaged", path=path, place=f"byte {found[FORMAT][0].start}", found=str(error)
        ) from error
    if (form.code, form.bits) not in SUPPORTED:
        raise ReadError(
            "samples in this coding are not read", path=path,
            found=f"{CODINGS.get(form.code, 'a coding')} (format {form.code}) of {form.valid_bits} bits",
            expected="PCM of 8, 16, 24 or 32 bits or floats", remedy="export it as PCM",
        )  # fmt: skip
    data = found[SAMPLES][0]
    there = min(data.size, size - data.start)
    count = there // form.frame_bytes
    if not count:
        raise CorruptFileError("no samples", path=path, place=f"byte {data.start}", found=f"{there} bytes of them")
    incomplete = ""
    if there < data.size:
        incomplete = f"the samples end at byte {size} of {data.start + data.size}: {count} complete ones were read"
    elif there % form.frame_bytes:
        incomplete = f"the last sample has {there % form.frame_bytes} of {form.frame_bytes} bytes: left out"
    broadcast = parse_broadcast(found[b"bext"][1]) if b"bext" in found else {}
    start = _absolute_start(broadcast)
    metadata: dict[str, Any] = {
        "rate_hz": form.rate_hz, "bits": form.valid_bits, "coding": "float" if form.code == FLOAT else "PCM",
        "chunks": [name.decode("latin-1") for name in found], "info": info, "bext": broadcast,
    }  # fmt: skip
    base = TimeBase.uniform(clock, 0.0, 1.0 / form.rate_hz, count, start)
    channels = [
        StoredChannel(
            SignalHeader(f"channel {i + 1}", "", count),
            base,
            partial(_samples, path, data.start, form, i),
            partial(_raw, path, data.start, form, i),
            beside=Statements({**info, **broadcast}, ("time_reference",)),
        )
        for i in range(form.channels)
    ]
    notes = [Note(NoteCode.UNITS, None, UNSCALED)]
    notes += [Note(NoteCode.CUT, None, incomplete)] if incomplete else []
    return container_recording(path, WavReader.name, channels, metadata, notes, incomplete, start)


def _absolute_start(broadcast: dict[str, str | int]) -> AbsoluteStart | None:
    date = _DATE.fullmatch(str(broadcast.get("origination_date", "")))
    time = _TIME.fullmatch(str(broadcast.get("origination_time", "")))
    if date is None or time is None:
        return None
    return AbsoluteStart(f"{'-'.join(date.groups())}T{':'.join(time.groups())}", "unknown", "bext chunk")


def _stored(path: Path, at: int, form: SoundFormat, channel: int, start: int, stop: int) -> NDArray[Any]:
    """Read one channel's numbers as stored, 24 bits as int32; shape (stop - start,)."""
    with path.open("rb") as file:
        file.seek(at + start * form.frame_bytes)
        content = file.read((stop - start) * form.frame_bytes)
    width = form.bits // 8
    frames = np.frombuffer(content, np.uint8).reshape(stop - start, form.channels, width)[:, channel]
    if form.code == FLOAT:
        return np.ascontiguousarray(frames).view(f"<f{width}")[:, 0]
    if width == 1:
        return frames[:, 0].astype(np.int32) - 128
    wide = np.zeros((stop - start, 4), np.uint8)
    wide[:, 4 - width :] = frames
    # Bytes at the upper end of 32 bits keep their sign when they are shifted down
    return np.asarray(wide.view("<i4")[:, 0] >> (32 - form.bits), np.int32)


def _samples(path: Path, at: int, form: SoundFormat, channel: int, start: int, stop: int) -> NDArray[np.float64]:
    values = _stored(path, at, form, channel, start, stop).astype(np.float64)
    return values if form.code == FLOAT else values * 2.0 ** (1 - form.bits)


def _raw(path: Path, at: int, form: SoundFormat, channel: int, start: int, stop: int) -> RawCounts | None:
    if form.code == FLOAT:
        return None
    return RawCounts(_stored(path, at, form, channel, start, stop), 2.0 ** (1 - form.bits), 0.0, "")
