"""Files of the readers of recorders' text tables, for the rules that every reader keeps."""

from __future__ import annotations

from recoil_acquisition.conformance import Case
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import BY_LAYOUT, READERS
from tests.builders import text_tables as build
from tests.builders import vendor_files

BY_NAME = {reader.name: reader for reader in READERS}
RECORDER = Declarations("dewetron")


def at_line_end(cut: bytes) -> bool:
    return cut.endswith((b"\n", b"\r"))


def at_wide_line_end(cut: bytes) -> bool:
    return cut[: len(cut) // 2 * 2].endswith(b"\n\0")


FIRST, SECOND = (100.0, 140.0), (-761.0, 0.0)
OXYGEN = {"AI 1/1": FIRST, "AI 2/1": SECOND}
VIDEO = b"Time (s),AI 1/a (g (peak)),Video/Camera 0 (),AI 2/b ()\r" + b"".join(
    b"%.4f,%d,%d,\r" % (i / 1e3, i, i // 10) for i in range(40)
)
CASES = (
    Case(
        "dewesoft-video-cp1252-cr",
        BY_NAME["Dewesoft text export"],
        "Prüfstand\r".encode("cp1252") + VIDEO.replace(b"AI 1/a", "Höhe".encode("cp1252")),
        RECORDER,
        {"Höhe": (0.0, 40.0), "Video/Camera 0": (0.0, 4.0)},
        at_line_end,
    ),
    Case(
        "dewesoft-month-of-another-language",
        BY_NAME["Dewesoft text export"],
        b"Time (-)\tAI 1/a (m/s2)\n" + b"".join(b"03-Okt-26 12:23:05,%03d\t%d,5\n" % (i, i) for i in range(40)),
        RECORDER,
        {"AI 1/a": (0.0, 40.0)},
        at_line_end,
    ),
    Case(
        "dewesoft-long-preamble",
        BY_NAME["Dewesoft text export"],
        vendor_files.dewesoft_text(
            vendor_files.motion_rows(40), separator=";", preamble=["x"] * 30, encoding="utf-8-sig"
        ),
        RECORDER,
        {"AI 1/acc": (-200.0, 200.0)},
        at_line_end,
    ),
    Case("oxygen", BY_NAME["OXYGEN text export"], build.OXYGEN, RECORDER, OXYGEN, at_line_end),
    Case("oxygen-unit-row", BY_NAME["OXYGEN text export"], build.OXYGEN_UNIT_ROW, RECORDER, OXYGEN, at_line_end),
    Case("oxygen-absolute", BY_NAME["OXYGEN text export"], build.OXYGEN_ABSOLUTE, RECORDER, OXYGEN, at_wide_line_end),
    Case(
        "dasylab",
        BY_NAME["DASYLab ASCII"],
        build.DASYLAB,
        RECORDER,
        {"voltage": FIRST, "voltage2": SECOND},
        at_line_end,
    ),
    Case(
        "dasylab-tabs",
        BY_NAME["DASYLab ASCII"],
        build.DASYLAB_TABS,
        RECORDER,
        {"Disp": FIRST, "Load": SECOND},
        at_line_end,
    ),
)

DECLARED = BY_LAYOUT["dewetron"]
DECLARED_CASES = (
    Case(
        "declared",
        DECLARED,
        build.DECLARED,
        Declarations("dewetron", layout=build.DECLARED_LAYOUT),
        {"u": FIRST, "v": SECOND},
        at_line_end,
    ),
    Case(
        "declared-without-headings",
        DECLARED,
        build.BARE,
        Declarations("dewetron", layout=build.BARE_LAYOUT),
        {"p": (0.0, 80.0)},
        at_line_end,
    ),
    Case(
        "declared-stamps-by-number",
        DECLARED,
        build.OXYGEN_ABSOLUTE,
        Declarations("dewetron", layout={"separator": "\t", "header_row": 1, "first_row": 2, "time_column": 1}),
        OXYGEN,
        at_wide_line_end,
    ),
)
"""Of the reader that claims nothing, because the rig chooses it."""
