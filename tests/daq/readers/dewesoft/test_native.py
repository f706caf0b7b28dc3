from __future__ import annotations

import gc
import shutil
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition import conformance as rules
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.dewesoft import native as dewesoft_native
from recoil_acquisition.readers.dewesoft.child_process import is_uniform
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import READERS, recognise
from recoil_acquisition.readers.time.increasing_stamps import keep_increasing
from tests.builders.dewesoft_double import told_file, write_double
from tests.builders.shared_data import shared_file

READER = next(reader for reader in READERS if reader.name == "Dewesoft recording")
DECLARED = Declarations("dewetron")
COUNTS = {
    "GPSvel": 9580, "Math 0": 9580, "X absolute": 191, "Y absolute": 191, "Velocity": 1838 - 61,
    "Direction": 1838 - 61, "Used sattelites": 191, "CNT 0": 9580,
}  # fmt: skip


class OpenedOnce(rules.Case):
    """A case whose whole file is given to the library once, because that takes a second."""

    def path(self, folder: Path) -> Path:  # noqa: ARG002  as its parent
        return RECORDINGS[0].path

    def open(self, folder: Path, content: bytes | None = None) -> Recording:  # noqa: ARG002  as its parent
        assert content is None
        return RECORDINGS[0]


RECORDINGS: list[Recording] = []


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    pytest.importorskip("dwdatareader")
    path = tmp_path_factory.mktemp("drive") / "case.d7d"
    shutil.copy(shared_file("dewetron/Example_Drive01.d7d"), path)
    RECORDINGS[:] = [READER.open(path, DECLARED)]
    return RECORDINGS[0]


@pytest.mark.exhaustive
def test_a_real_recording_has_the_counts_that_its_library_states(drive: Recording) -> None:
    assert {header.name: header.sample_count for header in drive.signals} == COUNTS
    assert {h.name: h.unit for h in drive.signals if h.unit} == {"GPSvel": "kph", "CNT 0": "m"}
    assert drive.time_base("GPSvel").step_s == 0.01
    assert drive.time_base("GPSvel").start_s == 0.0
    assert drive.absolute_start is not None
    assert drive.absolute_start.text.startswith("2003-10-09T21:27:46.812")
    assert drive.absolute_start.zone == "unknown"
    assert drive.metadata["events"] == [[0.0, 1, "storing started"], [95.8, 2, "storing stopped"]]
    assert len(drive.metadata["setup_sha256"]) == 64


@pytest.mark.exhaustive
def test_each_channel_that_the_library_refuses_is_named(drive: Recording) -> None:
    refused = [note for note in drive.notes if "CAN" in note]
    assert len(refused) == 12
    assert refused[0] == "STWH_ANGLE: left out: Feature or operation not supported on CAN channel (status 10)"
    assert "Velocity: 61 of 1838 samples share their stamp with a later one: the last is kept" in drive.notes


OF_DAMAGED_FILES = (rules.a_cut_file_is_refused_or_shorter_with_a_note, rules.flipped_bytes_are_refused_or_read)
"""They take hundreds of files, and the library a process for each; some are tried below."""


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "rule",
    [rule for rule in rules.RULES if rule not in OF_DAMAGED_FILES],
    ids=lambda rule: rule.__name__,
)
def test_a_real_recording_keeps(rule: Callable[[rules.Case, Path], None], drive: Recording, tmp_path: Path) -> None:
    magnitudes = {"GPSvel": (-1.0, 250.0), "Used sattelites": (0.0, 30.0)}
    rule(OpenedOnce("dewesoft", READER, drive.path.read_bytes(), DECLARED, magnitudes), tmp_path)


@pytest.mark.exhaustive
def test_exactly_one_reader_claims_a_real_recording(drive: Recording) -> None:
    assert recognise(drive.path).name == READER.name
    assert READER.name in {reader.name for reader in READERS}


def opened_or_refused(path: Path, content: bytes) -> Recording | None:
    path.write_bytes(content)
    try:
        return READER.open(path, DECLARED)
    except ReadError as error:
        said = str(error)
    assert "\n" not in said
    return None


