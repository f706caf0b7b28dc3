"""The table at the end of every command over many shots: aligned, and whole on narrow terminals."""

from __future__ import annotations

from typing import Any

import pytest

from recoil_daq.live.tables import print_session
from recoil_daq.terminal import console
from recoil_daq.terminal.console import shown
from recoil_daq.terminal.ingest import print_ingested_folder
from recoil_daq.terminal.overview import mass_cells, print_shots
from recoil_daq.terminal.report import print_targets

REASON = "the residual is four times the noise: look at the brake gauge, which lags the others by two milliseconds"
ROWS = [
    {
        "shot": f"{number:04d}", "fired": "2026-03-02 08:00:00", "state": "record only", "warnings": str(number),
        **mass_cells(775.3 + 10 * number, (765.3, 785.2), -0.66), "verdict": "NOT VALID" if number else "VALID",
        "reason": REASON if number else "",
    }
    for number in range(3)
]  # fmt: skip


def lines_of(rows: list[dict[str, str]], width: int, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.setattr(console, "PIPED_WIDTH", width)
    return shown(lambda: print_shots("Shots", rows)).export_text().splitlines()


@pytest.mark.parametrize("width", [60, 80, 100, 120, 140])
def test_no_cell_is_cut_and_no_line_is_wider_than_the_terminal(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = lines_of(ROWS, width, monkeypatch)
    assert max(map(len, lines)) <= width
    assert not any("…" in line for line in lines)
    words = " ".join(lines).split()
    assert words.count("milliseconds") == 2
    assert [line.split()[0] for line in lines if line[:1].isdigit()] == ["0000", "0001", "0002"]
    # numbers stand below one another
    ends = {line.index(mass) + len(mass) for line, mass in zip((o for o in lines if o[:1].isdigit()), (
        row["mass"] for row in ROWS), strict=True)}  # fmt: skip
    assert len(ends) == 1


def test_a_column_in_which_nothing_stands_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    heading = lines_of([{"shot": "0001", "verdict": "VALID", "mass": ""}], 120, monkeypatch)[1]
    assert heading.split() == ["shot", "verdict"]


def test_a_narrow_terminal_goes_without_the_instants_first(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "fired at" in lines_of(ROWS, 120, monkeypatch)[1]
    heading = lines_of(ROWS, 72, monkeypatch)[1]
    assert "fired at" not in heading
    assert "mass, kg" in heading
    assert "verdict" in heading


def ingested(shot: str, **changes: Any) -> dict[str, Any]:
    return {
        "shot": shot, "files": ["a", "b"], "verdict": "warn", "state": "usable", "warnings": ["p: low"], "reasons": [],
        "file": f"shots/{shot}.h5", "log_fault": None, "error": None, **changes,
    }  # fmt: skip


def test_a_folder_that_was_ingested_and_a_live_session_end_in_it() -> None:
    shots = [ingested("0001"), ingested("0002", state="not usable", reasons=[REASON])]
    document = {"rig": "mixed", "shots": shots, "left_alone": [], "shot_log": None}
    text = shown(lambda: print_ingested_folder(document)).export_text()
    assert "usable" in text
    assert "lags the others" in " ".join(text.split())
    live = {
        "rig": "mixed", "journal": None,
        "shots": [
            {"shot": "0001", "acquisition": {"trigger_utc": "2026-03-02T08:00:00.123456"}, "ingest": None,
             "state": "failed", "problem": "the disk is full", "capture": None},
        ],
    }  # fmt: skip
    lines = shown(lambda: print_session(live)).export_text().splitlines()
    assert lines[2].split() == ["0001", "2026-03-02", "08:00:00.123", "UTC", "failed", "the", "disk", "is", "full"]


def test_targets_of_several_shots_have_a_row_each_and_those_of_one_none() -> None:
    quantity = {
        "name": "peak breech pressure", "symbol": "p", "value": 128.4, "u": 0.6, "U95": [127.2, 129.6], "unit": "MPa",
        "declared": None, "E_n": None, "basis": "the gauge",
    }  # fmt: skip
    targets = [
        {"shot": shot, "target": "peak", "quantities": [quantity], "valid": True, "reasons": []}
        for shot in ("0001", "0002")
    ]
    lines = shown(lambda: print_targets(targets)).export_text().splitlines()
    assert [line.split()[0] for line in lines[2:]] == ["0001", "0002"]
    assert "128.40 MPa" in lines[2]
    assert shown(lambda: print_targets(targets[:1])).export_text() == ""
