from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.hdf5.reader import Hdf5Reader
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import surest_claim
from tests.builders.container_files import hdf5_file, ramp
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file


def opened(folder: Path, fill: Any, **options: Any) -> Recording:
    return open_bytes(Hdf5Reader(), "a.h5", folder, hdf5_file(fill, **options))


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


@pytest.mark.parametrize(
    "attributes",
    [
        {"conversion_factor": 1e-3}, {"lsb": 0.5}, {"CoefA": 2.0}, {"calibration_factor": 3.0}, {"scaling_factor": 2.0},
        {"volts_per_bit": 1e-4}, {"polynomial_coefficients": np.array([0.0, 2.0])}, {"conversion": 2.0, "gain": 3.0},
        {"scale_factor": 2.0, "conversion": 3.0}, {"scale_factor": 0.0}, {"scale_factor": np.nan},
    ],
)  # fmt: skip
def test_integers_that_a_number_may_scale_are_left_out_under_any_name_of_it(
    tmp_path: Path, attributes: dict[str, Any]
) -> None:
    def fill(file: Any) -> None:
        file.attrs["fs"] = 10.0
        file.create_dataset("counts", data=np.arange(5)).attrs.update(attributes)
        file.create_dataset("a", data=np.arange(5)).attrs.update({"sensor_number": 4, "cutoff_hz": 1e3})

    recording = opened(tmp_path, fill)
    assert [s.name for s in recording.signals] == ["a"]
    assert any("whose meaning is open" in note for note in recording.notes)


