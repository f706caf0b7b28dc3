"""The rate of a table without times, as a line above it states it: a proposal to a person."""

from __future__ import annotations

import math

import pytest

from recoil_acquisition.readers.text.proposed_layout import propose_layout


@pytest.mark.parametrize(
    ("head", "rate_hz", "line"),
    [
        (["// Sample rate: 50.0Hz"], 50.0, 1),
        (["made by hand", "Abtastrate [Hz]: 2,5 kHz"], 2500.0, 2),
        (["Sampling frequency = 20000"], 20000.0, 1),
        (["Interval;0.0005"], 2000.0, 1),
        (["Abtastintervall: 20 us"], 50000.0, 1),
        (["Sample rate: 50 Hz", "Interval: 20 ms"], 50.0, 1),
        # two that contradict each other, and none
        (["Rate acc: 50 Hz", "Rate gyro: 100 Hz"], math.nan, 0),
        (["Date: 24.11.2026", "Operator 4711"], math.nan, 0),
        (["Sample rate: 0 Hz", "Interval: 1,000"], math.nan, 0),
    ],
)
def test_the_rate_that_lines_above_a_table_state_is_proposed(head: list[str], rate_hz: float, line: int) -> None:
    rows = [f"{k};{k * k};0" for k in range(20)]
    found = propose_layout([*head, "n;acc;p", *rows])
    assert found is not None
    assert (found.rate_hz, found.rate_line) == (pytest.approx(rate_hz, nan_ok=True), line)
    # nothing of it is in the layout that a rig declares before somebody says so
    assert "rate_hz" not in found.table
