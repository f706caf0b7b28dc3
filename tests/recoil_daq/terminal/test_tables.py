"""Tables in a terminal: whole words on eighty columns, and a row a shot where there are several."""

from __future__ import annotations

import io
import re
from typing import Any

import pytest

from recoil_daq.terminal.console import VisibleConsole, shown
from recoil_daq.terminal.ingest import print_verdict
from recoil_daq.terminal.report import print_masses
from recoil_daq.terminal.tables import print_table

COLUMNS = ("method", "mass, kg", "u, kg", "deviation, %", "RPE, %", "identified, %", "how")
HOW = "acceleration on forces, both filtered alike, every sensor's scale restricted by its calibration"
ROWS = [("calibrated *", "783.00", "2.66", "+0.13", "0.33", "100", HOW), ("weak", "777.50", "5.46", "-", "-", "1", "")]


def printed(width: int, rows=ROWS, columns=COLUMNS, **options) -> list[str]:
    file = io.StringIO()
    print_table("Shot 0001", columns, rows, (1, 2, 3, 4, 5), VisibleConsole(file=file, width=width, **options))
    return file.getvalue().splitlines()


@pytest.mark.parametrize("width", [80, 90, 100, 140, 200])
def test_a_sentence_in_the_last_column_keeps_its_words_whole(width: int) -> None:
    lines = printed(width)
    assert max(map(len, lines)) <= width
    words = " ".join(lines).split()
    assert all(word in words for word in HOW.split())
    row = re.compile(r"calibrated \* +783\.00 +2\.66 +\+0\.13 +0\.33 +100")
    assert sum(row.match(line) is not None for line in lines) == 1


def test_below_its_row_it_stands_where_the_terminal_is_narrow_and_beside_it_where_it_is_short() -> None:
    lines = printed(80, [ROWS[0], (*ROWS[1][:-1], "short")])
    assert lines[0] == "Shot 0001"
    assert lines[1].endswith("identified, %  how")
    assert lines[3].startswith("    acceleration on forces")
    assert lines[-1].endswith("1  short")
    at = [line.index("kg") for line in lines if "kg" in line]
    assert at == [lines[1].index("kg")]


def test_a_verdict_keeps_its_colour_above_a_sentence() -> None:
    rows = [("p_brake", "can", "fail", HOW)]
    lines = printed(60, rows, ("channel", "clock", "verdict", "finding"), color_system="standard", force_terminal=True)
    assert any("\x1b[1;31m" in line and "fail" in line for line in lines)


def test_a_reason_of_the_verdict_is_not_printed_twice() -> None:
    detail = "31 samples at 16 MPa; raise the range before the next shot"
    document = {
        "shot": "0001", "rig": "mixed", "file": "shots/0001.h5", "usable": False, "reasons": [f"p_brake: {detail}"],
        "channels": [{"name": "p_brake", "clock": "can", "rate_hz": 2000.0, "samples": 4000}], "log_fault": None,
        "quality": [{"channel": "p_brake", "check": "range", "verdict": "fail", "detail": detail}],
    }  # fmt: skip
    file = io.StringIO()
    print_verdict(document, VisibleConsole(file=file, width=140))
    text = file.getvalue()
    assert text.count("31 samples") == 1
    assert "range, see below" in text
    assert f"NOT USABLE: p_brake: {detail}" in text


def report(shot: str, note: str, *, valid: bool = True, deviation: str = "") -> dict[str, Any]:
    return {
        "shot": shot, "mass": {"value": 783.0, "U95": [777.8, 788.2]}, "E_n": 0.19, "valid": valid,
        "reasons": [] if valid else ["the clocks"], "deviation": deviation, "note": note,
    }  # fmt: skip


def test_several_shots_end_in_a_row_each() -> None:
    reports = [report("0001", ""), report("0002", "", deviation="E_n"), report("0003", "", valid=False)]
    text = shown(lambda: print_masses(reports)).export_text()
    assert re.search(r"0001 +783\.00 +5\.20 +\+0\.19 +VALID *$", text, re.MULTILINE)
    assert re.search(r"0002 +783\.00 +5\.20 +\+0\.19 +VALID, deviates *$", text, re.MULTILINE)
    assert re.search(r"0003 +783\.00 +5\.20 +\+0\.19 +NOT VALID +the clocks *$", text, re.MULTILINE)
    assert shown(lambda: print_masses(reports[:1])).export_text() == ""
