"""Every file of tracks that others published or made, beside the checkout: read, or refused by design."""

from __future__ import annotations

from pathlib import Path

import pytest

from recoil_acquisition.errors import UnknownFormatError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise, surest_claim
from tests.builders.shared_data import shared_file

EXPECTED = {
    # name: reader, rate to declare, (track, frames, lost frames) ..., frames that repeat the picture before
    "SYNTHETIC_accel_20kHz.csv": ("Dewesoft text export", None, (), None),
    "SYNTHETIC_deeplabcut.csv": ("DeepLabCut", 2000.0, (("target", 400, 0),), 0),
    "SYNTHETIC_proanalyst_like_2000fps.csv": (
        "ProAnalyst text", None, (("Feature #1", 1899, 16), ("Feature #2", 1899, 0)), 1,
    ),
    "SYNTHETIC_proanalyst_like_noheader.csv": ("ProAnalyst text", None, (("feature1", 400, 9),), 0),
    "SYNTHETIC_proanalyst_like_tab.txt": ("ProAnalyst text", None, (("feature1", 400, 9),), 0),
    "SYNTHETIC_truth_2kHz.csv": ("ProAnalyst text", None, (("feature1", 2400, 0),), 913),
    "dltdv8_xypts_pdw_sample.csv": (
        "DLTdv points", 125.0,
        (("pt1_cam1", 117, 0), ("pt2_cam1", 117, 0), ("pt3_cam1", 117, 0), ("pt4_cam1", 117, 115)), 3,
    ),
    "proanalyst_paws_jones2020_008_129_DB.csv": ("ProAnalyst text", 2000.0, (("feature1", 856, 0),), 787),
    "proanalyst_paws_jones2020_100_AJ_DB.csv": ("ProAnalyst text", 2000.0, (("feature1", 1041, 0),), 935),
}  # fmt: skip
BARE = ("SYNTHETIC_proanalyst_like_noheader.csv",)
"""Nothing in them says that they are tracks: a rig must."""
REFUSED = ("SYNTHETIC_truth.json", "tracker_export_brocku_snippets.txt")


@pytest.mark.parametrize("name", EXPECTED)
def test_a_file_is_read_by_exactly_one_reader_with_its_counts(name: str) -> None:
    path = shared_file(f"tracks/{name}")
    reader, rate_hz, tracks, repeated = EXPECTED[name]
    claim, claiming = surest_claim(Head.of(path))
    assert [one.name for one in claiming] == [reader]
    assert (claim is Claim.SHAPE) == (name in BARE)
    recording = recognise(path, {"camera"} if name in BARE else ()).open(
        path, Declarations("camera", frame_rate_hz=rate_hz)
    )
    assert tuple((t.name, len(t.positions), int(t.lost.sum())) for t in recording.tracks()) == tracks
    assert recording.incomplete == ""
    if repeated is not None:
        assert len(recording.metadata["repeated_frames"]) == repeated
        told = [note for note in recording.notes if note.startswith("repeated pictures")]
        assert [f": {repeated}, frames" in note for note in told] == [True] * bool(repeated)


@pytest.mark.parametrize("name", BARE)
def test_tracks_without_headings_are_none_before_a_rig_says_so(name: str) -> None:
    with pytest.raises(UnknownFormatError, match=r"a table of text of \d+ columns.*`kind = \"camera\"` and a `match`"):
        recognise(shared_file(f"tracks/{name}"))


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_that_is_no_table_of_tracks_is_refused_in_one_line(name: str) -> None:
    with pytest.raises(UnknownFormatError) as caught:
        recognise(shared_file(f"tracks/{name}"))
    assert caught.value.candidates == ()
    assert "\n" not in str(caught.value)


def test_no_file_is_left_out() -> None:
    folder: Path = shared_file("tracks")
    assert {path.name for path in folder.iterdir()} == {*EXPECTED, *REFUSED}
