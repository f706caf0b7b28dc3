"""How often the stated intervals hold the true inertia forces: of their peaks over shots, and over time."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.targets.forces.inertia_force import find
from recoil_identification.targets.parameters.inertia_forces import FORCES, UNITS, inertia_forces
from recoil_identification.targets.target import Case
from recoil_rigs.mechanism.mechanism_regressor import Geometry, standard_parameters
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import draw_scene, simulate_shot
from tests.builders.virtual_shots import with_twin

SHOTS = 20
FIRST_SEED = 7001
"""Shots that nothing was tuned on."""


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_stated_intervals_hold_the_true_forces(benchmark, capsys, tmp_path: Path, name):
    rig = with_twin(name, sample_rate_hz=25e3, duration_s=0.4)
    cases, truths = [], []
    for seed in range(FIRST_SEED, FIRST_SEED + SHOTS):
        simulated = simulate_shot(rig, tmp_path / str(seed), seed=seed, shot=f"s{seed}")
        out = tmp_path / "shots"
        shot = ingest_files(rig, simulated.files, shot=f"s{seed}", out=out, on=dt.date(2026, 6, 1)).shot
        cases.append(Case(FiredShot(shot, rig)))
        scene = draw_scene(rig, seed, f"s{seed}")
        m, motion = scene.mechanism, scene.motion
        true = inertia_forces(Geometry.of(m), standard_parameters(m), motion.q, motion.qd, motion.qdd)
        recoil = (motion.times_s >= motion.t_fire_s) & (motion.times_s <= motion.t_end_s)
        truths.append((motion.times_s[recoil], true[recoil]))
        for file in simulated.files:
            file.unlink()
    for case in cases:
        assert case.identified  # the mass is computed before the clock runs

    findings = benchmark.pedantic(lambda: [find(case) for case in cases], rounds=1, warmup_rounds=0)

    rows = []
    for k, force in enumerate(FORCES):
        miss, u, over_time, peaks = [], [], [], []
        for found, (times, true) in zip(findings, truths, strict=True):
            q = found.quantity(f"peak_{force}")
            peaks.append(true[np.argmax(np.abs(true[:, k])), k])
            miss.append(q.value - peaks[-1])
            u.append(q.u)
            columns = found.series.columns
            unit = "n_m" if UNITS[k] == "N m" else "n"
            inside = (columns["time_s"] >= times[0]) & (columns["time_s"] <= times[-1])
            off = np.abs(columns[f"{force}_{unit}"] - np.interp(columns["time_s"], times, true[:, k]))
            over_time.append(np.mean((off <= 1.96 * columns[f"u_{force}_{unit}"])[inside]))
        miss, u = np.array(miss), np.array(u)
        held = float(np.mean(np.abs(miss) <= 1.96 * u))
        rows.append((force, np.mean(peaks), miss.mean(), miss.std(ddof=1), u.mean(), held, np.mean(over_time)))
    with capsys.disabled():
        valid = sum(f.valid for f in findings)
        print(f"\n{name}, {SHOTS} shots, {valid} valid, {benchmark.stats.stats.min / SHOTS:.2f} s each")
        print(f"{'peak':18} {'true':>11} {'bias':>9} {'sd':>9} {'mean u':>9} {'coverage':>9} {'over time':>9}")
        for force, true, bias, sd, mean_u, held, time in rows:
            print(f"{force:18} {true:11.0f} {bias:+9.1f} {sd:9.1f} {mean_u:9.1f} {held:9.2f} {time:9.3f}")
    assert min(row[5] for row in rows) >= 0.75
    assert np.mean([row[5] for row in rows]) >= 0.88
    assert min(row[6] for row in rows) >= 0.9
