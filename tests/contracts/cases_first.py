"""Files of the readers of text, buses, ports and captures, for the rules that every reader keeps."""

from __future__ import annotations

from recoil_acquisition.conformance import Case
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import READERS
from tests.builders import can_captures
from tests.builders import vendor_files as build
from tests.builders.rdlog_bytes import at_record_end

BY_NAME = {reader.name: reader for reader in READERS}
CAN = Declarations("can", database=build.DBC)
CAN_MAGNITUDES = {"ACC.ax": (-10, 10), "ACC.p": (0, 20), "GYR.gx": (-1, 10), "EXT.low": (0, 100), "EXT.high": (0, 100)}
DEWESOFT_MAGNITUDES = {"AI 1/acc": (-200.0, 200.0), "AI 2/p": (0.0, 50.0)}


def at_line_end(cut: bytes) -> bool:
    return cut.endswith((b"\n", b"\r"))


ABSOLUTE = "Time (-);AI 1/a (m/s2)\r\n" + "".join(f"03-Aug-26 12:23:05.{i:03d};{i},5\r\n" for i in range(100, 140))
CASES = (
    Case(
        "dewesoft",
        BY_NAME["Dewesoft text export"],
        build.dewesoft_text(build.motion_rows()),
        Declarations("dewetron"),
        DEWESOFT_MAGNITUDES,
        at_line_end,
    ),
    Case(
        "dewesoft-utf16-semicolon",
        BY_NAME["Dewesoft text export"],
        build.dewesoft_text(
            build.motion_rows(),
            separator=";",
            decimal=",",
            preamble=["Größe", "", "x"],
            encoding="utf-16",
            line_end="\n",
        ),
        Declarations("dewetron"),
        DEWESOFT_MAGNITUDES,
        lambda cut: cut[: len(cut) // 2 * 2].endswith(b"\n\0"),
    ),
    Case(
        "dewesoft-absolute",
        BY_NAME["Dewesoft text export"],
        ABSOLUTE.encode(),
        Declarations("dewetron"),
        {"AI 1/a": (99.0, 141.0)},
        at_line_end,
    ),
    Case(
        "tracks",
        BY_NAME["ProAnalyst text"],
        build.tracks_text(skip=[7], lost=[11, 12]),
        Declarations("camera", frame_rate_hz=6000.0),
        {"Feature #1 - X": (0.0, 20.0), "Feature #1 - Y": (-10.0, 0.0)},
        at_line_end,
    ),
    Case(
        "tracks-without-header",
        BY_NAME["ProAnalyst text"],
        build.tracks_text(header=None, line_end="\n"),
        Declarations("camera"),
        {"feature1 X": (0.0, 20.0), "feature1 Y": (-10.0, 0.0)},
        at_line_end,
    ),
    Case("asc", BY_NAME["Vector ASC log"], build.asc_log(build.can_entries()), CAN, CAN_MAGNITUDES),
    Case("blf", BY_NAME["Vector BLF log"], build.blf_log(build.can_entries()), CAN, CAN_MAGNITUDES),
    Case("candump", BY_NAME["candump log"], build.candump_log(build.can_entries()), CAN, CAN_MAGNITUDES, at_line_end),
    Case(
        "can-capture",
        BY_NAME["recoil-daq capture"],
        can_captures.can_capture(can_captures.can_records(build.can_entries())),
        CAN,
        CAN_MAGNITUDES,
        at_record_end,
    ),
    Case(
        "serial",
        BY_NAME["recoil-daq capture"],
        build.serial_capture(build.serial_frames()),
        Declarations("imu", framing=build.FRAMING),
        {"gyro": (0.0, 1.0), "temperature": (15.0, 30.0)},
        at_record_end,
    ),
)
