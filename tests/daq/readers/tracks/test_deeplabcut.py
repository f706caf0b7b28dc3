from __future__ import annotations

import io
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.tracks.deeplabcut import DeepLabCutReader
from tests.builders import track_files as build
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file

READER = DeepLabCutReader()
CAMERA = Declarations("camera", frame_rate_hz=500.0)
opened = partial(open_bytes, READER, "a.csv", declared=CAMERA)


def test_parts_are_tracks_in_pixels_and_likelihood_stays_a_signal(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.deeplabcut())
    assert [(s.name, s.unit) for s in recording.signals] == [
        ("tip x", "px"), ("tip y", "px"), ("tip likelihood", ""),
        ("base x", "px"), ("base y", "px"), ("base likelihood", ""),
    ]  # fmt: skip
    assert [track.name for track in recording.tracks()] == ["tip", "base"]
    np.testing.assert_array_equal(recording.tracks()[0].positions, np.stack([build.X, build.Y], axis=1))
    np.testing.assert_array_equal(recording.time_base("tip x").times_s, np.arange(build.COUNT) / 500.0)
    assert recording.metadata["scorer"] == "net"


def test_a_low_likelihood_is_counted_and_its_position_kept(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.deeplabcut(likelihood={3: 0.05, 9: 0.59, 10: 0.6}))
    assert recording.read("tip x")[3] == build.X[3]
    assert not recording.tracks()[0].lost.any()
    assert "tip likelihood: below 0.6 in 2 of 24 frames; the positions are kept" in recording.notes


def test_the_same_part_of_two_individuals_makes_two_tracks(tmp_path: Path) -> None:
    content = build.deeplabcut(individuals=True)
    assert READER.claims(Head(content))
    assert [t.name for t in opened(tmp_path, content).tracks()] == ["a tip", "b tip"]


def test_minus_one_is_a_coordinate_here_and_an_empty_cell_is_lost(tmp_path: Path) -> None:
    lines = build.deeplabcut().decode().split("\n")
    lines[5], lines[6] = "2,-1,-1,0.9,1,2,0.9", "3,,,,1,2,0.9"
    recording = opened(tmp_path, "\n".join(lines).encode())
    assert recording.read("tip x")[2] == -1.0
    assert np.flatnonzero(recording.tracks()[0].lost).tolist() == [3]


def test_a_frame_rate_must_be_declared(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="frame rate is unknown"):
        opened(tmp_path, build.deeplabcut(), declared=Declarations("camera"))


def test_labels_for_training_are_refused(tmp_path: Path) -> None:
    text = build.deeplabcut().decode().replace("\n0,", "\nlabeled-data/a/img0.png,")
    with pytest.raises(ReadError, match="line 4: these are labels for training"):
        opened(tmp_path, text.encode())


def test_a_damaged_header_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match="expected rows scorer, bodyparts, coords"):
        opened(tmp_path, build.deeplabcut().replace(b"bodyparts", b"bodypart"))
    with pytest.raises(CorruptFileError, match="differ in width"):
        opened(tmp_path, build.deeplabcut().replace(b"coords,x,", b"coords,"))


def test_the_hdf5_table_is_claimed_and_refused_for_its_pickle(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.create_group("df_with_missing").create_dataset("table", data=np.zeros(3))
    assert READER.claims(Head(buffer.getvalue()))
    with pytest.raises(ReadError, match="pickle, which is not read") as caught:
        opened(tmp_path, buffer.getvalue())
    assert "save_as_csv=True" in str(caught.value)


def test_the_synthetic_table_is_read() -> None:
    recording = READER.open(shared_file("tracks/SYNTHETIC_deeplabcut.csv"), CAMERA)
    (track,) = recording.tracks()
    assert (track.name, track.unit, track.positions.shape) == ("target", "px", (400, 2))
    assert "target likelihood: below 0.6 in 9 of 400 frames; the positions are kept" in recording.notes
    assert not track.lost.any()
