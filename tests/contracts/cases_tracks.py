"""Files of the readers of camera tracks, for the rules that every reader keeps."""

from __future__ import annotations

from recoil_acquisition.conformance import Case
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import READERS
from tests.builders import track_files as build

BY_NAME = {reader.name: reader for reader in READERS}
CAMERA = Declarations("camera", frame_rate_hz=500.0)


def at_line_end(cut: bytes) -> bool:
    return cut.endswith((b"\n", b"\r"))


CASES = (
    Case(
        "deeplabcut",
        BY_NAME["DeepLabCut"],
        build.deeplabcut(likelihood={7: 0.1}),
        CAMERA,
        {"tip x": (190.0, 500.0), "base y": (200.0, 260.0), "tip likelihood": (0.0, 1.0)},
        at_line_end,
    ),
    Case(
        "dltdv",
        BY_NAME["DLTdv points"],
        build.dltdv(lost=[5, 6]),
        CAMERA,
        {"pt1_cam1_X": (190.0, 500.0), "pt1_cam1_Y": (200.0, 260.0)},
        at_line_end,
    ),
    Case(
        "tracker",
        BY_NAME["Tracker text"],
        build.tracker(lost=[5]),
        Declarations("camera"),
        {"cm_A x": (190.0, 500.0), "cm_A y": (-260.0, -200.0)},
        at_line_end,
    ),
    Case(
        "tracker-several",
        BY_NAME["Tracker text"],
        build.tracker_several(),
        Declarations("camera"),
        {"cm A x": (190.0, 500.0), "cm B v_{x}": (1.0, 2.0)},
        at_line_end,
    ),
    Case(
        "sleap-text",
        BY_NAME["SLEAP text"],
        build.sleap_text(missing=[7]),
        CAMERA,
        {"tip.x": (190.0, 500.0), "instance.score": (0.0, 1.0)},
        at_line_end,
    ),
    Case(
        "sleap-analysis",
        BY_NAME["SLEAP analysis"],
        build.sleap_analysis(),
        CAMERA,
        {"tip.x": (190.0, 500.0), "base.score": (0.0, 1.0)},
    ),
    Case(
        "proanalyst-workbook",
        BY_NAME["ProAnalyst workbook"],
        build.workbook({"Tracks": build.workbook_rows(lost=[5])}),
        Declarations("camera"),
        {"Muzzle X": (190.0, 500.0), "Muzzle Y": (200.0, 260.0)},
    ),
)
