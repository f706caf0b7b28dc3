"""A file whose clock was never set: no date is taken from it, and verdict, shot log and report say so."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest

from recoil_rigs.twin import TwinShot

_STARTED = 40
"""Place of the year, month, weekday and day of the start in the head of a BLF file."""


@pytest.mark.whole_way
@pytest.mark.parametrize("year", [1601, 1904, 1970, 9999])
def test_a_start_that_no_instrument_can_have_had_is_no_date_of_the_shot(
    run, mixed_shot: TwinShot, tmp_path: Path, year: int
) -> None:
    log = next(file for file in mixed_shot.files if file.suffix == ".blf")
    blf = bytearray(log.read_bytes())
    struct.pack_into("<4H", blf, _STARTED, year, 1, 1, 1)
    (tmp_path / log.name).write_bytes(blf)
    files = [*(file for file in mixed_shot.files if file != log and file.suffix == ".csv"), tmp_path / log.name]
    imu = [file for file in mixed_shot.files if "imu" in file.name]
    run("ingest", mixed_shot.rig_file, *files, *imu, "--out", tmp_path / "shots", "--json")
    shown = json.loads(run("show", tmp_path / "shots" / "0001.h5", "--json").stdout)
    doubts = [c for c in shown["quality"] if c["channel"] == "can" and str(year) in c["detail"]]
    assert [c["verdict"] for c in doubts] == ["warn"], shown["quality"]
    assert shown["started"] is None
    log_row = (tmp_path / "shots" / "shotlog.csv").read_text("utf-8")
    assert str(year) not in log_row
    if year == 1970:
        run("identify", tmp_path / "shots", "--out", tmp_path / "reports", "--json")
        report = json.loads((tmp_path / "reports" / "0001" / "report.json").read_text("utf-8"))
        assert report["started"] is None
        assert [one["severity"] for one in report["findings"] if str(year) in one["text"]] == ["warn"]
        assert str(year) in (tmp_path / "reports" / "0001" / "report.html").read_text("utf-8")
