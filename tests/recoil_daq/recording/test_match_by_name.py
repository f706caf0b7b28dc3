"""The pattern of a source decides on a file before what it begins with does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.table import recognise
from recoil_daq.recording.ingest import match_sources, reader_of
from recoil_rigs.rig import Rig, parse_rig
from tests.rigs.shots.test_assemble import HEAD

CAMERA = """
[[source]]
name = "camera"
kind = "camera"
match = "*_cam*"
frame_rate = 2000.0
align = { method = "fixed", offset_s = 0.0 }
"""
CHANNEL = '[[channel]]\nname = "p"\nsource = "recorder"\nsignal = "p"\nquantity = "pressure"\n'
TIMES = np.arange(40) / 2000.0
X = np.round(100.0 * (1 - np.cos(60 * TIMES)), 3)


def stand(recorder: str = 'match = "*_daq*"', camera: str = CAMERA) -> Rig:
    return parse_rig(HEAD + f"{recorder}\n" + camera + CHANNEL, Path("stand.toml"))


def written(folder: Path, name: str, heading: str, *, separator: str = ",", frames: bool = False) -> Path:
    rows = [f"{i if frames else f'{t:.4f}'}{separator}{x}" for i, (t, x) in enumerate(zip(TIMES, X, strict=True))]
    path = folder / name
    path.write_text("\n".join([*heading.splitlines(), *rows, ""]))
    return path


@pytest.mark.parametrize(
    "heading",
    ["time (s),x (mm)", "Time (s),Muzzle - X (mm)", "Time [s],Point#1 X [mm]", "time,x", "Time,x\n[s],[mm]"],
)
@pytest.mark.parametrize("recorder", ['match = "*_daq*"', ""])
def test_a_cameras_table_that_begins_with_time_is_its_sources(heading, recorder, tmp_path):
    """It has one coordinate, and no second one is missed."""
    rig = stand(recorder)
    daq = written(tmp_path, "0001_daq.csv", "Time (s),p (bar)")
    track = written(tmp_path, "0001_cam.csv", heading)
    files = [(path, reader_of(path, rig)) for path in (daq, track)]
    assert match_sources(rig, files) == {"recorder": daq, "camera": track}
    recording = files[1][1].open(track, rig.declarations(rig.source("camera")))
    (found,) = recording.tracks()
    assert found.axes == ("X",)
    np.testing.assert_array_equal(found.positions[:, 0], X)
    np.testing.assert_allclose(found.time_base.times_s, TIMES, atol=1e-12)


def test_the_same_table_under_the_recorders_name_is_the_recorders(tmp_path):
    rig = stand()
    path = written(tmp_path, "0001_daq.csv", "time (s),x (mm)")
    reader = reader_of(path, rig)
    assert reader.kind == "dewetron"
    assert match_sources(rig, [(path, reader)]) == {"recorder": path}


def test_without_a_name_that_fits_the_content_decides_as_it_did(tmp_path):
    path = written(tmp_path, "other.csv", "time (s),x (mm)")
    assert reader_of(path, stand()) is recognise(path)
    both = stand('match = "*"')
    named_for_both = written(tmp_path, "0001_cam.csv", "time (s),x (mm)")
    assert reader_of(named_for_both, both) is recognise(named_for_both)


def test_a_table_without_a_coordinate_is_not_called_a_track(tmp_path):
    """It is told for which source its name is, not only that the recorder has its file already."""
    rig = stand()
    daq = written(tmp_path, "0001_daq.csv", "Time (s),p (bar)")
    pressure = written(tmp_path, "0001_cam.csv", "Time (s),p (bar)")
    files = [(path, reader_of(path, rig)) for path in (daq, pressure)]
    with pytest.raises(ReadError, match="whose name fits the `match` of 'camera'") as caught:
        match_sources(rig, files)
    assert "source 'recorder' already has 0001_daq.csv" in str(caught.value)
