"""Chunks of a RIFF, RF64 or BW64 file that holds sound samples (WAVE).

Layout: Microsoft and IBM, *Multimedia Programming Interface and Data Specifications 1.0* (RIFF,
WAVE, INFO); Microsoft's ``WAVEFORMATEXTENSIBLE``; EBU Tech 3285 (``bext``); EBU Tech 3306 and ITU-R
BS.2088 (RF64, BW64: ``ds64`` holds the sizes that do not fit 32 bits).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO

FORMAT, SAMPLES = b"fmt ", b"data"
"""Names of the chunks of the format and of the samples."""
FORMS = (b"RIFF", b"RF64", b"BW64")
LARGE = 0xFFFFFFFF
"""Size that stands for one in ``ds64``, or for one that the writer never came to fill in."""

PCM, FLOAT, EXTENSIBLE = 1, 3, 0xFFFE
_GUID_TAIL = bytes.fromhex("000000001000800000aa00389b71")
SMALL_CHUNK_BYTES = 65536
"""Bytes that are read of a chunk that is not sound."""


@dataclass(frozen=True)
class SoundFormat:
    """The ``fmt`` chunk.

    Attributes
    ----------
    code
        Coding, `PCM` or `FLOAT`, or one that is not covered.
    channels, bits, frame_bytes
        Number of channels, bits of the container of one sample, and bytes of one sample of all channels.
    valid_bits
        Bits that carry the value, at the upper end of the container.
    """

    code: int
    channels: int
    rate_hz: int
    frame_bytes: int
    bits: int
    valid_bits: int


@dataclass(frozen=True)
class Chunk:
    """One chunk: its name, where its content begins, the size that it states."""

    name: bytes
    start: int
    size: int


def is_wave(head: bytes) -> bool:
    """Return whether a file begins as WAVE."""
    return head[:4] in FORMS and head[8:12] == b"WAVE"


def iter_chunks(file: IO[bytes], file_size: int) -> Iterator[Chunk]:
    """Walk the chunks of a file up to its end; the last may state more than there is."""
    file.seek(0)
    form = file.read(12)[:4]
    sizes: dict[bytes, int] = {}
    at = 12
    while at + 8 <= file_size:
        file.seek(at)
        name, size = struct.unpack("<4sI", file.read(8))
        if form != b"RIFF" and name == b"ds64":
            sizes = _large_sizes(file.read(min(size, SMALL_CHUNK_BYTES)))
        if size == LARGE:
            size = sizes.get(name, file_size)
        yield Chunk(name, at + 8, size)
        at += 8 + size + size % 2


def _large_sizes(content: bytes) -> dict[bytes, int]:
    if len(content) < 28:
        return {}
    _, data, _, count = struct.unpack_from("<QQQI", content)
    rows = range(28, min(len(content), 28 + 12 * count) - 11, 12)
    return {SAMPLES: data} | dict(struct.unpack_from("<4sQ", content, at) for at in rows)


def parse_format(content: bytes) -> SoundFormat:
    """Parse a ``fmt`` chunk.

    Raises
    ------
    ValueError
        If it is too short, or contradicts itself.
    """
    if len(content) < 16:
        raise ValueError(f"a fmt chunk of {len(content)} bytes, not at least 16")
    code, channels, rate_hz, _, frame_bytes, bits = struct.unpack_from("<HHIIHH", content)
    valid_bits, bits = bits, (bits + 7) // 8 * 8
    if code == EXTENSIBLE:
        if len(content) < 40:
            raise ValueError(f"an extensible fmt chunk of {len(content)} bytes, not 40")
        stated_bits, _, code = struct.unpack_from("<HIH", content, 18)
        if content[26:40] != _GUID_TAIL:
            raise ValueError("a fmt chunk whose sub-format is not of WAVE")
        valid_bits = stated_bits or valid_bits
    if code not in (PCM, FLOAT):
        return SoundFormat(code, channels, rate_hz, frame_bytes, bits, valid_bits)  # of another coding's frames
    if not channels or not rate_hz or frame_bytes != channels * bits // 8 or not 0 < valid_bits <= bits:
        raise ValueError(
            f"{channels} channels of {bits} bits ({valid_bits} valid) in frames of {frame_bytes} bytes at {rate_hz} Hz"
        )
    return SoundFormat(code, channels, rate_hz, frame_bytes, bits, valid_bits)


def parse_info(content: bytes) -> dict[str, str]:
    """Parse the texts of a ``LIST`` chunk of type INFO; empty for other lists."""
    texts: dict[str, str] = {}
    at = 4 if content[:4] == b"INFO" else len(content)
    while at + 8 <= len(content):
        name, size = struct.unpack_from("<4sI", content, at)
        texts[name.decode("latin-1")] = _text(content[at + 8 : at + 8 + size])
        at += 8 + size + size % 2
    return texts


def parse_broadcast(content: bytes) -> dict[str, str | int]:
    """Parse the fixed part of a ``bext`` chunk; empty if it is too short."""
    if len(content) < 348:
        return {}
    ends = {"description": (0, 256), "originator": (256, 288), "originator_reference": (288, 320)}
    ends |= {"origination_date": (320, 330), "origination_time": (330, 338)}
    texts: dict[str, str | int] = {name: _text(content[a:b]) for name, (a, b) in ends.items()}
    return texts | {"time_reference_samples": struct.unpack_from("<Q", content, 338)[0]}


def _text(content: bytes) -> str:
    raw = content.split(b"\0")[0]
    try:
        return raw.decode("utf-8").strip()
    except UnicodeDecodeError:
        return raw.decode("latin-1").strip()
