"""Container files, tiny, built from bytes or by the formats' own libraries."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray


def ramp(count: int = 12) -> NDArray[np.float64]:
    """A ramp that no two samples share."""
    return 0.5 * np.arange(count, dtype=np.float64) - 2.0


def riff_chunk(name: bytes, content: bytes, size: int | None = None) -> bytes:
    return struct.pack("<4sI", name, len(content) if size is None else size) + content + b"\0" * (len(content) % 2)


def wave_format(code: int, channels: int, rate_hz: int, bits: int) -> bytes:
    frame = channels * bits // 8
    return struct.pack("<HHIIHH", code, channels, rate_hz, rate_hz * frame, frame, bits)


def wave_file(form: bytes, data: bytes, *before: bytes) -> bytes:
    body = b"WAVE" + b"".join(before) + riff_chunk(b"fmt ", form) + riff_chunk(b"data", data)
    return struct.pack("<4sI", b"RIFF", len(body)) + body


def rf64_file(form: bytes, data: bytes) -> bytes:
    sizes = struct.pack("<QQQI", 0, len(data), 0, 0)
    body = riff_chunk(b"ds64", sizes) + riff_chunk(b"fmt ", form) + riff_chunk(b"data", data, 0xFFFFFFFF)
    return struct.pack("<4sI", b"RF64", 0xFFFFFFFF) + b"WAVE" + body


def broadcast(date: bytes = b"2026-08-03", time: bytes = b"12:23:05", reference: int = 7) -> bytes:
    text = b"trial 3".ljust(256, b"\0") + b"recorder".ljust(32, b"\0") + b"\0" * 32
    return riff_chunk(b"bext", text + date + time + struct.pack("<Q", reference) + b"\0" * 256)


def small_wave() -> bytes:
    samples = np.arange(-20, 20, dtype="<i2").reshape(20, 2) * 100
    return wave_file(wave_format(1, 2, 48000, 16), samples.tobytes())
