"""Heads whose lines are as wide as the rows below them: a label, and a cell for each column."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from recoil_acquisition.readers.text.proposed_layout import ProposedLayout, propose_layout
from tests.builders.opened_files import open_table

NAMES, UNITS = 'Channel name,"Force","Pressure"', 'Unit,"V","bar"'
STAMP, STEP = "Timestamp,2024-03-01 10:00:00,2024-03-01 10:00:00", "Interval,0.0005,0.0005"
ROWS = [f"{k},{0.1 * k:.3f},{0.2 * k:.3f}" for k in range(40)]


def proposed(head: list[str]) -> ProposedLayout:
    found = propose_layout([*head, *ROWS])
    assert found is not None
    return found


@pytest.mark.parametrize(
    "head",
    [
        [STAMP, STEP, NAMES, UNITS],
        [NAMES, STAMP, STEP, UNITS],
        [NAMES, UNITS, STAMP, STEP],
        [STAMP, STEP, NAMES, UNITS, "", ",,", ""],
        ["// Sample rate: 2kHz", NAMES, UNITS],
    ],
)
def test_names_units_and_step_are_found_in_a_head_as_wide_as_the_rows(head: list[str], tmp_path: Path) -> None:
    found = proposed(head)
    layout = {**found.table, "rate_hz": found.rate_hz}
    recording = open_table(tmp_path, "\n".join([*head, *ROWS, ""]), layout=layout)
    assert [(one.name, one.unit) for one in recording.signals][1:] == [("Force", "V"), ("Pressure", "bar")]
    assert recording.time_base("Force").rate_hz == pytest.approx(2000.0)
    assert recording.read("Force").size == len(ROWS)


@pytest.mark.parametrize("line", ["Sample rate: 100 Hz and no more: 7 Hz", "Interval 1e999", "Interval 1e-320", "dt 0"])
def test_a_step_that_no_recorder_has_is_none(line: str) -> None:
    found = proposed([line, STEP if line.startswith("Sample") else "", NAMES, UNITS])
    assert math.isnan(found.rate_hz)


def test_a_long_line_of_digits_takes_no_time_to_speak_of() -> None:
    assert math.isnan(proposed([f"Sample rate {'9' * 100_000}", NAMES, UNITS]).rate_hz)
