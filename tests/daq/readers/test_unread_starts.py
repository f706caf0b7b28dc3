"""A date that a file states and that is not the recording's start is named, in every format that has one."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import h5py
import nptdms
import numpy as np
import pytest
import scipy.io

from recoil_acquisition.readers.hdf5.reader import Hdf5Reader
from recoil_acquisition.readers.mat.reader import MatReader
from recoil_acquisition.readers.reader import Declarations, Reader
from recoil_acquisition.readers.tdms.reader import TdmsReader
from recoil_acquisition.readers.text.oscilloscope import LECROY
from recoil_acquisition.readers.uff.reader import UffReader

VALUES = np.linspace(0.0, 1.0, 12)


def hdf5(date: str | float) -> bytes:
    target = io.BytesIO()
    with h5py.File(target, "w") as file:
        file.attrs["start_time"] = date
        file.create_dataset("acc", data=VALUES).attrs.update({"units": "g", "sample_rate": 1e3})
    return target.getvalue()


def mat(date: str) -> bytes:
    target = io.BytesIO()
    scipy.io.savemat(target, {"acc": VALUES, "Sample_rate": 1e3, "start_time": date})
    return target.getvalue()


def tdms(date: str) -> bytes:
    target = io.BytesIO()
    properties = {"wf_increment": 1e-3, "unit_string": "g", "wf_start_time": date}
    with nptdms.TdmsWriter(target) as writer:
        writer.write_segment([nptdms.ChannelObject("g", "acc", VALUES, properties)])
    return target.getvalue()


def uff(date: str) -> bytes:
    none = f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {'NONE':20s}"
    lines = [
        "    -1", "    58", "acc", "NONE", date, "NONE", "NONE",
        f"{1:5d}{0:10d}{1:5d}{0:10d} {'NONE':10s}{1:10d}{1:4d} {'NONE':10s}{0:10d}{0:4d}",
        f"{2:10d}{12:10d}{1:10d}{0.0:13.5e}{1e-3:13.5e}{0.0:13.5e}",
        f"{17:10d}{0:5d}{0:5d}{0:5d} {'Time':20s} {'s':20s}", f"{12:10d}{0:5d}{0:5d}{0:5d} {'acc':20s} {'g':20s}",
        none, none, *("".join(f"{v:13.5e}" for v in VALUES[i : i + 6]) for i in (0, 6)), "    -1", "",
    ]  # fmt: skip
    return "\n".join(lines).encode()


def lecroy(date: str) -> bytes:
    rows = "".join(f"{1e-3 * i:.3f},{v:.4f}\n" for i, v in enumerate(VALUES))
    head = "LECROYWR44Xi,1,Waveform\nSegments,1,SegmentSize,12\nSegment,TrigTime,TimeSinceSegment1\n"
    return f"{head}#1,{date},0\nTime,Ampl\n{rows}".encode()


FORMATS: list[tuple[Reader, str, Callable[[str], bytes]]] = [
    (Hdf5Reader(), "a.h5", hdf5),
    (MatReader(), "a.mat", mat),
    (TdmsReader(), "a.tdms", tdms),
    (UffReader(), "a.uff", uff),
    (LECROY, "a.csv", lecroy),
]


@pytest.mark.parametrize(("reader", "name", "content"), FORMATS, ids=[name for _, name, _ in FORMATS])
@pytest.mark.parametrize(
    ("date", "why"),
    [
        ("03/04/2024 10:00:00", "which is 2024-03-04 or 2024-04-03: the start is not known"),
        ("03/04/24 10:00:00", "which is not understood: the start is not known"),
    ],
)
def test_a_date_of_open_order_is_no_start_and_is_named(
    tmp_path: Path, reader: Reader, name: str, content: Callable[[str], bytes], date: str, why: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content(date))
    recording = reader.open(path, Declarations("dewetron"))
    assert recording.absolute_start is None
    (said,) = [note for note in recording.notes if date in note]
    assert said.endswith(why)


@pytest.mark.parametrize(("reader", "name", "content"), [FORMATS[0], FORMATS[3]], ids=["hdf5", "uff"])
@pytest.mark.parametrize("date", ["03.04.2024 10:00:00", "2024-04-03 10:00:00", "2024/04/03 10:00:00"])
def test_a_date_whose_order_is_told_is_the_start(
    tmp_path: Path, reader: Reader, name: str, content: Callable[[str], bytes], date: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content(date))
    start = reader.open(path, Declarations("dewetron")).absolute_start
    assert start is not None
    assert start.text == "2024-04-03T10:00:00"


def notes_of(path: Path, start: float) -> list[str]:
    path.write_bytes(hdf5(start))
    return [str(note) for note in Hdf5Reader().open(path, Declarations("dewetron")).notes]


@pytest.mark.parametrize("start", [1.7e9, 1_700_000_000_123, np.int64(1_700_000_000_123_456_789)])
def test_a_start_that_is_counted_since_1970_is_named(tmp_path: Path, start: float) -> None:
    (told,) = (note for note in notes_of(tmp_path / "a.h5", start) if "states start_time = '17000000" in note)
    assert told.endswith("which is not understood: the start is not known")


def test_a_small_number_by_the_name_of_a_start_is_no_date(tmp_path: Path) -> None:
    assert not any("the start is not known" in note for note in notes_of(tmp_path / "a.h5", 12.5))
