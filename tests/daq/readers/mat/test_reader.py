from __future__ import annotations

import struct
import zlib
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import ReadError, UnknownFormatError
from recoil_acquisition.readers.mat.reader import MatReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders.container_files import dewesoft_variables, mat_file, mat_v73_file, ramp
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file

TEXTS = ((1, "latin-1"), (2, "latin-1"), (4, "utf-16"), (16, "utf-8"), (17, "utf-16"), (18, "utf-32"))
"""Types of data that MATLAB and other programs store characters under, and how."""
opened = partial(open_bytes, MatReader(), "a.mat")


@pytest.mark.parametrize("compressed", [False, True])
def test_channels_of_dewesoft_take_the_time_of_their_name(compressed: bool, tmp_path: Path) -> None:
    recording = opened(tmp_path, mat_file(dewesoft_variables(), compressed=compressed))
    assert [s.name for s in recording.signals] == ["Data1_AI_1", "Data1_Temp"]
    assert recording.time_base("Data1_AI_1").step_s == 5e-5
    assert recording.time_base("Data1_Temp").step_s == 0.1
    np.testing.assert_array_equal(recording.read("Data1_AI_1"), ramp(16))
    assert recording.metadata["texts"] == {"File_name": "shot_0001.dxd"}
    assert recording.metadata["scalars"] == {"Sample_rate": 20000.0}
    assert "no units" in recording.notes[0]


def test_ai_1_is_not_taken_for_ai_10(tmp_path: Path) -> None:
    variables = {
        "Data1_time_AI_1": np.arange(6) / 10,
        "Data1_time_AI_10": np.arange(6) / 20,
        "Data1_AI_10": ramp(6),
        "Data1_AI_1_acc": ramp(6),
    }
    recording = opened(tmp_path, mat_file(variables))
    assert recording.time_base("Data1_AI_10").step_s == 0.05
    assert recording.time_base("Data1_AI_1_acc").step_s == 0.1


