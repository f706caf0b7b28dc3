from __future__ import annotations

import gc
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.uff.reader import UffReader
from recoil_acquisition.remark import Caution, CautionCode
from tests.builders.container_files import ramp, uff_binary, uff_text
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file

opened = partial(open_bytes, UffReader(), "a.uff")


# pyuff leaves the file open when it writes binary values, and would begin it anew with "overwrite"
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
@pytest.mark.parametrize("binary", [0, 1])
def test_what_pyuff_writes_is_read(binary: int, tmp_path: Path) -> None:
    import pyuff

    path = tmp_path / "a.uff"
    dataset = pyuff.prepare_58(
        binary=binary, func_type=1, rsp_node=3, rsp_dir=1, ref_dir=1, ref_node=3, data=ramp(50), x=np.arange(50) / 2000,
        rsp_ent_name="acc", abscissa_spec_data_type=17, abscissa_axis_units_lab="s", abscissa_spacing=1,
        ordinate_axis_units_lab="m/s2", orddenom_spec_data_type=0, z_axis_spec_data_type=0,
    )  # fmt: skip
    pyuff.UFF(str(path)).write_sets(dataset, "add")
    gc.collect()
    recording = UffReader().open(path, Declarations("dewetron"))
    assert [(s.name, s.unit, s.sample_count) for s in recording.signals] == [("acc", "m/s2", 50)]
    np.testing.assert_allclose(recording.read("acc"), ramp(50), rtol=1e-11)
    assert recording.time_base("acc").step_s == 5e-4


