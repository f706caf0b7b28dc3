from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.tracks.dltdv import DltdvReader
from tests.builders import track_files as build
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file

READER = DltdvReader()
CAMERA = Declarations("camera", frame_rate_hz=500.0)
opened = partial(open_bytes, READER, "a.csv", declared=CAMERA)


def test_rows_are_frames_from_one_and_nan_is_lost(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.dltdv(lost=[5, 6]))
    (track,) = recording.tracks()
    assert (track.name, track.unit, track.axes) == ("pt1_cam1", "px", ("X", "Y"))
    assert track.frame_numbers.tolist() == list(range(1, build.COUNT + 1))
    assert np.flatnonzero(track.lost).tolist() == [5, 6]
    assert recording.time_base("pt1_cam1_X").times_s[0] == 1 / 500.0
    assert recording.metadata["first_pixel"] == 1
    assert recording.notes[0].startswith("rows are frames, counted from 1")


@pytest.mark.parametrize("header", ["Track 1_cam_1_x,Track 1_cam_1_y", "pt10_cam2_X,pt10_cam2_Y"])
def test_the_names_of_both_programs_are_known(header: str, tmp_path: Path) -> None:
    content = build.dltdv(header=header)
    assert READER.claims(Head(content))
    assert opened(tmp_path, content).tracks()[0].name == header.split(",", maxsplit=1)[0][:-2]


def test_points_of_two_cameras_are_told(tmp_path: Path) -> None:
    recording = opened(tmp_path, b"pt1_cam1_X,pt1_cam1_Y,pt1_cam2_X,pt1_cam2_Y\n" + b"1.5,2.5,3.5,4.5\n" * 6)
    assert len(recording.tracks()) == 2
    assert any(note.startswith("points of 2 cameras") for note in recording.notes)


def test_a_frame_rate_must_be_declared_and_a_strange_heading_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="frame rate is unknown"):
        opened(tmp_path, build.dltdv(), declared=Declarations("camera"))
    with pytest.raises(CorruptFileError, match="column 2"):
        opened(tmp_path, build.dltdv(header="pt1_cam1_X,height"))


def test_the_published_points_are_read() -> None:
    recording = READER.open(shared_file("tracks/dltdv8_xypts_pdw_sample.csv"), CAMERA)
    tracks = recording.tracks()
    assert [(t.name, int(t.lost.sum()), len(t.positions)) for t in tracks] == [
        ("pt1_cam1", 0, 117), ("pt2_cam1", 0, 117), ("pt3_cam1", 0, 117), ("pt4_cam1", 115, 117),
    ]  # fmt: skip
    assert tracks[0].positions[0].tolist() == [1527.764274, 334.022240]
    assert 3 in recording.metadata["repeated_frames"]
