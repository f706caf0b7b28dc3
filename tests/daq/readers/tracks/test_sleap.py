from __future__ import annotations

import io
from pathlib import Path

import h5py
import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.hdf5.kind import names_beyond_head
from recoil_acquisition.readers.head import HEAD_BYTES, Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.readers.tracks.sleap_analysis import SleapAnalysisReader
from recoil_acquisition.readers.tracks.sleap_text import SleapTextReader
from tests.builders import track_files as build
from tests.builders.opened_files import open_bytes

TEXT, ANALYSIS = SleapTextReader(), SleapAnalysisReader()
CAMERA = Declarations("camera", frame_rate_hz=500.0)


def opened(tmp_path: Path, content: bytes, declared: Declarations = CAMERA) -> Recording:
    reader = ANALYSIS if content.startswith(b"\x89HDF") else TEXT
    return open_bytes(reader, "a.h5", tmp_path, content, declared)


def changed(change) -> bytes:  # type: ignore[no-untyped-def]
    buffer = io.BytesIO(build.sleap_analysis())
    with h5py.File(buffer, "r+") as file:
        change(file)
    return buffer.getvalue()


def test_rows_of_animals_and_frames_become_tracks(tmp_path: Path) -> None:
    content = build.sleap_text(tracks=("a", "b"), missing=[7])
    assert TEXT.claims(Head(content))
    recording = opened(tmp_path, content)
    assert [t.name for t in recording.tracks()] == ["a tip", "b tip"]
    kept = np.delete(np.arange(build.COUNT), 7)
    np.testing.assert_array_equal(recording.read("b tip.x"), build.X[kept] + 50)
    np.testing.assert_array_equal(recording.tracks()[0].frame_numbers, kept)
    assert any(note.startswith("missing frames") and note.endswith(": 1") for note in recording.notes)
    assert next(s.unit for s in recording.signals if s.name == "a tip.y") == "px"


def test_an_animal_that_is_not_in_a_frame_is_lost_there_whatever_the_order_of_the_rows(tmp_path: Path) -> None:
    lines = build.sleap_text(tracks=("a", "b")).decode().split("\n")[:-1]
    rows = sorted(line for line in lines[1:] if not line.startswith("b,4,"))
    recording = opened(tmp_path, ("\n".join([lines[0], *rows]) + "\n").encode())
    a, b = recording.tracks()
    assert not a.lost.any()
    assert a.frame_numbers[b.lost].tolist() == [4]
    np.testing.assert_array_equal(a.positions[:, 0], build.X)


def test_many_tracks_of_which_few_are_in_any_one_frame_are_refused_before_they_take_the_memory(tmp_path: Path) -> None:
    head = "track,frame_idx,instance.score,tip.x,tip.y,tip.score\n"
    many = head + "".join(f"lost_{i % 250},{i},0.9,1.5,2.5,0.8\n" for i in range(20_000))
    with pytest.raises(ReadError, match=r"250 tracks over 20000 frames.*20000 rows, 152 MB.*join the tracks"):
        opened(tmp_path, many.encode())
    few = head + "".join(f"lost_{i % 250},{i},0.9,1.5,2.5,0.8\n" for i in range(1000))
    tracks = opened(tmp_path, few.encode()).tracks()
    assert [int((~track.lost).sum()) for track in tracks] == [4] * 250


def test_an_empty_track_name_is_one_animal_and_two_of_it_in_one_frame_are_refused(tmp_path: Path) -> None:
    content = build.sleap_text(tracks=("",))
    assert [t.name for t in opened(tmp_path, content).tracks()] == ["tip"]
    with pytest.raises(CorruptFileError, match="in one frame more than once"):
        opened(tmp_path, content + b",23,0.9,1,2,0.9\n")


def test_a_frame_that_is_no_whole_number_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match="line 6, column 'frame_idx'"):
        opened(tmp_path, build.sleap_text().replace(b"mark,4,", b"mark,4.5,"))


def test_low_scores_are_counted_and_kept(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.sleap_text().replace(b"mark,4,0.9", b"mark,4,0.2"))
    assert "instance.score: below 0.6 in 1 of 24 frames; the positions are kept" in recording.notes