def test_conversion_and_offset_of_nwb_are_applied(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        data = file.create_dataset("a", data=np.array([1, 2], np.int16))
        data.attrs.update({"conversion": 0.5, "offset": 10.0, "resolution": -1.0, "fs": 10.0, "unit": "V"})

    np.testing.assert_array_equal(opened(tmp_path, fill).read("a"), [10.5, 11.0])


def test_packed_times_are_unpacked(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file["a"] = np.arange(4.0)
        file.create_dataset("time", data=np.arange(4)).attrs.update({"scale_factor": 1e-3, "add_offset": 2.0})

    np.testing.assert_allclose(opened(tmp_path, fill).time_base("a").times_s, 2.0 + 1e-3 * np.arange(4))

    def scaled_somehow(file: Any) -> None:
        file["a"] = np.arange(4.0)
        file.create_dataset("time", data=np.arange(4)).attrs["gain"] = 1e-3

    with pytest.raises(ReadError, match="time has the attribute gain, whose meaning is open"):
        opened(tmp_path, scaled_somehow)


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


@pytest.mark.parametrize(
    ("attributes", "step_s"),
    [
        ({"sample_rate": "20 kHz"}, 5e-5), ({"sample_rate_kHz": 20.0}, 5e-5), ({"fs": 20.0, "fs_units": "kHz"}, 5e-5),
        ({"rate [kS/s]": 20}, 5e-5), ({"dt": "2 ms"}, 2e-3), ({"dt_ms": 2.0}, 2e-3),
        ({"dt": 1, "dt_unit": "min"}, 60.0),
        ({"wf_increment": 2.0, "wf_xunit_string": "ms"}, 2e-3), ({"sample_interval_us": 50}, 5e-5),
        ({"xincrement": 1.0, "xunit": "us"}, 1e-6), ({"time_step": 0.5, "time_units": "h"}, 1800.0),
    ],
)  # fmt: skip
def test_rates_and_steps_are_in_the_unit_that_is_stated(
    attributes: dict[str, Any], step_s: float, tmp_path: Path
) -> None:
    base = opened(tmp_path, lambda f: f.create_dataset("a", data=ramp()).attrs.update(attributes)).time_base("a")
    assert base.step_s == pytest.approx(step_s, rel=1e-12)


def test_an_offset_is_in_the_unit_that_is_stated(tmp_path: Path) -> None:
    stated = {"rate": 100.0, "start_offset": -250.0, "start_offset_unit": "ms", "unit": "V"}
    base = opened(tmp_path, lambda f: f.create_dataset("a", data=ramp()).attrs.update(stated)).time_base("a")
    assert (base.start_s, base.step_s) == (-0.25, 0.01)


@pytest.mark.parametrize(
    ("attributes", "why"),
    [
        ({"sample_rate": 20.0, "sample_rate_unit": "rpm"}, "its sample_rate is in 'rpm', which is no unit of a rate"),
        ({"dt": "2 turns"}, "its dt is in 'turns', which is no unit of time"),
        ({"fs_kHz": 20.0, "fs_kHz_unit": "Hz"}, "its fs_kHz states its unit as 'kHz' and as 'Hz'"),
        ({"rate": 100.0, "t0": 1.0, "t0_unit": "V"}, "its t0 is in 'V'"),
    ],
)
def test_rates_in_no_known_unit_are_refused_by_name(attributes: dict[str, Any], why: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="no time in this file") as refused:
        opened(tmp_path, lambda f: f.create_dataset("a", data=ramp()).attrs.update(attributes))
    assert why in str(refused.value)


@pytest.mark.parametrize(
    ("name", "unit", "unit_s"),
    [("time", "min", 60.0), ("time", "h", 3600.0), ("time_min", "", 60.0), ("t_ns", "", 1e-9), ("Time [ms]", "", 1e-3),
     ("timestamps", "us", 1e-6), ("time_d", "", 86400.0)],
)  # fmt: skip
def test_a_dataset_of_times_is_in_the_unit_beside_it_or_in_its_name(
    name: str, unit: str, unit_s: float, tmp_path: Path
) -> None:
    def fill(file: Any) -> None:
        file.create_dataset(name, data=2.0 * np.arange(12)).attrs.update({"units": unit} if unit else {})
        file.create_dataset("a", data=ramp())

    assert opened(tmp_path, fill).time_base("a").step_s == pytest.approx(2.0 * unit_s, rel=1e-12)


def test_a_unit_that_the_name_of_a_time_contradicts_is_refused(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file.create_dataset("time_ms", data=np.arange(12.0)).attrs["units"] = "s"
        file.create_dataset("a", data=ramp())

    with pytest.raises(ReadError, match="time_ms states its unit as 's' and as 'ms'"):
        opened(tmp_path, fill)


def test_of_several_units_of_a_time_the_one_that_is_none_is_named(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file.create_dataset("time (turns)", data=np.arange(12.0)).attrs["units"] = "s"
        file.create_dataset("a", data=ramp())

    with pytest.raises(ReadError, match=r"time \(turns\) is in 'turns', which is no unit of time"):
        opened(tmp_path, fill)


def test_a_time_without_unit_that_contradicts_the_rate_of_its_group_is_refused(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file.attrs["sample_rate"] = 1000.0
        file.create_dataset("time", data=np.arange(12.0))
        file.create_dataset("a", data=ramp())

    with pytest.raises(ReadError, match=r"time steps by 1 s, attribute sample_rate says 0\.001 s: state the unit"):
        opened(tmp_path, fill)


def test_a_channel_without_start_among_different_ones_is_left_out(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        for name, start in (("a", "2026-08-03T12:00:00"), ("b", "2026-08-03T13:00:00"), ("c", None)):
            data = file.create_dataset(name, data=ramp())
            data.attrs.update({"fs": 100.0, "unit": "V"} | ({"start_time": start} if start else {}))

    recording = opened(tmp_path, fill)
    assert [recording.time_base(s.name).start_s for s in recording.signals] == [0.0, 3600.0]
    with pytest.raises(ReadError, match="'c' cannot be read; found states no start, and the others differ in theirs"):
        recording.read("c")


def test_records_are_read_field_by_field(tmp_path: Path) -> None:
    records = np.zeros(12, [("time", "<f8"), ("acc", "<f4"), ("n", "<i2"), ("label", "S4"), ("xyz", "<f8", (3,))])
    records["time"], records["acc"], records["n"] = np.arange(12) / 500, ramp(), np.arange(12)

    def fill(file: Any) -> None:
        data = file.create_dataset("run/table", data=records, chunks=(5,), compression="gzip")
        data.attrs.update({"time_units": "s", "acc_unit": "m/s2"})

    recording = opened(tmp_path, fill)
    assert [(s.name, s.unit) for s in recording.signals] == [("run/table/acc", "m/s2"), ("run/table/n", "")]
    np.testing.assert_array_equal(recording.read("run/table/acc"), ramp())
    np.testing.assert_array_equal(recording.read("run/table/n", 3, 7), np.arange(3, 7))
    assert recording.time_base("run/table/n").step_s == 0.002
    raw = recording.raw("run/table/n", 2, 4)
    assert raw is not None
    assert raw.counts.tolist() == [2, 3]
    assert any(note.startswith("run/table/label: not real numbers") for note in recording.notes)
    with pytest.raises(ReadError, match="'run/table/xyz' cannot be read; found not real numbers"):
        recording.read("run/table/xyz")


def test_records_without_a_time_take_the_rate_that_is_stated_of_them(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file.create_dataset("table", data=np.zeros(12, [("a", "<f8")])).attrs["fs"] = 100.0

    assert opened(tmp_path, fill).time_base("table/a").step_s == 0.01


@pytest.mark.parametrize("turned", [False, True])
def test_a_matrix_has_the_time_of_its_column_that_rises_or_that_beside_it(tmp_path: Path, turned: bool) -> None:
    times_s = np.arange(40) * 2e-3
    values = np.column_stack([np.sin(50 * times_s), times_s, np.cos(times_s)])

    def fill(file: Any) -> None:
        file["own"] = values.T if turned else values
        group = file.create_group("g")
        group["time"], group["m"] = times_s / 2, values[:, [0, 2]].T if turned else values[:, [0, 2]]

    recording = opened(tmp_path, fill)
    assert [one.name for one in recording.signals] == ["g/m/column_1", "g/m/column_2", "own/column_1", "own/column_3"]
    assert recording.time_base("own/column_3").step_s == pytest.approx(2e-3)
    assert recording.time_base("g/m/column_1").step_s == pytest.approx(1e-3)
    np.testing.assert_array_equal(recording.read("own/column_3", 3, 7), values[3:7, 2])


def test_times_since_a_date_are_dated_as_cf_has_it(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file["a"] = ramp()
        file.create_dataset("time", data=np.arange(12) * 5).attrs["units"] = "milliseconds since 2026-08-03 12:23:05"

    recording = opened(tmp_path, fill)
    assert recording.time_base("a").step_s == pytest.approx(5e-3)
    assert recording.absolute_start == AbsoluteStart("2026-08-03T12:23:05", "unknown", "unit of the times")


def test_a_starting_time_with_a_rate_dates_its_group_as_nwb_has_it(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        group = file.create_group("acquisition/pressure")
        group["data"], group["starting_time"] = ramp(), 2.5
        group["starting_time"].attrs.update({"rate": 1000.0, "unit": "seconds"})

    base = opened(tmp_path, fill).time_base("acquisition/pressure/data")
    assert (base.start_s, base.step_s) == (2.5, pytest.approx(1e-3))


def test_every_code_of_a_lost_sample_counts(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        data = file.create_dataset("a", data=np.array([1.0, -999.0, 3.0, -9999.0, -1.0]))
        data.attrs.update({"fs": 10.0, "unit": "V", "_FillValue": -999.0, "missing_value": [-9999.0, -1.0]})

    np.testing.assert_array_equal(np.isnan(opened(tmp_path, fill).read("a")), [False, True, False, True, True])


def test_samples_of_a_filter_that_is_not_at_hand_are_told_before_they_are_read(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file.create_dataset("b", data=ramp(), chunks=(12,), shuffle=True).attrs["fs"] = 100.0
        file.create_dataset("a", data=ramp()).attrs["fs"] = 100.0

    content = hdf5_file(fill)
    number_at = content.index(b"shuffle") - 8
    assert content[number_at : number_at + 2] == b"\x02\x00"
    path = tmp_path / "a.h5"
    nobodys = next(number for number in range(40000, 65536) if not h5py.h5z.filter_avail(number))
    path.write_bytes(content[:number_at] + nobodys.to_bytes(2, "little") + content[number_at + 2 :])
    recording = Hdf5Reader().open(path, Declarations("dewetron"))
    assert [s.name for s in recording.signals] == ["a"]
    with pytest.raises(
        ReadError, match=r"'b' cannot be read; found packed by the filter shuffle, which is not at hand"
    ):
        recording.read("b")


def test_the_reported_table_of_records_gives_its_values_at_its_times() -> None:
    recording = Hdf5Reader().open(shared_file("reports/h5_compound.h5"), Declarations("dewetron"))
    np.testing.assert_allclose(recording.read("table/acc"), np.sin(50 * np.arange(100) / 1000), atol=1e-12)
    assert recording.time_base("table/acc").step_s == pytest.approx(1e-3)


def test_an_enumeration_is_words_and_no_numbers(tmp_path: Path) -> None:
    words = h5py.enum_dtype({"ok": 0, "not available": 255}, basetype="u1")
    row = np.dtype([("x", "f8"), ("state", words)])

    def fill(file: Any) -> None:
        file.attrs["fs"] = 1000.0
        file["acc"], file["beside"] = ramp(), ramp() > 3
        file.create_dataset("state", data=np.array([0, 255] * 6, "u1"), dtype=words)
        file["rows"] = np.zeros(12, row)

    recording = opened(tmp_path, fill)
    assert [header.name for header in recording.signals] == ["acc", "beside", "rows/x"]
    assert "state: an enumeration ('not available', 'ok'): left out" in recording.notes
    with pytest.raises(ReadError, match="an enumeration"):
        recording.read("rows/state")


def test_values_that_stand_for_words_of_a_flag_are_told(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        file.attrs["fs"] = 1000.0
        file["quality"] = ramp()
        file["quality"].attrs["flag_values"] = np.array([0, 255], "u1")
        file["quality"].attrs["flag_meanings"] = "good not_available"

    assert any("flag_values = 0, 255" in note for note in opened(tmp_path, fill).notes)