@settings(max_examples=30, deadline=None)
@given(
    values=st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=1, max_size=20),
    big_endian=st.booleans(),
    width=st.sampled_from([4, 8]),
)
def test_binary_values_come_back_as_they_are(
    values: list[float], big_endian: bool, width: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    data = np.array(values, f"f{width}")
    content = uff_binary(data, big_endian=big_endian, ordinate=2 if width == 4 else 4)
    recording = opened(tmp_path_factory.mktemp("u"), content)
    np.testing.assert_array_equal(recording.read("acc"), data.astype(float))


@pytest.mark.parametrize("exponent", ["E", "e", "D", "d"])
@pytest.mark.parametrize("blank", [b"", b"\n", b"   \n\n"])
def test_exponents_and_blank_lines_of_every_writer_are_read(exponent: str, blank: bytes, tmp_path: Path) -> None:
    content = uff_text(ramp(), exponent=exponent, blank=blank) + b"\n" + uff_text(ramp(5), entity="p")
    recording = opened(tmp_path, content)
    np.testing.assert_array_equal(recording.read("acc"), ramp())
    np.testing.assert_array_equal(recording.read("p", 1, 4), ramp(5)[1:4])
    binary = opened(tmp_path, uff_binary(ramp(), blank=b"\n" + blank) + uff_binary(ramp(5), entity="p"))
    np.testing.assert_array_equal(binary.read("p"), ramp(5))


@pytest.mark.parametrize("write", [uff_text, uff_binary])
def test_an_uneven_abscissa_is_stamps(write: Any, tmp_path: Path) -> None:
    times, values = np.array([0.0, 0.1, 0.25, 0.3]), ramp(4)
    recording = opened(tmp_path, write(np.column_stack((times, values)).ravel(), even=False))
    np.testing.assert_array_equal(recording.time_base("acc").times_s, times)
    np.testing.assert_array_equal(recording.read("acc"), values)


def test_single_times_beside_double_values_are_read(tmp_path: Path) -> None:
    rows = np.array([(0.0, 1.5), (0.5, 2.5), (2.0, 3.5)], np.dtype([("x", "<f4"), ("y", "<f8")]))
    plain = uff_binary(np.zeros(3), even=True)
    content = plain.replace(b"         3         1", b"         3         0").replace(
        np.zeros(3).tobytes(), rows.tobytes()
    )
    recording = opened(tmp_path, content)
    np.testing.assert_array_equal(recording.time_base("acc").times_s, rows["x"])
    np.testing.assert_array_equal(recording.read("acc"), rows["y"])


def test_spectra_complex_values_and_other_datasets_are_named_and_left_out(tmp_path: Path) -> None:
    content = (
        b"    -1\n   151\nname\n    -1\n"
        + uff_text(ramp(), function=4, entity="frf")
        + uff_binary(ramp(), ordinate=6, entity="z").replace(b"        12         1", b"         6         1")
        + uff_text(ramp(), kind=18, entity="hz")
        + uff_text(ramp())
    )
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["acc"]
    for text in (
        "dataset 151 at byte 0",
        "frf: a frequency response",
        "z: complex values",
        "hz: an abscissa of type 18",
    ):
        assert any(note.startswith(text) and note.endswith("left out") for note in recording.notes)


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8"])
def test_units_beyond_ascii_are_read_and_told(encoding: str, tmp_path: Path) -> None:
    recording = opened(tmp_path, uff_text(ramp(), unit="µm/s²".encode(encoding)))
    assert recording.signals[0].unit == "µm/s²"
    assert any("beyond ASCII" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("printed", "expected"),
    [
        ("03-Aug-26 12:23:05", "2026-08-03T12:23:05"),
        ("23-MAR-17 19:02:23", "2017-03-23T19:02:23"),
        ("03-Aug-99 12:23:05", "1999-08-03T12:23:05"),
        ("31-Feb-26 12:23:05", None),
        ("NONE", None),
    ],
)
def test_the_date_of_the_datasets_is_the_start_in_no_known_zone(
    printed: str, expected: str | None, tmp_path: Path
) -> None:
    content = uff_text(ramp()).replace(b"03-Aug-26 12:23:05", printed.encode().ljust(18))
    start = opened(tmp_path, content + content).absolute_start
    if expected is None:
        assert start is None
        return
    assert start is not None
    assert (start.text, start.zone) == (expected, "unknown")


@pytest.mark.parametrize("other", [b"03-Aug-26 12:23:06", b"NONE".ljust(18)])
def test_dates_that_do_not_agree_are_told_and_none_is_taken(other: bytes, tmp_path: Path) -> None:
    content = uff_text(ramp())
    further = uff_text(ramp(), entity="p").replace(b"03-Aug-26 12:23:05", other)
    recording = opened(tmp_path, content + further)
    assert recording.absolute_start is None
    assert any(note.startswith("not all datasets state the same date (03-Aug-26 12:23:05") for note in recording.notes)
    cautions = [note.code for note in recording.notes if isinstance(note, Caution)]
    assert cautions == ([] if other.startswith(b"NONE") else [CautionCode.OTHER_STARTS])


def test_equal_names_are_told_apart_by_node_and_direction(tmp_path: Path) -> None:
    recording = opened(tmp_path, uff_text(ramp()) + uff_text(ramp(5)))
    assert [s.name for s in recording.signals] == ["acc 1 3", "acc 1 3#2"]


def test_a_cut_dataset_is_left_out_and_told(tmp_path: Path) -> None:
    content = uff_text(ramp()) + uff_binary(ramp(), entity="p")
    recording = opened(tmp_path, content[:-20])
    assert [s.name for s in recording.signals] == ["acc"]
    assert "cut off" in recording.incomplete
    with pytest.raises(CorruptFileError, match="cut off"):
        opened(tmp_path, uff_text(ramp())[:-8])


def test_missing_values_and_words_are_refused_with_their_dataset(tmp_path: Path) -> None:
    short = uff_text(ramp()[:10]).replace(b"        10         1", b"        12         1")
    with pytest.raises(CorruptFileError, match="10 values where it states 12"):
        opened(tmp_path, short)
    word = uff_text(ramp()).replace(b"-1.500000000000E+00", b"-1.5000000000x0E+00")
    with pytest.raises(CorruptFileError, match=r"'-1\.5000000000x0E\+00' in line 1 of the values is no number"):
        opened(tmp_path, word)
    recording = opened(tmp_path, short + uff_text(ramp(), entity="p"))
    assert [s.name for s in recording.signals] == ["p"]
    assert any("10 values where it states 12: left out" in note for note in recording.notes)
    with pytest.raises(ReadError, match=r"'acc' cannot be read; found .* 10 values where"):
        recording.read("acc")


def test_floating_point_of_other_computers_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="not in IEEE floating point"):
        opened(tmp_path, uff_binary(ramp(), form=1))


