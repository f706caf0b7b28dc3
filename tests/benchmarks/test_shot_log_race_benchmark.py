"""Rows and cells that races on the shot log lose: commands at once, a slow save in place, a kill.

`RECOIL_DAQ_LOG_RACES` sets how many there are (200 by default).
"""

from __future__ import annotations

import os
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

from tests.builders.log_races import KINDS, run_race

RACES = int(os.environ.get("RECOIL_DAQ_LOG_RACES", "200"))
AT_ONCE = 8


def test_no_race_on_the_shot_log_loses_a_row_or_a_cell(tmp_path, capsys):
    with ThreadPoolExecutor(AT_ONCE) as pool:
        races = list(pool.map(lambda number: run_race(tmp_path / str(number), number), range(RACES)))
    kinds = Counter(race.kind for race in races)
    rows, cells = sum(race.rows for race in races), sum(len(race.written) for race in races)
    lost = [f"race {number}, {race.kind}: {one}" for number, race in enumerate(races) for one in race.lost]
    refused = [f"race {number}: {one}" for number, race in enumerate(races) for one in race.refused]
    with capsys.disabled():
        told = ", ".join(f"{kinds[kind]} of {kind}" for kind in KINDS)
        print(f"\nshot log: {RACES} races ({told}): {len(lost)} of {rows} rows and {cells} cells lost; "
              f"{len(refused)} commands refused")  # fmt: skip
    assert not lost, "\n".join(lost)
    assert not refused, "\n".join(refused)