@pytest.mark.exhaustive
@pytest.mark.parametrize("share", [0.005, 0.9999])
def test_a_real_recording_that_was_cut_is_refused_or_shorter(
    share: float, drive: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dewesoft_native, "LIMIT_S", 8.0)
    content = drive.path.read_bytes()
    recording = opened_or_refused(tmp_path / "a.d7d", content[: int(share * len(content))])
    for header in recording.signals if recording else ():
        samples = recording.read(header.name)
        np.testing.assert_array_equal(samples, drive.read(header.name)[: samples.size])


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", [0, 2])
def test_a_real_recording_with_flipped_bytes_is_refused_or_read(
    seed: int, drive: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dewesoft_native, "LIMIT_S", 8.0)
    content = bytearray(drive.path.read_bytes())
    rng = np.random.default_rng(seed)
    for place in rng.integers(64, 20_000, 8):
        content[place] = rng.integers(256)
    recording = opened_or_refused(tmp_path / "a.d7d", bytes(content))
    if recording is not None:
        rules.read_everything(recording)


@pytest.fixture
def told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Recording]:
    """Open a file of which a double of the library says what a test wants."""
    monkeypatch.setattr(dewesoft_native, "_check_library", lambda _: None)
    write_double(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    def open_(**said: Any) -> Recording:
        return READER.open(told_file(tmp_path / "a.dxd", **said), DECLARED)

    return open_


SYNC = {"name": "a", "values": [1.0, 2.0, 3.0], "times_s": [1200.02, 1200.03, 1200.04], "rate_hz": 100.0}


@pytest.mark.parametrize("fault", ["crash", "exit"])
def test_a_crash_of_the_library_is_a_corrupt_file(fault: str, told: Callable[..., Recording]) -> None:
    with pytest.raises(CorruptFileError, match="library failed over this file"):
        told(**{fault: True})


@pytest.mark.exhaustive
def test_a_hang_of_the_library_is_a_corrupt_file(
    told: Callable[..., Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dewesoft_native, "LIMIT_S", 1.0)
    with pytest.raises(CorruptFileError, match="did not come back within 1 s"):
        told(hang=True)


def test_what_the_library_says_of_a_refused_file_is_told(told: Callable[..., Recording]) -> None:
    with pytest.raises(CorruptFileError, match=r"File is corrupt \(status 4\)"):
        told(status=4)


def test_times_count_from_the_start_of_the_measurement(told: Callable[..., Recording]) -> None:
    recording = told(channels=[SYNC])
    base = recording.time_base("a")
    assert (base.start_s, base.step_s, base.count) == (1200.02, 0.01, 3)
    assert base.absolute_start is not None
    assert (base.absolute_start.text, base.absolute_start.zone) == ("2026-08-05T10:00:00", "unknown")
    assert recording.metadata["setup"] == "<setup/>"
    assert recording.metadata["header"] == {"operator": "A. N."}
    assert recording.notes == ()


def test_the_temporary_samples_go_with_the_recording(told: Callable[..., Recording]) -> None:
    recording = told(channels=[SYNC])
    folder = recording._channels["a"].samples.func.__self__._folder
    assert folder.exists()
    del recording
    gc.collect()
    assert not folder.exists()


def test_a_long_setup_is_kept_by_its_digest(told: Callable[..., Recording]) -> None:
    recording = told(channels=[SYNC], setup="<setup/>" * 9000)
    assert "setup" not in recording.metadata
    assert len(recording.metadata["setup_sha256"]) == 64


def test_what_is_no_series_of_numbers_is_named_or_goes_to_the_metadata(
    told: Callable[..., Recording],
) -> None:
    one = {"values": [7.5], "times_s": [0.0]}
    recording = told(
        channels=[
            SYNC,
            {"name": "mass", "kind": 2, "unit": "kg", **one},
            {"name": "empty", "kind": 1, "values": [], "times_s": []},
            {"name": "fft", "array_size": 3, **one},
            {"name": "complex", "data_type": 10, **one},
            {"name": "text", "data_type": 11, **one},
            {"name": "can", "status": 10, **one},
            {"name": "huge", "count": 10**12, **one},
        ]
    )
    assert [header.name for header in recording.signals] == ["a"]
    assert recording.metadata["single_values"] == {"mass": {"value": 7.5, "unit": "kg"}}
    said = {note.split(":")[0]: note for note in recording.notes}
    assert set(said) == {"fft", "complex", "text", "can", "huge", "channels without a sample"}
    assert said["channels without a sample"].endswith(": empty")
    assert "more than the file can hold" in said["huge"]


def test_gaps_are_in_the_time_base_and_told(told: Callable[..., Recording]) -> None:
    times_s = [0.0, 0.01, 0.02, 0.5, 0.51]
    recording = told(channels=[{**SYNC, "values": [1, 2, 3, 4, 5], "times_s": times_s}], storing_type=2)
    assert recording.time_base("a").times_s.tolist() == times_s
    assert recording.notes == (
        "a: its samples are not evenly spaced (1 gaps): instants are as stored",
        "it was stored fast on trigger: there may be gaps, and each is in the time bases",
    )


def test_repeated_and_backward_stamps_are_left_out_and_counted(told: Callable[..., Recording]) -> None:
    channel = {"name": "v", "kind": 1, "values": [1, 2, 3, 4, 5], "times_s": [0.0, 1.0, 1.0, 0.5, 2.0]}
    recording = told(channels=[channel])
    assert recording.read("v").tolist() == [1, 3, 5]
    assert recording.read("v", 1).tolist() == [3, 5]
    assert recording.time_base("v").times_s.tolist() == [0.0, 1.0, 2.0]
    assert recording.notes == (
        "v: 1 of 5 samples share their stamp with a later one: the last is kept",
        "v: 1 of 5 samples are stamped out of order: left out",
    )


def test_a_file_of_another_kind_never_reaches_the_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dewesoft_native, "_run", lambda *_: pytest.fail("the library was run"))
    for content in (b"", b"MULTI_STREAM_FILE_VER0200", b"PK" * 9000):
        path = tmp_path / "a.dxd"
        path.write_bytes(content)
        with pytest.raises(CorruptFileError, match="no recording of Dewesoft"):
            READER.open(path, DECLARED)


def test_an_old_library_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = told_file(tmp_path / "a.dxd", channels=[])
    monkeypatch.setattr(metadata, "version", lambda _: "1.2.0")
    with pytest.raises(ReadError, match=r"too old.*found 1\.2\.0.*pip install 'dwdatareader>=1\.3\.0'"):
        READER.open(path, DECLARED)


def test_a_library_that_does_not_load_says_why(told: Callable[..., Recording], tmp_path: Path) -> None:
    write_double(tmp_path, "raise NotImplementedError('Unsupported platform: Darwin 64bit')")
    with pytest.raises(ReadError, match="cannot be loaded: NotImplementedError: Unsupported platform"):
        told(channels=[])


def test_stamps_on_the_grid_of_the_rate_are_uniform() -> None:
    times_s = 1200.02 + np.arange(1000) / 500.0
    assert is_uniform(times_s, 500.0)
    assert not is_uniform(np.delete(times_s, 500), 500.0)
    assert not is_uniform(np.where(np.arange(1000) == 3, np.nan, times_s), 500.0)
    assert not is_uniform(times_s, 500.1)


@pytest.mark.parametrize("dtype", [np.int64, np.float64])
def test_the_last_of_equal_stamps_is_kept_and_the_kept_ones_increase(dtype: type) -> None:
    stamps = np.array([1, 1, 2, 0, 2, 3, 3, 3], dtype)
    kept, repeated, backward = keep_increasing(stamps)
    assert np.flatnonzero(kept).tolist() == [1, 4, 7]
    assert (repeated, backward) == (4, 1)


def test_stamps_that_are_no_numbers_are_left_out() -> None:
    kept, repeated, backward = keep_increasing(np.array([np.nan, 1.0, np.inf, 2.0, np.nan, 3.0]))
    assert np.flatnonzero(kept).tolist() == [1, 3, 5]
    assert (repeated, backward) == (0, 3)