@pytest.mark.parametrize(
    "dims", [None, ("track", "xy", "node", "frame"), ("frame", "track", "node", "xy"), ("xy", "frame", "track", "node")]
)
def test_the_axes_of_an_analysis_are_as_the_file_names_them(dims: tuple[str, ...] | None, tmp_path: Path) -> None:
    recording = opened(tmp_path, build.sleap_analysis(dims=dims, tracks=("a", "b")))
    assert [t.name for t in recording.tracks()] == ["a tip", "a base", "b tip", "b base"]
    np.testing.assert_array_equal(recording.read("b base.x"), build.X + 59)
    np.testing.assert_array_equal(recording.read("a tip.y"), build.Y)
    assert np.flatnonzero(recording.tracks()[1].lost).tolist() == [5]
    assert recording.read("b tip.score").tolist() == [0.9] * build.COUNT
    assert recording.metadata["nodes"] == ["tip", "base"]


def test_an_analysis_without_scores_has_positions_alone(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.sleap_analysis(scores=False))
    assert [s.name for s in recording.signals] == ["tip.x", "tip.y", "base.x", "base.y"]


def test_a_long_analysis_is_known_from_its_head(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for name in ("track_names", "node_names", "edge_names"):
            file[name] = np.array([b"one"])
        file.create_dataset("tracks", data=np.random.default_rng(0).random((1, 2, 1, 100_000)), compression="gzip")
        for name in ("track_occupancy", "point_scores", "instance_scores", "tracking_scores"):
            file.create_dataset(name, data=np.ones((1, 1, 100_000)), compression="gzip")
    content = buffer.getvalue()
    assert len(content) > 10 * HEAD_BYTES
    (tmp_path / "analysis.h5").write_bytes(content)
    assert ANALYSIS.claims(Head.of(tmp_path / "analysis.h5")) is Claim.CERTAIN
    assert recognise(tmp_path / "analysis.h5").name == "SLEAP analysis"
    assert opened(tmp_path, content).signals[0].sample_count == 100_000


def test_other_hdf5_is_not_claimed_where_its_names_show_and_refused_where_they_do_not(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file["tracks"] = np.ones(3)
    assert not ANALYSIS.claims(Head(buffer.getvalue()))
    with h5py.File(buffer, "w") as file:
        file["noise"] = np.random.default_rng(0).random(100_000)
        for i in range(20):
            file[f"another dataset {i}"] = 1.0
    assert names_beyond_head(buffer.getvalue()[:HEAD_BYTES])
    (tmp_path / "long.h5").write_bytes(buffer.getvalue())
    assert recognise(tmp_path / "long.h5").name == "HDF5"
    with pytest.raises(ReadError, match="no analysis of SLEAP; expected datasets tracks"):
        opened(tmp_path, buffer.getvalue()[:])


def test_what_another_file_holds_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "other.h5").write_bytes(build.sleap_analysis())

    def linked(file: h5py.File) -> None:
        del file["tracks"]
        file["tracks"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "tracks")

    with pytest.raises(ReadError, match="no analysis of SLEAP"):
        opened(tmp_path, changed(linked))


def test_datasets_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    def one_node(file: h5py.File) -> None:
        del file["node_names"]
        file["node_names"] = np.array([b"tip"])

    def other_dims(file: h5py.File) -> None:
        file["tracks"].attrs["dims"] = '["track", "xy", "node", "time"]'

    def no_json(file: h5py.File) -> None:
        file["tracks"].attrs["dims"] = "{"

    def numbers(file: h5py.File) -> None:
        del file["node_names"]
        file["node_names"] = np.arange(2)

    for change, match in ((one_node, "do not fit the names"), (other_dims, "other axes"), (numbers, "holds no names")):
        with pytest.raises(CorruptFileError, match=match):
            opened(tmp_path, changed(change))
    with pytest.raises(CorruptFileError, match="not a readable HDF5 file"):
        opened(tmp_path, changed(no_json))


@pytest.mark.parametrize("chunks", [(1, 2, 1, 1 << 16), (1, 2, 1, 1 << 25)])
def test_a_dataset_that_inflates_without_bound_is_refused(chunks: tuple[int, ...], tmp_path: Path) -> None:
    def swell(file: h5py.File) -> None:
        del file["tracks"]
        shape = (1, 2, 2, 1 << 28 if chunks[3] < 1 << 20 else 1 << 25)
        file.create_dataset("tracks", shape=shape, dtype="f8", chunks=chunks, compression="gzip")

    with pytest.raises(ReadError, match="too large for the file"):
        opened(tmp_path, changed(swell))


def test_a_frame_rate_must_be_declared(tmp_path: Path) -> None:
    for content in (build.sleap_text(), build.sleap_analysis()):
        with pytest.raises(ReadError, match="frame rate is unknown"):
            opened(tmp_path, content, Declarations("camera"))
