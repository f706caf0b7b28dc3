"""Dewesoft's own library, run in a process of its own.

DWDataReaderLib is native code that was not made for damaged files: a fault of it ends the process that called it.
So it is called here, in a child, which writes what it finds into a folder: ``samples.bin``, float64 of one channel
behind the other, ``setup.xml``, and at last ``recording.json``. What the parent does not find there did not happen.

Facts about the library (version 5.0.6 in dwdatareader 1.3.0) that this module heeds, all of them measured:

- times count from ``start_measure_time``, not from the start of storing;
- ``scaled()`` with time arguments counts from another zero and loses samples by rounding: it is called without;
- CAN channels are refused with status 10, one by one; nothing of the others is lost;
- asynchronous channels hold repeated stamps.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

SAMPLES, SETUP, RECORDING = "samples.bin", "setup.xml", "recording.json"
SYNC, ASYNC, SINGLE = 0, 1, 2
NUMBERS = 9
"""Data types below this are plain numbers; complex numbers, texts, CAN frames and bytes follow."""
UNIFORM = 0.01
"""Steps of time that stay this near to the sample rate's grid, in steps, are the grid."""
SAMPLES_PER_BYTE = 8
"""Samples per byte of a file at most: its smallest sample is one bit."""
SPARE_SAMPLES = 1_000_000
_SPARE_MEMORY = 4 << 30


def main(path: str, folder: str) -> int:
    """Read a file and write what is in it; 0 if it could be read."""
    _limit_memory(Path(path).stat().st_size)
    out = Path(folder)
    try:
        import dwdatareader
    except Exception as error:  # the library may fail to load in many ways, and all mean the same
        found: dict[str, Any] = {"no_library": f"{type(error).__name__}: {error}"}
    else:
        try:
            with (out / SAMPLES).open("wb") as samples, dwdatareader.DWFile(path) as file:
                found = _recording(file, samples, out / SETUP, Path(path).stat().st_size)
            found["version"] = dwdatareader.get_version()
        except Exception as error:  # whatever it is, the parent must hear of it
            found = {"refused": _said(error)}
    (out / RECORDING).write_text(json.dumps(found), encoding="utf-8", newline="\n")
    return 0


def _limit_memory(size: int) -> None:
    """Keep a damaged count from taking all memory, where the system can."""
    try:
        import resource
    except ImportError:
        return
    # in float64 with its stamps, a file of 16-bit samples takes eight times its size, and the library as much again
    limit = _SPARE_MEMORY + 32 * size
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    if hard == resource.RLIM_INFINITY or limit < hard:
        resource.setrlimit(resource.RLIMIT_AS, (limit, hard))


def _said(error: BaseException) -> str:
    message = str(getattr(error, "message", "")) or str(error)
    status = getattr(error, "status", None)
    return f"{message} (status {int(status)})" if status is not None else f"{type(error).__name__}: {message}"


def _recording(file: Any, samples: BinaryIO, setup: Path, size: int) -> dict[str, Any]:
    channels, left = [], SAMPLES_PER_BYTE * size + SPARE_SAMPLES
    for key, channel in file.items():
        said: dict[str, Any] = {"name": key, "unit": channel.unit, "description": channel.description}
        try:
            said["long_name"] = channel.long_name
            left -= _read(channel, said, samples, left)
        except Exception as error:  # one channel must not take the others with it
            said["refused"] = _said(error)
        channels.append(said)
    found: dict[str, Any] = {
        "channels": channels,
        "sample_rate_hz": float(file.info.sample_rate),
        "start_measure_time": file.info.start_measure_time.replace(tzinfo=None).isoformat(),
        "start_store_time": file.info.start_store_time.replace(tzinfo=None).isoformat(),
        "duration_s": float(file.info.duration),
    }
    for key, ask in (
        ("storing_type", lambda: int(file.storing_type)),
        ("header", lambda: dict(file.header)),
        ("events", lambda: [[float(t), int(k), str(text)] for t, k, text in file.events().itertuples()]),
        ("setup", lambda: file.export_header(str(setup))),
    ):
        try:
            found[key] = ask()
        except Exception as error:  # not needed to read samples, but to be reported
            found.setdefault("failed", {})[key] = _said(error)
    return found


def _read(channel: Any, said: dict[str, Any], samples: BinaryIO, left: int) -> int:
    """Write one channel's samples and stamps; return how many samples these are."""
    kind, data_type = int(channel.channel_type), channel.data_type
    said["kind"], said["data_type"] = kind, data_type.name
    if int(data_type) >= NUMBERS or channel.array_size != 1:
        said["refused"] = f"{channel.array_size} numbers of type {data_type.name} per sample"
        return 0
    count = channel.number_of_samples
    if not 0 <= count <= left:
        said["refused"] = f"it says that it has {count} samples, more than the file can hold"
        return 0
    said["count"] = 0
    if not count:
        return 0
    times_s, values = channel.scaled()
    said["count"], said["at"] = int(values.size), samples.tell()
    rate_hz = float(channel.sample_rate) if kind == SYNC else 0.0
    if rate_hz > 0 and is_uniform(times_s, rate_hz):
        said["start_s"], said["rate_hz"] = float(times_s[0]), rate_hz
        samples.write(np.ascontiguousarray(values, "<f8").data)
    else:
        samples.write(np.ascontiguousarray(values, "<f8").data)
        samples.write(np.ascontiguousarray(times_s, "<f8").data)
    return int(values.size)


def is_uniform(times_s: NDArray[np.float64], rate_hz: float) -> bool:
    """Return whether stamps are those of a rate without a gap."""
    if not np.isfinite(times_s).all():
        return False
    grid = times_s[0] + np.arange(times_s.size) / rate_hz
    return bool(np.abs(times_s - grid).max() * rate_hz <= UNIFORM)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