@pytest.mark.parametrize("dtype", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
@pytest.mark.parametrize("compressed", [False, True])
def test_every_type_of_number_is_read(dtype: str, compressed: bool, tmp_path: Path) -> None:
    values = np.array([0, 1, 100, 7, 3], dtype)
    recording = opened(tmp_path, mat_file({"t": np.arange(5) / 8, "a": values}, compressed=compressed))
    np.testing.assert_array_equal(recording.read("a"), values.astype(float))
    np.testing.assert_array_equal(recording.read("a", 2, 4), [100.0, 7.0])
    assert (recording.raw("a") is None) == (dtype[0] == "f")


@pytest.mark.parametrize(("stored_as", "encoding"), TEXTS)
@pytest.mark.parametrize("order", ["<", ">"])
def test_a_text_is_read_however_its_characters_are_stored(
    order: str, stored_as: int, encoding: str, tmp_path: Path
) -> None:
    wide = encoding in ("utf-16", "utf-32")
    stored = "Stoß 1".encode(f"{encoding}-{'l' if order == '<' else 'b'}e" if wide else encoding)

    def element(kind: int, content: bytes) -> bytes:
        return struct.pack(f"{order}II", kind, len(content)) + content.ljust(-len(content) // 8 * -8, b"\0")

    flags = element(6, struct.pack(f"{order}II", 4, 0))
    text = flags + element(5, struct.pack(f"{order}2i", 1, 6)) + element(1, b"note") + element(stored_as, stored)
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}H", 0x0100) + (b"IM" if order == "<" else b"MI")
    numbers = b"".join(
        element(14, element(6, struct.pack(f"{order}II", 6, 0)) + element(5, struct.pack(f"{order}2i", 3, 1))
                + element(1, name) + element(9, struct.pack(f"{order}3d", *values)))
        for name, values in ((b"t", (0.0, 0.1, 0.2)), (b"a", (1.0, 2.0, 4.0)))
    )  # fmt: skip
    recording = opened(tmp_path, header + element(14, text) + numbers)
    assert recording.metadata["texts"] == {"note": "Stoß 1"}
    np.testing.assert_array_equal(recording.read("a"), [1.0, 2.0, 4.0])


@settings(max_examples=30, deadline=None)
@given(values=st.lists(st.floats(allow_nan=False), min_size=2, max_size=40), compressed=st.booleans())
def test_what_scipy_writes_is_read(
    values: list[float], compressed: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    content = mat_file({"fs": 100.0, "a": np.array(values)}, compressed=compressed)
    recording = opened(tmp_path_factory.mktemp("m"), content)
    np.testing.assert_array_equal(recording.read("a"), values)
    assert recording.time_base("a").step_s == 0.01


def test_date_numbers_give_an_absolute_start_and_the_rate_behind_their_rounding(tmp_path: Path) -> None:
    days = 740000.5 + np.arange(2000) / 5000 / 86400
    recording = opened(tmp_path, mat_file({"Data1_time": days, "Data1_AI_1": np.arange(2000.0)}))
    base = recording.time_base("Data1_AI_1")
    assert base.step_s == pytest.approx(2e-4, rel=1e-9)
    assert base.start_s == pytest.approx(0.0, abs=1e-5)
    start = recording.absolute_start
    assert start is not None
    assert (start.text, start.zone) == ("2026-01-18T12:00:00.000000", "unknown")
    assert any("resolves only 1e-05 s" in note for note in recording.notes)


def test_seconds_behind_eight_days_are_not_taken_for_dates_where_a_rate_says_otherwise(tmp_path: Path) -> None:
    times = 740000.0 + np.arange(10) / 100
    recording = opened(tmp_path, mat_file({"Sample_rate": 100.0, "time": times, "a": ramp(10)}))
    assert recording.absolute_start is None
    assert recording.time_base("a").step_s == pytest.approx(0.01)


def test_what_is_no_vector_of_numbers_is_named_and_left_out(tmp_path: Path) -> None:
    variables: dict[str, Any] = {"t": np.arange(4.0), "a": ramp(4), "matrix": np.zeros((3, 3)), "z": np.ones(4) * 1j}
    cell = np.empty(2, object)
    cell[:] = [1, "x"]
    variables |= {"cell": cell, "struct": np.zeros(2, [("x", object)]), "none": np.zeros((0, 0)), "short": np.ones(3)}
    recording = opened(tmp_path, mat_file(variables))
    assert [s.name for s in recording.signals] == ["a"]
    for name in (
        "matrix: an array",
        "z: complex",
        "cell: a cell",
        "struct: a structure",
        "none: empty",
        "short: no time",
    ):
        assert any(note.startswith(name) and note.endswith("left out") for note in recording.notes)


@pytest.mark.parametrize("compressed", [False, True])
def test_samples_of_repeated_stamps_are_left_out_of_whatever_part_is_read(compressed: bool, tmp_path: Path) -> None:
    variables = {"t": np.array([0.0, 1.0, 1.0, 2.0, 5.0, 5.0, 7.0]), "a": np.arange(7.0)}
    recording = opened(tmp_path, mat_file(variables, compressed=compressed))
    assert recording.read("a").tolist() == [0.0, 1.0, 3.0, 4.0, 6.0]
    assert recording.read("a", 1, 4).tolist() == [1.0, 3.0, 4.0]
    assert recording.read("a", 2, 2).size == 0


def test_time_that_steps_back_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="time steps back by 1 s behind sample 1"):
        opened(tmp_path, mat_file({"time": np.array([0.0, 2.0, 1.0]), "a": np.ones(3)}))


def test_a_file_without_time_says_what_to_add(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=r"scalar `Sample_rate` \(Hz\)"):
        opened(tmp_path, mat_file({"a": ramp()}))


def test_two_times_that_would_both_do_are_not_chosen_from(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="'t' and 'time' could both be its time"):
        opened(tmp_path, mat_file({"t": np.arange(3.0), "time": np.arange(3.0), "a": np.ones(3)}))


def test_a_compressed_variable_that_states_more_than_deflate_can_hold_is_refused(tmp_path: Path) -> None:
    content = mat_file({"fs": 10.0, "a": np.zeros(100)}, compressed=False)
    at = 128
    while content[at : at + 4] and b"a" not in content[at + 40 : at + 60]:
        at += 8 + int(struct.unpack_from("<I", content, at + 4)[0])
    plain = bytearray(content[at:])
    plain = plain.replace(struct.pack("<ii", 1, 100), struct.pack("<ii", 1, 2**27))
    plain = plain.replace(struct.pack("<ii", 100, 1), struct.pack("<ii", 2**27, 1))
    plain = plain.replace(struct.pack("<II", 9, 800), struct.pack("<II", 9, 2**30))
    struct.pack_into("<I", plain, 4, 2**31 - 8)
    packed = zlib.compress(bytes(plain))
    with pytest.raises(ReadError, match="states more than it can hold"):
        opened(tmp_path, content[:at] + struct.pack("<II", 15, len(packed)) + packed)


def test_version_7_3_is_read(tmp_path: Path) -> None:
    content = mat_v73_file({"time": np.arange(20) / 1000, "a": ramp(20), "n": np.arange(20, dtype=np.int16)})
    recording = opened(tmp_path, content)
    assert recording.metadata["version"] == "7.3"
    np.testing.assert_array_equal(recording.read("a", 3, 7), ramp(20)[3:7])
    assert recording.time_base("a").step_s == 0.001
    raw = recording.raw("n")
    assert raw is not None
    assert raw.counts.dtype == np.int16


def test_a_name_that_only_ends_like_a_time_is_a_channel(tmp_path: Path) -> None:
    content = mat_file({"time": np.arange(4.0), "alpha_t": ramp(4), "acc": ramp(4), "acc_t": np.arange(4) * 2.0})
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["alpha_t", "acc"]
    assert recording.time_base("alpha_t").step_s == 1.0
    assert recording.time_base("acc").step_s == 2.0


def test_a_time_that_no_channel_has_is_told(tmp_path: Path) -> None:
    recording = opened(tmp_path, mat_file({"time": np.arange(4.0), "a": ramp(4), "rise_time": np.ones(3)}))
    assert any(note.startswith("rise_time: a time that no channel was given") for note in recording.notes)


@pytest.mark.parametrize(
    ("variables", "step_s"),
    [
        ({"time_ms": np.arange(4.0)}, 1e-3), ({"t_us": np.arange(4.0)}, 1e-6), ({"time_min": np.arange(4.0)}, 60.0),
        ({"time": np.arange(4.0), "time_unit": "ms"}, 1e-3), ({"t": np.arange(4.0), "timeUnits": "h"}, 3600.0),
        ({"fs": 20.0, "fs_unit": "kHz"}, 5e-5), ({"fs_kHz": 20.0}, 5e-5), ({"Sample_rate": "20 kHz"}, 5e-5),
        ({"dt_ms": 2.0}, 2e-3), ({"dt": 2.0, "time_units": "ms"}, 2e-3), ({"dt": 2e-3}, 2e-3), ({"fs_hz": 10.0}, 0.1),
        ({"time_ms": np.arange(4.0), "fs": 1000.0}, 1e-3),
    ],
)  # fmt: skip
def test_times_and_rates_are_in_the_unit_that_is_stated(
    variables: dict[str, Any], step_s: float, tmp_path: Path
) -> None:
    recording = opened(tmp_path, mat_file(variables | {"a": ramp(4)}))
    assert [s.name for s in recording.signals] == ["a"]
    assert recording.time_base("a").step_s == pytest.approx(step_s, rel=1e-12)


@pytest.mark.parametrize(
    ("variables", "why"),
    [
        ({"time": np.arange(4.0), "time_unit": "turns"}, "time is in 'turns', which is no unit of time"),
        ({"time_ms": np.arange(4.0), "time_unit": "s"}, "time_ms states its unit as 'ms' and as 's'"),
        ({"fs": 20.0, "fs_unit": "rpm"}, "its fs is in 'rpm', which is no unit of a rate"),
        ({"dt": "2 turns"}, "its dt is in 'turns'"),
        ({"time": np.arange(4.0), "fs": 1000.0}, "time steps by 1 s, fs says 0.001 s: state the unit"),
    ],
)
def test_times_in_no_unit_of_time_are_refused_by_name(variables: dict[str, Any], why: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="no time in this file") as refused:
        opened(tmp_path, mat_file(variables | {"a": ramp(4)}))
    assert why in str(refused.value)


def v4_file(variables: dict[str, Any], order: str = "<") -> bytes:
    """A file of version 4: numbers as rows or matrices, texts as doubles."""
    content = b""
    for name, value in variables.items():
        is_text = isinstance(value, str)
        values = np.array([[float(ord(c)) for c in value]]) if is_text else np.atleast_2d(np.asarray(value))
        digit = ("f8", "f4", "i4", "i2", "u2", "u1").index(values.dtype.str[1:])
        kind = 1000 * (order == ">") + 10 * digit + is_text
        content += struct.pack(f"{order}5i", kind, *values.shape, 0, len(name) + 1) + name.encode() + b"\0"
        content += values.astype(values.dtype.newbyteorder(order)).tobytes(order="F")
    return content


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("dtype", ["f8", "f4", "i4", "i2", "u2", "u1"])
def test_files_of_version_4_are_read(order: str, dtype: str, tmp_path: Path) -> None:
    values = np.array([0, 1, 100, 7, 3], dtype)
    text = {"fs": 8.0, "note": "shot 7", "a": values, "matrix": np.zeros((2, 3)), "column": values[:, None]}
    path = tmp_path / "a.mat"
    path.write_bytes(v4_file(text, order))
    assert recognise(path).name == "MATLAB"
    recording = MatReader().open(path, Declarations("dewetron"))
    assert [s.name for s in recording.signals] == ["a", "column"]
    np.testing.assert_array_equal(recording.read("a"), values.astype(float))
    np.testing.assert_array_equal(recording.read("column", 1, 3), values[1:3].astype(float))
    assert recording.time_base("a").step_s == 0.125
    assert recording.metadata["texts"] == {"note": "shot 7"}
    assert (recording.raw("a") is None) == (dtype[0] == "f")
    with pytest.raises(ReadError, match=r"'matrix' cannot be read; found an array of shape 2x3: save each of its col"):
        recording.read("matrix")


def test_what_scipy_writes_as_version_4_is_read_and_a_cut_is_told(tmp_path: Path) -> None:
    from scipy.io import savemat

    path = tmp_path / "a.mat"
    savemat(path, {"t": np.arange(6) / 8, "a": ramp(6), "z": ramp(6) * 1j, "last": ramp(6)}, format="4")
    content = path.read_bytes()
    recording = MatReader().open(path, Declarations("dewetron"))
    assert [s.name for s in recording.signals] == ["a", "last"]
    np.testing.assert_array_equal(recording.read("a"), ramp(6))
    assert any(note.startswith("z: complex") for note in recording.notes)
    recording = opened(tmp_path, content[:-5])
    assert [s.name for s in recording.signals] == ["a"]
    assert "'last'" in recording.incomplete
    assert "cut off" in recording.incomplete


@pytest.mark.parametrize(
    "content", [bytes(400), b"\x00\x00\x00\x00\x04\x00\x00\x00\x01\x00\x00\x00\x00\x00\x00\x00\x03\x00\x00\x00ab\0"]
)
def test_zeros_and_a_variable_that_the_file_has_no_room_for_are_no_version_4(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(UnknownFormatError):
        recognise(tmp_path / "a.mat")


def test_fields_of_a_structure_have_the_time_that_is_in_it(tmp_path: Path) -> None:
    inner = {"fs": 50.0, "b": np.arange(4, dtype=np.int16)}
    structure = {"t": np.arange(4.0), "a": ramp(4), "note": "shot 7", "inner": inner, "none": np.zeros((0, 0))}
    for compressed in (False, True):
        content = mat_file({"t": np.arange(4) / 8, "x": ramp(4), "S": structure}, compressed=compressed)
        recording = opened(tmp_path, content)
        assert [s.name for s in recording.signals] == ["x", "S.a", "S.inner.b"]
        assert [recording.time_base(s.name).step_s for s in recording.signals] == [0.125, 1.0, 0.02]
        np.testing.assert_array_equal(recording.read("S.a", 1), ramp(4)[1:])
        raw = recording.raw("S.inner.b")
        assert raw is not None
        assert raw.counts.dtype == np.int16
        assert recording.metadata["texts"] == {"S.note": "shot 7"}
        assert any(note.startswith("S.none: empty") for note in recording.notes)


def test_structures_in_a_row_and_cells_say_what_to_save_instead(tmp_path: Path) -> None:
    cell = np.empty(2, object)
    cell[:] = [1, "x"]
    with pytest.raises(ReadError, match=r"S: a structure: .*save\('x.mat', '-struct', 'S'\)") as refused:
        opened(tmp_path, mat_file({"S": np.zeros((1, 2), [("a", object)]), "c": cell}))
    assert "c: a cell: save its parts as vectors of their own" in str(refused.value)


@pytest.mark.parametrize("kind", [1, 2])
def test_cells_or_structures_within_one_another_end_no_process(kind: int, tmp_path: Path) -> None:
    levels = 50_000
    fields = v5_element(5, struct.pack("<i", 1)) + v5_element(1, b"x") if kind == 2 else b""
    before = v5_element(6, struct.pack("<II", kind, 0)) + v5_element(5, struct.pack("<2i", 1, 1)) + v5_element(1, b"")
    size = len(before + fields) + 8
    nested = b"".join(
        struct.pack("<II", 14, size * (levels - n) - 8 + 8) + before + fields for n in range(levels)
    ) + struct.pack("<II", 14, 0)
    packed = zlib.compress(nested)
    content = mat_file({"t": np.arange(4.0), "a": ramp(4)}) + struct.pack("<II", 15, len(packed)) + packed
    assert [s.name for s in opened(tmp_path, content).signals] == ["a"]


def test_an_object_of_a_class_hides_nothing_else(tmp_path: Path) -> None:
    opaque = v5_element(6, struct.pack("<II", 17, 0)) + v5_element(1, b"s") + v5_element(1, b"MCOS")
    content = mat_file({"t": np.arange(4.0)}) + v5_element(14, opaque) + mat_file({"a": ramp(4)})[128:]
    recording = opened(tmp_path, content)
    assert [s.name for s in recording.signals] == ["a"]
    assert any(note.startswith("an object: of a class") for note in recording.notes)


def v5_element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content.ljust(-len(content) // 8 * -8, b"\0")


@pytest.mark.parametrize("version", ["4", "5"])
def test_columns_of_a_matrix_have_the_time_of_the_one_that_rises(version: str, tmp_path: Path) -> None:
    from scipy.io import savemat

    path, wave = tmp_path / "a.mat", np.sin(np.arange(9.0))
    # a column that counts samples is no time, and one that rises unevenly is none beside one that rises evenly
    columns = [np.arange(9.0), wave, np.arange(9.0) ** 2, np.arange(9) / 8]
    savemat(path, {"X": np.column_stack(columns)}, format=version)
    recording = MatReader().open(path, Declarations("dewetron"))
    assert [s.name for s in recording.signals] == ["X.column_1", "X.column_2", "X.column_3"]
    np.testing.assert_array_equal(recording.read("X.column_2", 2, 5), wave[2:5])
    assert recording.time_base("X.column_2").step_s == 0.125


def test_a_time_vector_or_a_rate_goes_before_a_column_that_rises(tmp_path: Path) -> None:
    matrix = np.column_stack([np.arange(9) / 8, np.sin(np.arange(9.0))])
    for time in ({"t": np.arange(9) / 4}, {"fs": 4.0}):
        recording = opened(tmp_path, mat_file(time | {"X": matrix}))
        assert [s.name for s in recording.signals] == ["X.column_1", "X.column_2"]
        assert recording.time_base("X.column_1").step_s == 0.25


@pytest.mark.parametrize(
    ("columns", "why"),
    [
        ((np.arange(9) / 8, np.arange(9) / 4), "column_1 and column_2 could both be its time"),
        ((np.arange(9.0), np.sin(np.arange(9.0))), "none of its columns is a time"),
    ],
)
def test_a_matrix_without_one_time_is_refused(columns: tuple[Any, ...], why: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=why):
        opened(tmp_path, mat_file({"X": np.column_stack(columns)}))


def test_a_matrix_of_a_real_record_is_read() -> None:
    recording = MatReader().open(shared_file("matlab/Unit105_Series1_1.mat"), Declarations("dewetron"))
    assert [s.name for s in recording.signals] == [f"Unit105_Series1_1.column_{n}" for n in range(1, 7)]
    base = recording.time_base("Unit105_Series1_1.column_6")
    assert (base.count, base.step_s) == (100_000, pytest.approx(1e-3))


@pytest.mark.parametrize("name", ["mat_v4", "mat_struct"])
def test_reported_files_are_read(name: str) -> None:
    path = shared_file(f"reports/{name}.mat")
    assert recognise(path).name == "MATLAB"
    recording = MatReader().open(path, Declarations("dewetron"))
    [signal] = recording.signals
    np.testing.assert_allclose(recording.read(signal.name), np.sin(50 * np.arange(100) / 1000), atol=1e-12)
    assert recording.time_base(signal.name).step_s == pytest.approx(1e-3)


def test_numbers_and_texts_behind_a_name_are_of_that_variable_alone(tmp_path: Path) -> None:
    said = {"acc_unit": "g", "p_gain": 2.0, "n_lsb": 0.5, "time_unit": "s"}
    vectors = {"acc": ramp(20), "p": ramp(20), "n": np.arange(20, dtype=np.int16), "t": np.arange(20) / 100.0}
    recording = open_bytes(None, "a.mat", tmp_path, mat_file({**vectors, **said}))
    assert {one.name: one.unit for one in recording.signals} == {"acc": "g", "p": ""}
    assert "p: the file states p_gain = 2: it is not applied" in recording.notes
    assert "n: integers with the attribute n_lsb, whose meaning is open: left out" in recording.notes
