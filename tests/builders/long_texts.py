"""A long file of every reader of text, of about as many bytes as asked for."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.readers.reader import Declarations, Reader
from recoil_acquisition.readers.table import BY_LAYOUT, READERS
from tests.builders import can_logs, container_files, exported_files, vendor_files
from tests.builders import text_tables as tables
from tests.builders.lvm_files import Lvm, columns
from tests.builders.oscilloscope_texts import WAVEFORMS

BY_NAME = {reader.name: reader for reader in READERS}
RECORDER, CAMERA = Declarations("dewetron"), Declarations("camera", frame_rate_hz=2000.0)
BUS = Declarations("can", database=vendor_files.DBC)

PERIOD = 2000
"""Rows after which a channel's samples are the same again."""

FIRST = (150.0 * np.sin(np.arange(PERIOD) / 7.0)).tolist()
SECOND = (400.0 + 90.0 * np.cos(np.arange(PERIOD) / 31.0)).tolist()


@dataclass(frozen=True)
class LongText:
    """A reader with what it needs to know, and its file of some rows.

    Attributes
    ----------
    reader : Reader
    declared : Declarations
    written : callable
        Of the number of rows: the file.
    """

    reader: Reader
    declared: Declarations
    written: Callable[[int], bytes]

    def content(self, size: int) -> bytes:
        """Return a file of about so many bytes."""
        return self.written(size * PERIOD // len(self.written(PERIOD)))


def lines(head: str, row: Callable[[int, float, float], str], end: str = "\n") -> Callable[[int], bytes]:
    """Return the writer of a table: of its lines above, and of a row by its number and two samples."""

    def written(count: int) -> bytes:
        rows = (row(i, FIRST[i % PERIOD], SECOND[(3 * i) % PERIOD]) + end for i in range(count))
        return (head + "".join(rows)).encode()

    return written


def exported(count: int) -> bytes:
    """Write our CSV."""
    said = exported_files.document(time={"start_s": 0.0, "step_s": 5e-05, "count": count})
    head = ['# recoil-daq: "csv/1"']
    head += [f"# {key}: {json.dumps(value)}" for key, value in said.items() if key != "channels"]
    head += [f"# channel: {json.dumps(channel)}" for channel in said["channels"]]
    head += ['time_s [s],p_breech [Pa],"acc, recoil [m/s^2]"']
    return lines("\n".join(head) + "\n", lambda i, x, y: f"{i * 5e-05!r},{x!r},{y!r}")(count)


def entries(count: int) -> list[vendor_files.CanEntry]:
    """Return so many frames of a bus, which are the same again after a second."""
    once = vendor_files.can_entries(1000)
    return [(10**9 * (i // len(once)) + once[i % len(once)][0], *once[i % len(once)][1:]) for i in range(count)]


def camera(layout: Mapping[str, object]) -> Declarations:
    """Declare a layout and a frame rate."""
    return Declarations("camera", frame_rate_hz=2000.0, layout=layout)


LONG_TEXTS: Mapping[str, LongText] = {
    "dewesoft": LongText(
        BY_NAME["Dewesoft text export"], RECORDER,
        lines("Time (s)\tAI 1/a (m/s2)\tAI 2/p (MPa)\r\n", lambda i, x, y: f"{i / 2e4:.6f}\t{x:.6f}\t{y:.6f}", "\r\n"),
    ),
    "oxygen": LongText(
        BY_NAME["OXYGEN text export"], RECORDER,
        lines("Time [s],AI 1/1 [m/s²],AI 2/1 [MPa]\r\n", lambda i, x, y: f"{i / 2e4:.6f},{x:.6f},{y:.6f}", "\r\n"),
    ),
    "dasylab": LongText(
        BY_NAME["DASYLab ASCII"], RECORDER,
        lines("Measurement time[s]\tDisp [in]\tLoad [lb]\n", lambda i, x, y: f"{i / 5e3:.4f}\t{x:.6f}\t{y:.6f}"),
    ),
    "declared-text": LongText(
        BY_LAYOUT["dewetron"], Declarations("dewetron", layout=tables.DECLARED_LAYOUT),
        lines("some recorder\nt|u|v\nms|bar|-\n", lambda i, x, y: f"{i / 20:.2f}|{x:.6f}|{y:.6f}".replace(".", ",")),
    ),
    **{
        name: LongText(BY_NAME[write(40).maker], RECORDER, lambda count, write=write: write(count).content)
        for name, write in WAVEFORMS.items()
        if name != "tektronix-beside"  # such a file has 2,500 rows
    },
    "lvm": LongText(BY_NAME["LabVIEW measurement"], RECORDER, lambda count: Lvm([columns(count)]).content()),
    "recoil-csv": LongText(BY_NAME["recoil-daq CSV"], RECORDER, exported),
    "uff": LongText(
        BY_NAME["UFF 58"], RECORDER, lambda count: container_files.uff_text(np.resize(np.array(FIRST), 4 * count))
    ),
    "proanalyst": LongText(
        BY_NAME["ProAnalyst text"], RECORDER,
        lines("Frame,Time (s),A - X (mm),A - Y (mm)\r\n", lambda i, x, y: f"{i},{i / 6e3:.6f},{x:.4f},{y:.4f}", "\r\n"),
    ),
    "deeplabcut": LongText(
        BY_NAME["DeepLabCut"], CAMERA,
        lines("scorer,n,n,n\nbodyparts,tip,tip,tip\ncoords,x,y,likelihood\n",
              lambda i, x, y: f"{i},{x!r},{y!r},0.999972"),
    ),
    "dltdv": LongText(
        BY_NAME["DLTdv points"], CAMERA, lines("pt1_cam1_X,pt1_cam1_Y\r\n", lambda _, x, y: f"{x:.3f},{y:.3f}", "\r\n")
    ),
    "tracker": LongText(
        BY_NAME["Tracker text"], CAMERA,
        lines("mass_A\nt\tx\ty\t\n", lambda i, x, y: f"{i / 2e3:.4f}\t{x:.2f}\t{y:.2f}\t"),
    ),
    "tracker-spaces": LongText(
        BY_NAME["Tracker text"], CAMERA,
        lines("          mass_A\nt         x         y\n", lambda i, x, y: f"{i / 2e3:.4f}    {x:.4f}    {y:.4f}"),
    ),
    "sleap": LongText(
        BY_NAME["SLEAP text"], CAMERA,
        lines("track,frame_idx,instance.score,tip.x,tip.y,tip.score\n",
              lambda i, x, y: f"net_{i % 2},{i // 2},0.9412,{x:.4f},{y:.4f},0.8731"),
    ),
    "declared-tracks": LongText(
        BY_LAYOUT["camera"],
        camera({"separator": ";", "decimal": ",", "header_row": 1, "first_row": 2, "frame_column": "N", "unit": "px",
                "features": [{"name": "mark", "x": "X", "y": "Y"}]}),
        lines("N;X;Y;Z\n", lambda i, x, y: f"{i};{x:.4f};{y:.4f};0".replace(".", ",")),
    ),
    "asc": LongText(
        BY_NAME["Vector ASC log"], BUS, lambda count: vendor_files.asc_log(entries(count))
    ),
    "candump": LongText(
        BY_NAME["candump log"], BUS, lambda count: vendor_files.candump_log(entries(count))
    ),
    "trc": LongText(
        BY_NAME["PEAK TRC trace"], BUS, lambda count: can_logs.trc_log(entries(count))
    ),
    "can-csv": LongText(
        BY_NAME["python-can CSV log"], BUS, lambda count: can_logs.can_csv(entries(count))
    ),
    "canedge-csv": LongText(
        BY_NAME["CANedge CSV log"], BUS, lambda count: can_logs.canedge_csv(entries(count))
    ),
}  # fmt: skip
