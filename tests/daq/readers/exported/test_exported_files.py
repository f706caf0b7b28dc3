"""Our own CSV and Parquet: what is damaged, foreign or too large is refused in one line."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.exported.recoil_csv import RecoilCsvReader
from recoil_acquisition.readers.exported.recoil_parquet import RecoilParquetReader
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from tests.builders import exported_files as build
from tests.builders.opened_files import open_bytes

DECLARED = Declarations("recorder")
open_csv = partial(open_bytes, RecoilCsvReader(), "0007_dewetron.csv", declared=DECLARED)


def open_parquet(folder: Path, content: bytes) -> Recording:
    path = folder / "0007_dewetron.parquet"
    path.write_bytes(content)
    return RecoilParquetReader().open(path, DECLARED)


@pytest.mark.parametrize(("opened", "content"), [(open_csv, build.csv_file()), (open_parquet, build.parquet_file())])
def test_numbers_units_time_and_start_are_those_that_were_written(opened, content, tmp_path):
    recording = opened(tmp_path, content)
    assert [(s.name, s.unit) for s in recording.signals] == [("p_breech", "Pa"), ("acc, recoil", "m/s^2")]
    np.testing.assert_array_equal(recording.read("p_breech"), build.PRESSURE)
    assert np.signbit(recording.read("p_breech")[-1])
    np.testing.assert_array_equal(recording.read("acc, recoil"), build.ACCELERATION)
    base = recording.time_base("p_breech")
    assert (base.clock, base.start_s, base.step_s, base.count) == ("recorder", -0.01, 5e-05, build.COUNT)
    assert recording.absolute_start is not None
    assert recording.absolute_start.text == build.START["text"]
    assert recording.notes == ("p_breech: 1 of 6 samples are lost",)
    assert recording.metadata["shot"] == "0007"
    assert recording.tracks() == ()


def test_a_csv_without_its_last_rows_says_how_many_are_missing(tmp_path):
    lines = build.csv_file().splitlines(keepends=True)
    recording = open_csv(tmp_path, b"".join(lines[:-2]))
    assert recording.incomplete == "2 of 6 rows are missing at the end"
    assert recording.notes[0] == recording.incomplete
    assert recording.signals[0].sample_count == 4


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (b"-0.0099,", b"-0.0098,", "contradicts the declared spacing"),
        (b'"count": 6', b'"count": 5', "more rows than the file promises"),
        (b'"count": 6', b'"count": 999999999999', "samples in a file that can hold"),
        (b'"count": 6', b'"count": "6"', "damaged"),
        (b'"count": 6', b'"count": true', "damaged"),
        (b'"start_s": -0.01', b'"start_s": NaN', "no JSON"),
        (b'"step_s": 5e-05', b'"step_s": 0.0', "the time is not usable"),
        (b'"name": "acc, recoil"', b'"name": "p_breech"', "listed twice"),
        (b'"unit": "Pa"', b'"unit": 7', "is no text"),
        (b'"zone": "unknown", ', b"", "KeyError"),
        (b'# shot: "0007"', b"# shot 0007", "no key and value"),
        (b'# shot: "0007"', b"# shot: " + b"[" * 100_000, "no JSON"),
        (b'# shot: "0007"', b"# shot: " + b"9" * 10_000, "no JSON"),
        (b"time_s [s],", b"", "the heading row is damaged"),
        (b"101326.5", b"1013x26.5", "a cell is not a number"),
        (b"101326.5", b"1,101326.5", "a row does not fit the header"),
    ],
)
def test_a_csv_that_contradicts_itself_is_refused(old, new, says, tmp_path):
    content = build.csv_file()
    assert content.count(old) == 1
    with pytest.raises(CorruptFileError, match=says):
        open_csv(tmp_path, content.replace(old, new)).time_base("p_breech")


def test_stamps_that_do_not_increase_are_refused(tmp_path):
    content = build.csv_file(build.document(None), (0.0, 0.1, 0.1, 0.5, 0.75, 1.5))
    with pytest.raises(CorruptFileError, match="must increase strictly"):
        open_csv(tmp_path, content).time_base("p_breech")


def test_a_foreign_csv_is_refused(tmp_path):
    with pytest.raises(ReadError, match="no CSV of recoil-daq"):
        open_csv(tmp_path, b"time,a\n0,1\n")


def test_a_parquet_file_of_another_program_is_refused(tmp_path):
    import pandas as pd

    path = tmp_path / "other.parquet"
    pd.DataFrame({"a": [1.0, 2.0]}).to_parquet(path)
    with pytest.raises(ReadError, match="was not exported by recoil-daq"):
        RecoilParquetReader().open(path, DECLARED)


def test_a_parquet_file_that_was_packed_anew_is_refused(tmp_path):
    with pytest.raises(ReadError, match="found ZSTD"):
        open_parquet(tmp_path, build.parquet_file(compression="zstd"))


@pytest.mark.parametrize(
    ("said", "says"),
    [
        (build.document(time={"start_s": -0.01, "step_s": 5e-05, "count": 5}), "3 columns, 6 rows"),
        (build.document(channels=[{"name": "a", "unit": ""}]), "3 columns, 6 rows"),
        (build.document(channels=[]), "no channels"),
        (build.document(time={"start_s": -0.01, "step_s": 5e-05, "count": 10**9}), "in a file that can hold"),
        (build.document(time={"start_s": 0.0, "step_s": 5e-05, "count": 6}), "contradicts the declared spacing"),
        ([], "metadata"),
        ({}, "metadata"),
        ("x", "metadata"),
    ],
)
def test_a_parquet_file_that_contradicts_itself_is_refused(said, says, tmp_path):
    with pytest.raises(CorruptFileError, match=says):
        open_parquet(tmp_path, build.parquet_file(said)).time_base("p_breech")


def test_a_damaged_page_of_a_parquet_file_is_found_by_its_checksum(tmp_path):
    content = bytearray(build.parquet_file())
    at = content.index(np.float64(2e8).tobytes())
    content[at] ^= 1
    with pytest.raises(CorruptFileError, match="damaged"):
        open_parquet(tmp_path, bytes(content)).read("p_breech")


def test_a_time_that_was_mapped_is_told(tmp_path):
    said = build.document(aligned=True, clock="camera")
    assert "mapped from the clock 'camera' to 'dewetron'" in open_csv(tmp_path, build.csv_file(said)).notes[-1]
    assert json.dumps(dict(open_csv(tmp_path, build.csv_file(said)).metadata))
