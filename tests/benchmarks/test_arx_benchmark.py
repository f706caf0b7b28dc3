"""Target `arx`: coverage over shots of the virtual rig."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from time import process_time

import numpy as np
import pytest

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.targets.arx.target import find
from recoil_identification.targets.target import Case
from recoil_rigs.rig import load_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot

SHOTS = 60
FIRST_SEED = 7001
"""Shots that nothing was tuned on."""

# processor time: what else the machine does is no part of the figures
pytestmark = pytest.mark.benchmark(timer=process_time)


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_intervals_of_the_target_hold_the_true_mass(benchmark, capsys, tmp_path: Path, name):
    rig = load_rig(name)
    cases, truths = [], []
    for seed in range(FIRST_SEED, FIRST_SEED + SHOTS):
        simulated = simulate_shot(rig, tmp_path / str(seed), seed=seed, shot=f"s{seed}")
        out = tmp_path / "shots"
        shot = ingest_files(rig, simulated.files, shot=f"s{seed}", out=out, on=dt.date(2026, 6, 1)).shot
        cases.append(Case(FiredShot(shot, rig)))
        truths.append(simulated.truth["m3"])
        for file in simulated.files:
            file.unlink()
    for case in cases:
        assert case.identified  # its time is not the target's

    findings = benchmark.pedantic(lambda: [find(case) for case in cases], rounds=1, warmup_rounds=0)

    true = np.array(truths)
    valid = sum(found.valid for found in findings)
    white, independent, fit = (
        np.array([found.parameters[key] for found in findings])
        for key in ("whiteness_p", "independence_p", "fit_percent")
    )
    with capsys.disabled():
        print(f"\n{name}, {SHOTS} shots, {valid} valid, {benchmark.stats.stats.min / SHOTS:.2f} s each beyond the mass")
        print(f"{'quantity':16} {'bias %':>8} {'sd %':>7} {'mean u %':>9} {'coverage':>9}")
        value, u = np.array([(q.value, q.u) for q in (found.quantity("m_dc") for found in findings)]).T
        low, high = np.array([found.quantity("m_dc").U95 for found in findings]).T
        error = 100 * (value / true - 1)
        covered = float(np.mean((low <= true) & (true <= high)))
        print(
            f"{'m_dc':16} {error.mean():+8.3f} {error.std(ddof=1):7.3f} {np.mean(100 * u / value):9.3f} {covered:9.2f}"
        )
        orders = sorted({(f.parameters["na"], f.parameters["nb"], f.parameters["delay"]) for f in findings})
        print(
            f"residuals white in {np.sum(white >= 0.01)}, independent of the force in {np.sum(independent >= 0.01)};"
            f" fit {fit.min():.2f} to {fit.max():.2f} %; orders {orders}"
        )
    assert valid >= 0.9 * SHOTS
    assert covered >= 0.85
    assert fit.min() > 98.5
