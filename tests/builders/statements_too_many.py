"""Files of every reader with one statement beside their samples too many, as each format would carry it."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import h5py
import numpy as np

from recoil_acquisition.conformance import STATEMENTS, Case
from tests.builders import container_files as build
from tests.builders import exported_files, mdf3_files, track_files, vendor_files
from tests.builders.oxygen_dmd import oxygen_dmd

Statements = Mapping[str, bytes | Case | str]

LINES = {
    "scale": "Scale factor: 0.5",
    "offset": "Offset: 12.5",
    "unit": "Unit: furlong",
    "range": "Maximum: -1e6",
    "lost": "Missing value: 0",
}
"""Lines of a head."""
NUMBERS: Mapping[str, tuple[str, Any]] = {
    "scale": ("scaling_factor", 0.5),
    "offset": ("zero_offset", 12.5),
    "unit": ("second_unit", "furlong"),
    "range": ("valid_maximum", -1e6),
    "lost": ("missing_code", 0.0),
}
"""Attributes of a signal: name and value."""
DATED = "cannot be: its rows carry their times, and a column beside them is a signal"


def of_lines(content: bytes, at: int = 0, *, comment: str = "", encoding: str = "", end: str = "\r\n") -> Statements:
    """Put a line before one of a text."""
    coding = encoding or "utf-8"
    lines = content.decode(coding).splitlines(keepends=True)
    found: dict[str, bytes | Case | str] = {
        what: "".join([*lines[:at], comment + line + end, *lines[at:]]).encode(coding) for what, line in LINES.items()
    }
    return found | {"counter": DATED}


def _attributed(write: Callable[[str, Any], bytes], **others: bytes | Case | str) -> Statements:
    """Write a file with each attribute of a signal."""
    return {what: write(*NUMBERS[what]) for what in NUMBERS} | others


def _in_hdf5(content: bytes, dataset: str) -> Callable[[str, Any], bytes]:
    def write(name: str, value: Any) -> bytes:
        buffer = io.BytesIO(content)
        with h5py.File(buffer, "r+") as file:
            file[dataset].attrs[name] = value
        return buffer.getvalue()

    return write


def counts(count: int = 40, *, missing: int = 30, behind: int = 25) -> np.ndarray:
    """A counter of rows of which some are missing."""
    numbers = np.arange(count, dtype=np.float64)
    numbers[behind:] += missing
    return numbers


def _counted_hdf5() -> bytes:
    def fill(file: Any) -> None:
        group = file.create_group("AI")
        group.attrs["sample_rate"] = 20000.0
        group["acc"], group["packet"] = build.ramp(40), counts()

    return build.hdf5_file(fill, libver="latest")


def _mat(name: str, value: Any) -> bytes:
    return build.mat_file({**build.dewesoft_variables(), f"Data1_AI_1_{name}": value})


def _counted_mat() -> bytes:
    return build.mat_file({"Sample_rate": 20000.0, "acc": build.ramp(40), "n": counts()})


def _mat_v73(name: str, value: Any) -> bytes:
    codes = np.array([ord(sign) for sign in value], np.uint16) if isinstance(value, str) else np.array([value])
    return build.mat_v73_file({"Data1_time_AI_1": build.ramp(16) + 2.0, "Data1_AI_1": build.ramp(16), name: codes})


def _counted_tdms() -> bytes:
    wave = {"wf_increment": 5e-5, "wf_start_offset": 0.0}
    return build.tdms_file([("AI", "acc", build.ramp(40), wave), ("AI", "n", counts(), wave)])


def _identified(content: bytes, name: str, value: Any) -> bytes:
    """Put a statement into the first line of identification of a Universal File."""
    return content.replace(b"NONE".ljust(80), f"{name}: {value}".encode().ljust(80), 1)


def _wav(name: str, value: Any) -> bytes:
    text = f"{name} = {value}".encode() + b"\0"
    return build.small_wave(build.riff_chunk(b"LIST", b"INFO" + build.riff_chunk(b"ICMT", text)))


def _oxygen(name: str, value: Any) -> bytes:
    from tests.contracts.cases_dmd import CHANNELS

    more = f'<Property name="{name}"><StringValue>{value}</StringValue></Property>'
    first = replace(CHANNELS[0], properties=CHANNELS[0].properties + more)
    blocks = ((0, 10), (10, 10), (20, 4))
    return oxygen_dmd((first, *CHANNELS[1:]), windows=((3, 24),), blocks=blocks, not_stored=("AI 1/3",))


def _of_export(write: Callable[[dict[str, Any]], bytes]) -> Statements:
    said = exported_files.document()

    def with_one(name: str, value: Any) -> bytes:
        first, *rest = said["channels"]
        return write({**said, "channels": [{**first, name: value}, *rest]})

    return _attributed(with_one, counter=DATED)


def _workbook(name: str, value: Any) -> bytes:
    return track_files.workbook({"Tracks": [[f"{name}: {value}"], *track_files.workbook_rows(lost=[5])]})


def _of_database(case: Case) -> Statements:
    """Let the database of a bus say more: a log itself says nothing of its frames' numbers."""

    def with_one(new: str, behind: str = "") -> Case:
        database = vendor_files.DBC.replace(_AX, new) + behind
        return replace(case, declared=replace(case.declared, database=database))

    limits = _AX.replace("[0|0]", "[-0.1|0.1]")
    return {
        "scale": with_one(_AX.replace("0.01,", "0.02,")),
        "offset": with_one(_AX.replace(",0)", ",3)")),
        "unit": with_one(_AX.replace("m/s^2", "furlong")),
        "range": with_one(limits),
        "lost": with_one(limits, '\nVAL_ 256 ax 50 "not available" ;\n'),
        "counter": "cannot be: a bus stamps its frames, and what counts them is declared",
    }


