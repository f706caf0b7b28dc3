from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import surest_claim
from recoil_acquisition.readers.text_file import LongText
from recoil_acquisition.readers.tracks import layout as track_layout
from recoil_acquisition.readers.tracks.layout import spread_text
from recoil_acquisition.readers.tracks.tracker_text import TrackerTextReader
from tests.builders import track_files as build
from tests.builders.opened_files import open_bytes
from tests.builders.shared_data import shared_file

READER = TrackerTextReader()
opened = partial(open_bytes, READER, "a.txt", declared=Declarations("camera"))


@pytest.mark.parametrize("separator", ["\t", ";", ",", "   "])
def test_one_track_is_read_with_its_lost_steps(separator: str, tmp_path: Path) -> None:
    content = build.tracker(lost=[] if separator == "   " else [4], separator=separator)
    assert [reader.name for reader in surest_claim(Head(content))[1]] == ["Tracker text"]
    recording = opened(tmp_path, content)
    (track,) = recording.tracks()
    assert (track.name, track.unit) == ("cm_A", "")
    seen = ~track.lost
    assert np.flatnonzero(track.lost).tolist() == ([] if separator == "   " else [4])
    np.testing.assert_allclose(track.positions[seen, 0], build.X[seen], rtol=1e-9)
    np.testing.assert_allclose(track.time_base.times_s, np.arange(build.COUNT) / 500.0, atol=1e-12)
    assert recording.metadata["frame_rate_hz"] == 500.0


@pytest.mark.exhaustive
@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    lines=st.lists(st.text("  a1.µ", max_size=20) | st.text("  a;\t", max_size=12), min_size=2, max_size=40),
    encoding=st.sampled_from(["utf-8", "cp1252", "utf-16"]),
)
def test_a_text_is_spread_in_parts_as_line_by_line(
    lines: list[str], encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.txt"
    lines = ["µ", *lines]
    path.write_bytes("\r\n".join(lines).encode(encoding))
    with monkeypatch.context() as patched:
        patched.setattr(track_layout, "PART_BYTES", 64)
        spread = spread_text(LongText(path))
    assert spread.data.decode() == "\n".join(map(track_layout.spread, lines))


def test_a_decimal_comma_is_read(tmp_path: Path) -> None:
    content = build.tracker(separator=";").replace(b".", b",")
    np.testing.assert_allclose(opened(tmp_path, content).read("cm_A x"), build.X, rtol=1e-9)


def test_several_tracks_share_the_time_and_velocities_are_derived(tmp_path: Path) -> None:
    recording = opened(tmp_path, build.tracker_several())
    assert [s.name for s in recording.signals] == ["cm A x", "cm A y", "cm B v_{x}", "cm B v_{y}"]
    assert [t.name for t in recording.tracks()] == ["cm A"]
    assert np.flatnonzero(np.isnan(recording.read("cm B v_{x}"))).tolist() == [0, build.COUNT - 1]
    assert any("its own filter: cm B v_{x}, cm B v_{y}" in note for note in recording.notes)


def test_a_frame_column_numbers_the_steps(tmp_path: Path) -> None:
    rows = "".join(f"{i * 0.01:.3f}\t{5 * i}\t{i}.5\t1.25\n" for i in range(12))
    recording = opened(tmp_path, f"mass A\nt\tframe\tx\ty\n{rows}".encode())
    assert recording.tracks()[0].frame_numbers.tolist() == list(range(0, 60, 5))


@pytest.mark.parametrize("content", [b"cm_A\nt\tx\ty\n", b"x\ty\n1\t2\n", b"#multi:\n\tA\nt\n0.1\n"])
def test_a_file_without_header_or_rows_is_refused(content: bytes, tmp_path: Path) -> None:
    assert not READER.claims(Head(content))
    with pytest.raises(CorruptFileError, match="no header of a Tracker export"):
        opened(tmp_path, content)


def test_time_that_does_not_increase_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError, match="time does not increase"):
        opened(tmp_path, b"cm_A\nt\tx\ty\n0.1\t1\t2\n0.2\t1\t2\n0.1\t1\t2\n")


def test_the_three_quoted_variants_are_read_and_the_page_itself_is_not(tmp_path: Path) -> None:
    page = shared_file("tracks/tracker_export_brocku_snippets.txt").read_text(encoding="utf-8")
    assert surest_claim(Head(page.encode()))[0] is Claim.NO
    variants = [part.strip("\n").partition("---")[0] for part in page.split("---\n")[1:]]
    assert len(variants) == 3
    positions, velocities, several = (f"{v.strip(chr(10))}\n".encode() for v in variants)
    recording = opened(tmp_path, positions)
    assert [(t.name, t.positions.shape) for t in recording.tracks()] == [("cm_A", (2, 2))]
    assert recording.read("cm_A x").tolist() == [12.45986911, 11.64289057]
    recording = opened(tmp_path, velocities)
    assert [s.name for s in recording.signals] == ["cm_A v_{x}", "cm_A v_{y}"]
    assert np.isnan(recording.read("cm_A v_{x}")[0])
    assert recording.tracks() == ()
    assert READER.claims(Head(several))
    with pytest.raises(ReadError, match="time does not increase"):
        opened(tmp_path, several)
    recording = opened(tmp_path, several.rstrip() + b"\n0.064\t30.1\t23.2\t-26.1\t22.1\n")
    assert [s.name for s in recording.signals] == ["cm A vx", "cm A vy", "cm B vx", "cm B vy"]
    assert recording.read("cm B vx").tolist() == [-26.66, -26.1]


def test_blanks_between_tabs_are_an_empty_cell(tmp_path: Path) -> None:
    lines = build.tracker().decode().split("\n")
    lines[5] = lines[5].split("\t")[0] + "\t  \t   \t"
    assert np.flatnonzero(opened(tmp_path, "\n".join(lines).encode()).tracks()[0].lost).tolist() == [3]
