from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import ReadError, UnknownFormatError
from recoil_acquisition.readers.tracks.proanalyst_text import ProAnalystTextReader
from recoil_daq.recording.ingest import ingest_files, reader_of
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.twin import simulate_shot
from tests.builders.vendor_files import tracks_text
from tests.builders.virtual_shots import SHORTER, with_twin

LAYOUT = """frame_rate = 6000.0
layout = { separator = ";", decimal = ",", header_row = 2, frame_column = "Bild", time_column = 2, unit = "mm", \
lost = ["weg"], features = [{ name = "Rohr", x = "RX", y = "RY" }] }"""


def with_layout(rig: Rig | None = None) -> Rig:
    text = (rig or load_rig("field-2013")).text.replace("frame_rate = 6000.0", LAYOUT.replace("\\\n", ""), 1)
    return parse_rig(text.replace('signal = "Feature #1 - X"', 'signal = "Rohr x"'), Path("rig.toml"))


def test_a_declared_layout_chooses_the_reader_by_the_sources_pattern(tmp_path: Path) -> None:
    path = tmp_path / "a_camera.csv"
    path.write_bytes(tracks_text())
    assert reader_of(path, load_rig("field-2013")).name == "ProAnalyst text"
    assert reader_of(path, with_layout()).name == "declared track table"


def test_numbers_alone_are_tracks_where_the_name_is_a_cameras(tmp_path: Path) -> None:
    rig = load_rig("field-2013")
    for name in ("s1_camera.csv", "s1_other.csv", "s1_dewetron.csv"):
        (tmp_path / name).write_bytes(tracks_text(header=None))
    assert reader_of(tmp_path / "s1_camera.csv", rig).name == "ProAnalyst text"
    for name in ("s1_other.csv", "s1_dewetron.csv"):
        with pytest.raises(UnknownFormatError, match="say in a rig whose it is"):
            reader_of(tmp_path / name, rig)


def test_a_recognised_file_never_hides_a_declared_layout(tmp_path: Path) -> None:
    rig = with_layout()
    path = tmp_path / "other.csv"
    path.write_bytes(tracks_text())
    reader = reader_of(path, rig)
    with pytest.raises(ReadError, match="declares a layout, and the file was recognised without it"):
        reader.open(path, rig.declarations(rig.source("camera")))


@pytest.mark.whole_way
def test_a_shot_has_the_same_track_by_a_declared_table_as_by_the_export(tmp_path: Path) -> None:
    rig = with_twin("field-2013", **SHORTER)
    files = simulate_shot(rig, tmp_path / "files", seed=3, shot="s1").files
    on = dt.date(2026, 6, 1)
    camera = next(Path(f) for f in files if Path(f).name.endswith("_camera.csv"))
    export = ProAnalystTextReader().open(camera, rig.declarations(rig.source("camera")))
    expected_m, times_s = 1e-3 * export.read("Feature #1 - X"), export.time_base("Feature #1 - X").times_s
    rows = [line.split(",") for line in camera.read_text(encoding="utf-8").splitlines()[1:]]
    lines = ["Aufnahme 1;;;", "Bild;Zeit;RX;RY;Bemerkung"]
    lines += [";".join([*(cell.replace(".", ",") for cell in row[:4]), "gut"]) for row in rows]
    text = "".join(line + "\n" for line in lines).replace(";-1;-1;", ";weg;weg;")
    camera.write_text(text, encoding="utf-8")
    ingested = ingest_files(with_layout(rig), files, shot="s1", out=tmp_path / "declared", on=on)
    channel = next(c for c in rig.channels if c.source == "camera")
    declared = ingested.shot.channels[channel.name]
    assert np.isfinite(declared.samples).sum() > 1000
    np.testing.assert_allclose(declared.samples, channel.polarity * expected_m, rtol=1e-12)
    np.testing.assert_array_equal(declared.time_base.times_s, times_s)
    assert [i.reader for i in ingested.shot.inputs if i.source == "camera"] == ["declared track table"]
