"""How often the stated interval holds the true mass, over shots of the virtual rig: bias, scatter, coverage, RPE."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from identification.analysis import Options, identify_shot
from recoil_daq.ingest import ingest_files
from rigs.rig import load_rig
from rigs.twin import simulate_shot

SHOTS = 40


@pytest.fixture(autouse=True)
def _only_when_asked_for(request):
    if not request.config.getoption("benchmark_enable"):
        pytest.skip("a benchmark of minutes: ask for it with --benchmark-enable")


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_stated_interval_holds_the_true_mass(benchmark, capsys, tmp_path: Path, name):
    rig = load_rig(name)
    shots, truths = [], []
    for seed in range(1001, 1001 + SHOTS):
        simulated = simulate_shot(rig, tmp_path / str(seed), seed=seed, shot=f"s{seed}")
        out = tmp_path / "shots"
        shots.append(ingest_files(rig, simulated.files, shot=f"s{seed}", out=out, on=dt.date(2026, 6, 1)).shot)
        truths.append(simulated.truth["m3"])
        for file in simulated.files:
            file.unlink()

    identifications = benchmark.pedantic(
        lambda: [identify_shot(shot, rig, Options()) for shot in shots], rounds=1, warmup_rounds=0
    )

    table = {}
    for method in identifications[0].results:
        results = [found.results[method] for found in identifications if method in found.results]
        mass, u, rpe = np.array([(r.estimate.mass_kg, r.estimate.u_kg, r.rpe_percent) for r in results]).T
        low, high = np.array([r.estimate.interval_kg for r in results]).T
        true = np.array([t for t, found in zip(truths, identifications, strict=True) if method in found.results])
        error = 100 * (mass / true - 1)
        covered = np.mean((low <= true) & (true <= high))
        table[method] = (error.mean(), error.std(ddof=1), np.mean(100 * u / mass), covered, rpe.mean(), len(results))
    valid = sum(found.valid for found in identifications)
    with capsys.disabled():
        print(f"\n{name}, {SHOTS} shots, {valid} valid, {benchmark.stats.stats.min / SHOTS:.2f} s each to identify")
        print(f"{'method':12} {'bias %':>8} {'sd %':>7} {'mean u %':>9} {'coverage':>9} {'RPE %':>7} {'shots':>6}")
        for method, (bias, sd, u, covered, rpe, count) in table.items():
            print(f"{method:12} {bias:+8.3f} {sd:7.3f} {u:9.3f} {covered:9.3f} {rpe:7.3f} {count:6d}")
    bias, _, _, covered, rpe, count = table["calibrated"]
    assert count == SHOTS
    assert covered >= 0.85
    assert abs(bias) < 0.25
    assert rpe < 1.0
    assert valid >= 0.9 * SHOTS