def test_a_coarsely_printed_step_is_told(tmp_path: Path) -> None:
    recording = opened(tmp_path, uff_binary(np.zeros(60000), step="1.52588E-05"))
    assert any("its step has 6 digits" in note for note in recording.notes)
    assert not any("digits" in note for note in opened(tmp_path, uff_binary(np.zeros(60000))).notes)


def test_real_files_are_read_or_refused_by_design() -> None:
    def read(name: str) -> Recording:
        return UffReader().open(shared_file(f"containers/{name}"), Declarations("dewetron"))

    sample = read("Sample_UFF58b_bin.uff")
    assert [(s.name, s.unit, s.sample_count) for s in sample.signals] == [("Mic 01", "Pa", 79292)]
    assert sample.time_base("Mic 01").step_s == 1.52588e-05
    assert np.abs(sample.read("Mic 01")).max() < 100
    sine = read("binary8byte.uff")
    assert [(s.name, s.unit, s.sample_count) for s in sine.signals] == [("sine 5 Hz", "g", 250)]
    np.testing.assert_allclose(sine.read("sine 5 Hz"), np.sin(2 * np.pi * 5 * np.arange(250) / 100), atol=1e-5)
    with pytest.raises(ReadError, match="a frequency response, not a time response"):
        read("non_ascii_header.uff")


def test_a_second_recording_of_a_channel_is_refused_with_its_date(tmp_path: Path) -> None:
    content = uff_text(ramp())
    with pytest.raises(ReadError, match=r"a second recording begins at 03-Aug-26 12:24:05: acc is in the file once"):
        opened(tmp_path, content + content.replace(b"03-Aug-26 12:23:05", b"03-Aug-26 12:24:05"))


@pytest.mark.parametrize(
    ("label", "unit", "unit_s"),
    [
        ("time", "ms", 1e-3), ("time", "us", 1e-6), ("time", "min", 60.0), ("time", "h", 3600.0), ("Zeit", "", 1.0),
        ("NONE", "NONE", 1.0), ("time", "sec", 1.0),
    ],
)  # fmt: skip
@pytest.mark.parametrize("kind", [17, 0])
@pytest.mark.parametrize("even", [True, False])
def test_the_abscissa_is_in_the_unit_that_is_stated(
    label: str, unit: str, unit_s: float, kind: int, even: bool, tmp_path: Path
) -> None:
    values = ramp(4) if even else np.column_stack((0.5 * np.arange(4.0), ramp(4))).ravel()
    content = uff_text(values, even=even, step="5.00000E-01", kind=kind).replace(
        f"{'time':<20} {'s':<20}".encode(), f"{label:<20} {unit:<20}".encode()
    )
    np.testing.assert_allclose(opened(tmp_path, content).time_base("acc").times_s, unit_s * 0.5 * np.arange(4))


@pytest.mark.parametrize(
    ("label", "unit", "why"),
    [("Frequency", "Hz", "'Frequency' in 'Hz', not time"), ("time", "turns", "'turns', which is no unit of time"),
     ("Crank angle", "", "'Crank angle', not time"), ("load case", "", "without a unit of time")],
)  # fmt: skip
def test_an_abscissa_that_is_no_time_is_refused_by_name(label: str, unit: str, why: str, tmp_path: Path) -> None:
    other = uff_text(ramp(), kind=0, entity="q").replace(
        f"{'time':<20} {'s':<20}".encode(), f"{label:<20} {unit:<20}".encode()
    )
    with pytest.raises(ReadError, match=why):
        opened(tmp_path, other)
    recording = opened(tmp_path, other + uff_text(ramp()))
    with pytest.raises(ReadError, match=f"signal 'q' cannot be read.*{why}"):
        recording.read("q")


TOUCHING = np.array([-16.0386, -26.4872, -4.9672, 8.4089, 22.7209, 2.1941, -11.0529, -15.6956])