_COUNTED = "cannot be: its frames are counted"
_AX = 'SG_ ax : 0|16@1- (0.01,0) [0|0] "m/s^2"'
FRAMED = dict.fromkeys(STATEMENTS, "cannot be: all that is said of a port's bytes is the rig's framing")


def _oxygen_text(case: Case) -> Statements:
    return of_lines(case.content, encoding="cp1252")


def _declared(case: Case) -> Statements:
    lines: dict[str, bytes | Case | str] = {
        what: case.content.replace(b"some recorder", line.encode()) for what, line in LINES.items()
    }
    return lines | {"counter": DATED}


def _bare(case: Case) -> Statements:
    rows = case.content.splitlines(keepends=True)
    return {what: case.content.replace(b"made by hand", line.encode()) for what, line in LINES.items()} | {
        "counter": b"".join([*rows[:12], *rows[18:]])
    }


def _of_segment(case: Case) -> Statements:
    """Put a key into the head of a segment."""
    mark = b"X_Dimension"
    return {
        what: case.content.replace(mark, "\t".join([name, str(value), str(value)]).encode() + b"\r\n" + mark, 1)
        for what, (name, value) in NUMBERS.items()
    } | {"counter": _counted_segment()}


def _counted_segment() -> bytes:
    from tests.builders.lvm_files import Column, Lvm, columns

    cells = [f"{number:.6f}" for number in counts()]
    return Lvm([[*columns(40), Column("n", "", cells)]]).content()


_WRITERS: Mapping[str, Callable[[Case], Statements]] = {
    "wav": lambda _: _attributed(_wav, counter="cannot be: its samples are sound"),
    "hdf5": lambda case: _attributed(_in_hdf5(case.content, "AI/acc"), counter=_counted_hdf5()),
    "mat": lambda _: _attributed(_mat, counter=_counted_mat()),
    "mat-7.3": lambda _: _attributed(_mat_v73, counter="cannot be: as version 5"),
    "tdms": lambda _: _attributed(
        lambda name, value: build.small_tdms(**{name: value}), counter=_counted_tdms()
    ),
    "uff": lambda case: _attributed(partial(_identified, case.content), counter="cannot be: each dataset has its axis"),
    "mdf": lambda _: _attributed(lambda name, value: build.small_mdf(f"{name} = {value}"), counter=DATED),
    "oxygen": lambda case: (
        _attributed(_oxygen, counter="cannot be: its ticks date the samples")
        if "recording" in case.reader.name else of_lines(case.content)
    ),
    "recoil-csv": lambda _: _of_export(exported_files.csv_file),
    "recoil-parquet": lambda _: _of_export(exported_files.parquet_file),
    "sleap-analysis": lambda case: _attributed(_in_hdf5(case.content, "tracks"), counter=_COUNTED),
    "proanalyst-workbook": lambda _: _attributed(_workbook, counter=DATED),
    "npy": lambda _: dict.fromkeys(STATEMENTS, "cannot be: an array is numbers alone, and one of them their time"),
    "serial": lambda _: FRAMED,
    **dict.fromkeys(
        (
            "asc", "blf", "candump", "trc-2.1", "can-csv", "canedge-csv", "can-sqlite", "mdf-bus-logging",
            "can-capture",
        ),
        _of_database,
    ),
    "lvm": _of_segment,
    "oxygen-unit-row": _oxygen_text,
    "declared": _declared,
    "declared-without-headings": _bare,
    "mdf3": lambda _: _attributed(
        lambda name, value: mdf3_files.small_old_mdf(remark=f"{name} = {value}"), counter=DATED
    ),
        **dict.fromkeys(
        ("dewesoft", "tracks", "dasylab", "deeplabcut", "dltdv", "tracker", "sleap-text"),
        lambda case: of_lines(case.content),
    ),
    **dict.fromkeys(
        ("tektronix", "infiniium", "rohde-schwarz", "lecroy", "yokogawa", "picoscope", "rigol", "siglent"),
        lambda case: of_lines(case.content, 1),
    ),
}  # fmt: skip


def with_statements(case: Case) -> Case:
    """Give a case its files with a statement too many; none where another case of its reader has them."""
    write = _WRITERS.get(case.name)
    return case if write is None else replace(case, too_many=write(case))
