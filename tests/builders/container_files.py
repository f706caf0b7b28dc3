"""Container files, tiny, built from bytes or by the formats' own libraries."""

from __future__ import annotations

import io
import struct
from typing import Any

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


def small_wave(*before: bytes) -> bytes:
    samples = np.arange(-20, 20, dtype="<i2").reshape(20, 2) * 100
    return wave_file(wave_format(1, 2, 48000, 16), samples.tobytes(), *before)


def hdf5_file(fill: Any, **options: Any) -> bytes:
    """Return the bytes of an HDF5 file that `fill` writes into."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", **options) as file:
        fill(file)
    return buffer.getvalue()


def small_hdf5() -> bytes:
    def fill(file: Any) -> None:
        group = file.create_group("AI")
        for name, unit, values in (("acc", "m/s2", ramp(20)), ("p", "MPa", ramp(20) ** 2)):
            data = group.create_dataset(name, data=values)
            data.attrs["unit"] = unit
            data.attrs["sample_rate"] = 20000.0
        slow = file.create_group("slow")
        slow.create_dataset("time", data=np.array([0.0, 0.1, 0.25, 0.3]))
        slow.create_dataset("temperature", data=np.array([20.0, 21.0, 22.0, 21.5]))

    return hdf5_file(fill, libver="latest")


def npy_file(array: NDArray[Any]) -> bytes:
    """Return the bytes of NumPy's own file of an array."""
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def small_npy(count: int = 40) -> bytes:
    return npy_file(np.column_stack([np.arange(count) / 1000.0, ramp(count)[::-1], 3.0 - ramp(count) ** 2]))


def mat_file(variables: dict[str, Any], *, compressed: bool = False) -> bytes:
    """Return the bytes of a version 5 file that scipy writes; each variable a column."""
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, variables, do_compression=compressed, oned_as="column")
    return buffer.getvalue()


def mat_v73_file(variables: dict[str, NDArray[Any]]) -> bytes:
    def fill(file: Any) -> None:
        for name, values in variables.items():
            data = file.create_dataset(name, data=np.atleast_2d(values))
            data.attrs["MATLAB_class"] = np.bytes_(
                b"double" if values.dtype.kind == "f" else values.dtype.name.encode()
            )

    content = bytearray(hdf5_file(fill, userblock_size=512))
    text = b"MATLAB 7.3 MAT-file, Platform: PCWIN64, Created on: Mon Aug 03 12:23:05 2026 HDF5 schema 1.00 ."
    content[:128] = text.ljust(116) + b"\0" * 8 + b"\x00\x02IM"
    return bytes(content)


def dewesoft_variables(count: int = 16) -> dict[str, Any]:
    """Two channels at 20 kHz and one at 10 Hz, in Dewesoft's naming."""
    return {
        "Sample_rate": 20000.0,
        "File_name": "shot_0001.dxd",
        "Data1_time_AI_1": np.arange(count) / 20000.0,
        "Data1_AI_1": ramp(count),
        "Data1_time_Temp": np.arange(5) / 10.0,
        "Data1_Temp": 20.0 + ramp(5),
    }


def element_ends(content: bytes) -> set[int]:
    """Return the places between the variables of a version 5 file."""
    ends, at = set(), 128
    while at < len(content):
        ends.add(at)
        at += 8 + int(struct.unpack_from("<I", content, at + 4)[0])
    return ends


def tdms_file(
    *segments: list[tuple[str, str, NDArray[Any], dict[str, Any]]], root: dict[str, Any] | None = None
) -> bytes:
    """Return the bytes of a file that npTDMS writes: (group, channel, data, properties) per segment."""
    from nptdms import ChannelObject, RootObject, TdmsWriter

    buffer = io.BytesIO()
    with TdmsWriter(buffer) as writer:
        for segment in segments:
            objects = [ChannelObject(group, name, data, properties) for group, name, data, properties in segment]
            writer.write_segment([RootObject(root or {}), *objects])
    return buffer.getvalue()


