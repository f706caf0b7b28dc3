"""The draft of a rig file from the files of one shot: its time and memory, and what it says."""

from __future__ import annotations

import resource
import time
from pathlib import Path

import pytest

from recoil_daq.drafting.init import draft_rig
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import simulate_shot

MOST_S = 3.0
"""Time for a shot of four files, processor of one core."""
MOST_MB = 300.0
"""Memory beyond what was in use before."""


@pytest.mark.benchmark(group="init")
def test_a_draft_takes_no_longer_than_reading_its_files(benchmark, tmp_path: Path) -> None:
    mixed_shot = simulate_shot(load_rig("mixed"), tmp_path, seed=1, shot="0001")
    database = mixed_shot.rig_file.with_name("mixed.dbc")
    before_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    begun = time.process_time()
    drafted = draft_rig(mixed_shot.files, databases=[database])
    took_s = time.process_time() - begun
    used_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - before_mb
    benchmark.pedantic(draft_rig, (mixed_shot.files,), {"databases": [database]}, rounds=3)
    print(f"init of {mixed_shot.rig_file.stem}: {took_s:.2f} s of processor, {used_mb:.0f} MB more")
    assert {one.role for one in drafted.roles.by_signal.values()} >= {"breech_pressure", "recoil_displacement"}
    assert took_s < MOST_S
    assert used_mb < MOST_MB
