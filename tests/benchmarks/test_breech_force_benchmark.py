"""How well the motion tells the breech force: peak, impulse and band against the truth, over shots of the twin."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.targets.forces.breech_force import find
from recoil_identification.targets.target import Case
from recoil_rigs.rig import load_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import draw_scene, simulate_shot

SHOTS = 20
FIRST_SEED = 7001
"""Shots that nothing was tuned on."""
PEAKS = ("peak_force", "peak_force_inversion")
IMPULSES = ("impulse", "impulse_inversion")


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_force_by_the_motion_is_the_true_force(benchmark, capsys, tmp_path: Path, name):
    rig = load_rig(name)
    shots, motions = [], []
    for seed in range(FIRST_SEED, FIRST_SEED + SHOTS):
        simulated = simulate_shot(rig, tmp_path / str(seed), seed=seed, shot=f"s{seed}")
        out = tmp_path / "shots"
        shots.append(ingest_files(rig, simulated.files, shot=f"s{seed}", out=out, on=dt.date(2026, 6, 1)).shot)
        # what the projectile's friction in the bore takes off does not drive the part
        left = 1.0 - simulated.truth["bore_friction"]
        motions.append((draw_scene(rig, seed, f"s{seed}").motion, left * rig.mechanism.bore_area))
        for file in simulated.files:
            file.unlink()

    findings = benchmark.pedantic(
        lambda: [find(Case(FiredShot(shot, rig))) for shot in shots], rounds=1, warmup_rounds=0
    )

    errors = {symbol: [] for symbol in (*PEAKS, *IMPULSES)}
    inside = {"force_n": [], "force_inversion_n": []}
    for finding, (motion, area_m2) in zip(findings, motions, strict=True):
        force = area_m2 * motion.breech_pressure_pa
        columns = finding.series.columns
        times = columns["time_s"]
        truth, free = np.interp(times, motion.times_s, force), np.isfinite(columns["force_n"])
        impulse = np.trapezoid(truth[free], times[free])
        for symbols, true in ((PEAKS, force.max()), (IMPULSES, impulse)):
            for symbol in symbols:
                quantity = finding.quantity(symbol)
                errors[symbol].append((quantity.value / true - 1, quantity.u / true))
        for method, shares in inside.items():
            within = np.abs(columns[method] - truth) < 1.96 * columns[f"u_{method}"]
            shares.append(np.mean(within[free]))
    valid = sum(finding.valid for finding in findings)
    coverage = {}
    with capsys.disabled():
        print(f"\n{name}, {SHOTS} shots, {valid} valid, {benchmark.stats.stats.min / SHOTS:.1f} s each")
        print(f"{'quantity':22} {'bias %':>8} {'sd %':>7} {'mean u %':>9} {'coverage':>9}")
        for symbol, rows in errors.items():
            error, u = np.array(rows).T
            coverage[symbol] = np.mean(np.abs(error) < 1.96 * u)
            figures = 100 * error.mean(), 100 * error.std(ddof=1), 100 * u.mean()
            print(f"{symbol:22} {figures[0]:+8.3f} {figures[1]:7.3f} {figures[2]:9.3f} {coverage[symbol]:9.2f}")
        for method, shares in inside.items():
            print(f"samples of {method} inside the 95 % band: {np.mean(shares):.3f}, least shot {np.min(shares):.3f}")
    assert coverage["peak_force"] >= 0.85
    assert coverage["impulse"] >= 0.85
    assert coverage["impulse_inversion"] >= 0.85
    assert coverage["peak_force_inversion"] >= 0.75
    assert all(np.mean(shares) > 0.88 for shares in inside.values())
    assert valid >= 0.9 * SHOTS