def small_tdms(**said: Any) -> bytes:
    started = np.datetime64("2026-08-03T12:23:05.123456", "us")
    wave = {"wf_increment": 5e-5, "wf_start_offset": 0.0, "wf_start_time": started, "wf_samples": 1}
    acc = wave | {"unit_string": "m/s2"} | said
    first = [("AI", "acc", ramp(12), acc), ("AI", "n", np.arange(12, dtype=np.int16), wave)]
    return tdms_file(first, [("AI", "acc", ramp(8), {}), ("AI", "n", np.arange(12, 20, dtype=np.int16), {})])


def tdms_ends(content: bytes) -> set[int]:
    """Return the places between the segments."""
    ends, at = set(), 0
    while at < len(content):
        ends.add(at)
        at += 28 + int(struct.unpack_from("<Q", content, at + 12)[0])
    return ends


def uff_header(
    count: int, *, function: int = 1, ordinate: int = 4, even: bool = True, step: str = "5.00000E-04",
    unit: bytes = b"m/s2", entity: str = "acc", kind: int = 17,
) -> bytes:  # fmt: skip
    ids = "".join(f"{text:<80}\n" for text in ("NONE", "NONE", "03-Aug-26 12:23:05", "NONE", "NONE"))
    degree = f"{function:5d}{0:10d}{0:5d}{0:10d} {entity:<10}{1:10d}{3:4d} {'NONE':<10}{0:10d}{0:4d}\n"
    form = f"{ordinate:10d}{count:10d}{int(even):10d}{'0.00000E+00':>13}{step:>13}{'0.00000E+00':>13}\n"
    axis = f"{kind:10d}{0:5d}{0:5d}{0:5d} {'time':<20} {'s':<20}\n"
    values = f"{12:10d}{0:5d}{0:5d}{0:5d} {'Acceleration':<20} ".encode() + unit.ljust(20) + b"\n"
    none = f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {'NONE':<20}\n"
    return (ids + degree + form + axis).encode() + values + (none + none).encode()


def uff_text(
    values: NDArray[np.float64], *, per_line: int = 4, exponent: str = "E", blank: bytes = b"", **header: Any
) -> bytes:
    count = values.size // (1 if header.get("even", True) else 2)
    lines = [values[i : i + per_line] for i in range(0, values.size, per_line)]
    text = "".join("".join(f"{v:20.12E}".replace("E", exponent) for v in line) + "\n" for line in lines)
    return b"    -1\n    58\n" + uff_header(count, **header) + text.encode() + blank + b"    -1\n"


def uff_binary(
    values: NDArray[Any], *, big_endian: bool = False, blank: bytes = b"\n", form: int = 2, **header: Any
) -> bytes:
    data = values.astype(values.dtype.newbyteorder(">" if big_endian else "<")).tobytes()
    count = values.size // (1 if header.get("even", True) else 2)
    line = f"    58b{2 if big_endian else 1:6d}{form:6d}{11:12d}{len(data):12d}{0:6d}{0:6d}{0:12d}{0:12d}\n"
    return b"    -1\n" + line.encode() + uff_header(count, **header) + data + blank + b"    -1\n"


def mdf_file(*groups: list[Any], started: Any = None, compression: int = 0, version: str = "4.10") -> bytes:
    """Return the bytes of a file that asammdf writes: signals that share their time per group."""
    from pathlib import Path
    from tempfile import TemporaryDirectory

    from asammdf import MDF

    with TemporaryDirectory() as folder, MDF(version=version) as mdf:
        if started is not None:
            mdf.start_time = started
        for signals in groups:
            mdf.append(signals)
        saved = mdf.save(Path(folder) / "a.mf4", overwrite=True, compression=compression)
        return Path(saved).read_bytes()


def small_mdf(remark: str = "") -> bytes:
    from asammdf import Signal

    times = np.arange(12) / 1000.0
    acc = Signal(np.arange(12, dtype=np.int16), times, name="acc", unit="m/s2", conversion={"a": 0.5, "b": 1.0})
    p = Signal(ramp(12), times, name="p", unit="MPa", invalidation_bits=np.arange(12) == 3, comment=remark)
    return mdf_file([acc, p])
