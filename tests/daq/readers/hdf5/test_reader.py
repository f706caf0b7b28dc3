from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.hdf5.reader import Hdf5Reader
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import surest_claim
from tests.builders.container_files import hdf5_file, ramp


def opened(folder: Path, fill: Any, **options: Any) -> Recording:
    path = folder / "a.h5"
    path.write_bytes(hdf5_file(fill, **options))
    return Hdf5Reader().open(path, Declarations("dewetron"))


@pytest.mark.parametrize(
    ("name", "value"),
    [("sample_rate", 4000.0), ("Sample rate [Hz]", 4000), ("fs", "4000"), ("dt", 0.00025), ("wf_increment", 0.00025)],
)
@pytest.mark.parametrize("level", ["dataset", "group", "root"])
def test_the_rate_is_found_at_the_channel_and_above(name: str, value: Any, level: str, tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        data = file.create_dataset("AI/acc", data=ramp())
        {"dataset": data, "group": file["AI"], "root": file}[level].attrs[name] = value
        data.attrs["Units"] = "m/s²"

    recording = opened(tmp_path, fill)
    base = recording.time_base("AI/acc")
    assert (base.step_s, base.start_s) == (0.00025, 0.0)
    assert recording.signals[0].unit == "m/s²"
    assert recording.signals[0].metadata["time"] == f"attribute {name}"
    np.testing.assert_array_equal(recording.read("AI/acc"), ramp())


def test_a_start_offset_is_kept(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file.create_dataset("a", data=ramp()).attrs.update({"rate": 100.0, "t0": -0.5, "unit": "V"})

    assert opened(tmp_path, fill).time_base("a").start_s == -0.5


def test_channels_with_their_own_starts_keep_the_difference(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        for name, start in (("a", "2026-08-03T12:00:00.250+02:00"), ("b", "2026-08-03T12:00:00+02:00")):
            file.create_dataset(name, data=ramp()).attrs.update({"fs": 100.0, "start_time": start, "unit": "V"})

    recording = opened(tmp_path, fill)
    assert recording.time_base("a").start_s == 0.25
    assert recording.time_base("b").start_s == 0.0
    start = recording.absolute_start
    assert start is not None
    assert (start.text, start.zone) == ("2026-08-03T12:00:00", "+02:00")
    assert any("start at different" in note for note in recording.notes)


def test_stamps_that_repeat_are_left_out_with_their_samples(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file["time"] = np.array([0.0, 0.1, 0.1, 0.3])
        file["time"].attrs["unit"] = "ms"
        file["a"] = np.array([1.0, 2.0, 3.0, 4.0])

    recording = opened(tmp_path, fill)
    np.testing.assert_allclose(recording.time_base("a").times_s, [0.0, 1e-4, 3e-4])
    np.testing.assert_array_equal(recording.read("a"), [1.0, 2.0, 4.0])
    assert any("1 of 4 stamps repeat" in note for note in recording.notes)


def test_scale_and_fill_value_of_netcdf_are_applied(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        data = file.create_dataset("a", data=np.array([1, 2, -9], np.int16))
        data.attrs.update({"scale_factor": 0.5, "add_offset": 10.0, "_FillValue": -9, "fs": 10.0, "units": "V"})

    recording = opened(tmp_path, fill)
    np.testing.assert_array_equal(recording.read("a"), [10.5, 11.0, np.nan])
    assert recording.raw("a") is None


def test_integers_with_an_unknown_scaling_are_named_and_left_out(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file.attrs["fs"] = 10.0
        file.create_dataset("counts", data=np.arange(5)).attrs["sensitivity"] = 9.81
        file.create_dataset("a", data=np.arange(5, dtype=np.int32)).attrs["unit"] = "V"
        file.create_dataset("table", data=np.zeros((3, 3)))
        file.create_dataset("words", data=np.array([b"a", b"b"]))
        file.create_dataset("never", shape=(10,), dtype="f8")
        file.create_dataset("partly", shape=(100,), chunks=(10,), dtype="f8")[:10] = 1.0

    recording = opened(tmp_path, fill)
    assert [s.name for s in recording.signals] == ["a"]
    for name in ("counts", "table", "words", "never", "partly: 1 of 10 blocks"):
        assert any(note.startswith(name) and note.endswith("left out") for note in recording.notes)
    raw = recording.raw("a")
    assert raw is not None
    assert raw.counts.dtype == np.int32


def test_two_time_datasets_of_one_length_are_not_chosen_from(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file["time"], file["timestamps"], file["a"] = np.arange(3.0), np.arange(3.0) * 2, np.ones(3)

    with pytest.raises(ReadError, match="2 time datasets have its length"):
        opened(tmp_path, fill)


def test_a_file_without_time_says_what_to_add(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=r"no time.*`sample_rate` \(Hz\)"):
        opened(tmp_path, lambda file: file.create_dataset("a", data=ramp()))


def test_a_shot_file_is_refused_with_the_command_that_reads_it(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file.attrs["schema"] = "recoil-daq/shot/1"

    with pytest.raises(ReadError, match="recoil-daq show"):
        opened(tmp_path, fill)


def test_links_to_other_files_are_not_followed(tmp_path: Path) -> None:
    import h5py

    def fill(file: Any) -> None:
        file.create_dataset("a", data=ramp()).attrs["fs"] = 10.0
        file["elsewhere"] = h5py.ExternalLink("other.h5", "/b")
        file["cycle"] = h5py.SoftLink("/")

    assert [s.name for s in opened(tmp_path, fill).signals] == ["a"]


def test_a_file_that_states_more_than_it_holds_is_not_read(tmp_path: Path) -> None:
    content = bytearray(hdf5_file(lambda f: f.create_dataset("a", data=ramp(300)).attrs.__setitem__("fs", 1.0)))
    path = tmp_path / "a.h5"
    path.write_bytes(content.replace((300).to_bytes(8, "little"), (2**40).to_bytes(8, "little")))
    with pytest.raises(ReadError, match=r"damaged|no time"):
        Hdf5Reader().open(path, Declarations("c"))


def test_matlab_files_and_cut_files_are_not_taken(tmp_path: Path) -> None:
    for block, name in ((b"MATLAB 7.3 MAT-file".ljust(512), "MATLAB"), (bytes(512), "HDF5"), (bytes(1 << 15), "HDF5")):
        assert [reader.name for reader in surest_claim(Head(block + b"\x89HDF\r\n\x1a\n"))[1]] == [name]
    path = tmp_path / "a.h5"
    path.write_bytes(hdf5_file(lambda f: f.create_dataset("a", data=ramp()))[:-10])
    with pytest.raises(CorruptFileError, match="truncated"):
        Hdf5Reader().open(path, Declarations("c"))


def test_an_axis_named_x_is_a_channel_and_no_time(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        for name in "xyz":
            file.create_dataset(name, data=ramp()).attrs.update({"fs": 10.0, "unit": "g"})
        file["time"] = np.arange(3.0)

    recording = opened(tmp_path, fill)
    assert [s.name for s in recording.signals] == ["x", "y", "z"]
    assert any(note.startswith("time: a time that no channel was given") for note in recording.notes)
