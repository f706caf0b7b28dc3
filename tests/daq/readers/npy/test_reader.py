from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise
from tests.builders.container_files import npy_file, small_npy
from tests.builders.opened_files import RECORDER, open_bytes

TIMES_S = np.arange(40) * 2e-3


def opened(folder: Path, array: Any) -> Recording:
    return open_bytes(None, "a.npy", folder, npy_file(array))


def test_the_column_that_rises_is_the_time_of_the_others(tmp_path: Path) -> None:
    values = np.column_stack([np.sin(50 * TIMES_S), TIMES_S])
    for array in (values, np.asfortranarray(values), values.astype(">f8")):
        recording = opened(tmp_path, array)
        assert recording.reader == "NumPy array"
        assert [one.name for one in recording.signals] == ["column_1"]
        np.testing.assert_array_equal(recording.read("column_1", 3, 9), values[3:9, 0])
        assert recording.time_base("column_1").step_s == pytest.approx(2e-3)


def test_records_have_names_and_a_time_with_its_unit(tmp_path: Path) -> None:
    array = np.zeros(40, [("time_ms", "f8"), ("p", "i2")])
    array["time_ms"], array["p"] = 1e3 * TIMES_S, np.arange(40) % 7
    recording = opened(tmp_path, array)
    assert recording.time_base("p").times_s[-1] == pytest.approx(TIMES_S[-1])
    raw = recording.raw("p")
    assert raw is not None
    assert raw.counts.dtype == np.int16


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (np.arange(9.0), "no table of times and channels"),
        (np.zeros((9, 3, 2)), "no table of times and channels"),
        (np.zeros((9, 2)), "none of its columns is a time"),
        (np.array([[TIMES_S[0], 1j]] * 9), "no number"),
        (np.array([["a", "b"]] * 9), "no number"),
    ],
)
def test_an_array_without_a_time_says_what_it_is(array: Any, said: str, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=said):
        opened(tmp_path, array)


def test_objects_are_never_made(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.array([{"a": 1}, None], dtype=object), allow_pickle=True)
    with pytest.raises(ReadError, match="no number"):
        recognise(path).open(path, RECORDER)


def test_a_cut_array_is_read_to_its_last_whole_row_and_noted(tmp_path: Path) -> None:
    recording = open_bytes(None, "a.npy", tmp_path, small_npy()[:-30])
    assert recording.signals[0].sample_count == 38
    assert "row 38 of 40" in recording.incomplete