def of_columns(values: NDArray[np.float64], forms: list[str], per_line: int) -> bytes:
    """Values in fields of fixed columns: nothing stands between them."""
    fields = [form.format(value) for form, value in zip(forms * (values.size // len(forms)), values, strict=True)]
    return b"".join("".join(fields[at : at + per_line]).encode() + b"\n" for at in range(0, len(fields), per_line))


@pytest.mark.parametrize(
    ("ordinate", "even", "forms", "per_line"),
    [
        (2, True, ["{:13.6E}"], 6), (4, True, ["{:20.13E}"], 4), (4, True, ["{:13.6E}"], 6),
        (2, False, ["{:13.6E}"], 6), (4, False, ["{:13.6E}", "{:20.13E}"], 4),
    ],
)  # fmt: skip
def test_fields_that_touch_are_read_by_their_columns(
    ordinate: int, even: bool, forms: list[str], per_line: int, tmp_path: Path
) -> None:
    times = np.array([-2.0, -1.5, -1.25, -1.0, -0.75, -0.5, -0.25, 0.0])
    values = TOUCHING if even else np.column_stack((times, TOUCHING)).ravel()
    plain = uff_text(values, ordinate=ordinate, even=even)
    printed = of_columns(values, forms, per_line)
    content = plain[: plain.index(f"{values[0]:20.12E}".encode())] + printed + b"    -1\n"
    recording = opened(tmp_path, content)
    np.testing.assert_allclose(recording.read("acc"), TOUCHING, rtol=1e-6)
    np.testing.assert_allclose(recording.read("acc", 2, 5), TOUCHING[2:5], rtol=1e-6)
    if not even:
        np.testing.assert_allclose(recording.time_base("acc").times_s, times, atol=1e-6)


def test_exponents_of_three_digits_and_blanks_for_plus_are_read_by_columns(tmp_path: Path) -> None:
    plain = uff_text(ramp(4), ordinate=2)
    printed = (
        b"".join(text.rjust(13) for text in (b"-1.00000-101", b"1.00000+101", b"-2.500000E-03", b"1.00000E 02")) + b"\n"
    )
    content = plain[: plain.index(f"{ramp(4)[0]:20.12E}".encode())] + printed + b"    -1\n"
    np.testing.assert_array_equal(opened(tmp_path, content).read("acc"), [-1e-101, 1e101, -2.5e-3, 100.0])


def test_a_field_that_is_missing_between_others_is_refused(tmp_path: Path) -> None:
    plain = uff_text(ramp(3), ordinate=2)
    printed = b"-1.000000E+00" + b" " * 13 + b"-2.500000E-03\n"
    content = plain[: plain.index(f"{ramp(3)[0]:20.12E}".encode())] + printed + b"    -1\n"
    with pytest.raises(CorruptFileError, match="2 values where it states 3"):
        opened(tmp_path, content)


def test_a_line_of_the_form_whose_fields_touch_is_read_by_its_columns(tmp_path: Path) -> None:
    content = uff_text(ramp()).replace(b"         1  0.00000E+00  5.00000E-04", b"         1-1.000000E+00 5.000000E-04")
    base = opened(tmp_path, content).time_base("acc")
    assert (base.start_s, base.step_s) == (-1.0, 5e-4)


@pytest.mark.parametrize("name", ["uff_no_space", "uff_m1_in_header"])
def test_reported_files_give_their_values(name: str) -> None:
    recording = UffReader().open(shared_file(f"reports/{name}.uff"), Declarations("dewetron"))
    (signal,) = recording.signals
    assert recording.time_base(signal.name).step_s == 1e-3
    expected = [-16.0386, -26.4872, -4.9672, 8.4089, 22.7209, 2.1941, -11.0529, -15.6956, 14.9749, 32.6957, 5.4554,
                -24.6666, -19.1653, 32.0004, 4.0576, -34.6427, -1.6739, -23.2645, -12.5858, -9.7601]  # fmt: skip
    np.testing.assert_allclose(recording.read(signal.name), expected, rtol=1e-12)
