"""Whether peaks, time and impulse of virtual shots, whose zeros move, are as uncertain as they say."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_identification.shot.peaks import peaks_of
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from tests.builders.fired_quantities import fired_quantities
from tests.builders.virtual_shots import with_twin

SHOTS_OF_EACH = 60
GROUPS = (("mixed", True, 8100), ("mixed", False, 8200), ("field-2013", True, 8300), ("field-2013", False, 8400))
"""Rig, whether the world is no unkinder than the model, and first seed; no two shots share a draw."""
MOVING = 0.001
"""Share of its range by which a gauge's zero moves."""
COVERAGE = (0.90, 0.99)
WIDER = ("recoil_time_s",)
"""Quantities that may be surer than they say: to a tenth of a millisecond it is a convention when force sets in."""
IMPULSE, WITHIN = 0.01, 0.85
"""Error of an impulse, and the share of shots that are within it: gauges of one per cent leave 0.6 % in the mean."""


def test_each_quantity_is_as_uncertain_as_it_says(capsys, tmp_path: Path):
    off: dict[str, list[float]] = {}
    wrong: dict[str, list[float]] = {}
    for name, kind, first in GROUPS:
        rig = with_twin(name, u_zero_rel=MOVING, kind=kind)
        for seed in range(first, first + SHOTS_OF_EACH):
            simulated = simulate_shot(rig, tmp_path / f"{seed}", seed=seed, shot="1")
            on = dt.date(2026, 6, 1)
            shot = ingest_files(rig, simulated.files, shot="1", out=tmp_path / f"shots-{seed}", on=on).shot
            found = identify_shot(FiredShot(shot, rig), Options())
            true = fired_quantities(found, rig, seed, "1")
            for quantity, peak in peaks_of(found).items():
                off.setdefault(quantity, []).append((peak.value - true[quantity]) / peak.u)
                wrong.setdefault(quantity, []).append(peak.value / true[quantity] - 1.0)
    faults = []
    for quantity, each in off.items():
        z = np.array(each)
        held = float(np.mean(np.abs(z) <= 1.96))
        with capsys.disabled():
            print(
                f"\n{quantity:26s} in U95 {held:.3f} of {z.size}, rms z {np.sqrt(np.mean(z**2)):.2f}, mean "
                f"{z.mean():+.2f}, worst {np.abs(z).max():.1f}, largest error "
                f"{100 * np.abs(wrong[quantity]).max():.2f} %",
                end="",
            )
        if held < COVERAGE[0] or (held > COVERAGE[1] and quantity not in WIDER):
            faults.append(f"{quantity}: {held:.3f}")
    within = float(np.mean(np.abs(wrong["impulse_n_s"]) <= IMPULSE))
    with capsys.disabled():
        print(f"\nimpulse within 1 % in {within:.3f}")
    assert not faults
    assert within >= WITHIN
