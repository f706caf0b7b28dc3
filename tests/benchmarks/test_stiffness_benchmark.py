"""How often the stated intervals hold stiffness and damping of the virtual rig: bias, scatter, coverage."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.targets.stiffness.stiffness_budget import SYMBOLS
from recoil_identification.targets.stiffness.support_modes import DERIVED, derived_values
from recoil_identification.targets.stiffness.target import find
from recoil_identification.targets.target import Case
from recoil_rigs.rig import load_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from recoil_rigs.twin.settings import TwinSettings

SHOTS = 20
FIRST_SEED = 7001
"""Shots that nothing was tuned on."""


@pytest.mark.parametrize(("name", "factor", "count"), [
    ("field-2013", 1.0, SHOTS), ("mixed", 1.0, SHOTS), ("field-2013", 0.5, 6), ("field-2013", 2.0, 6),
    ("mixed", 0.5, 6), ("mixed", 2.0, 6),
])  # fmt: skip
def test_the_stated_intervals_hold_the_true_parameters(benchmark, capsys, tmp_path: Path, name, factor, count):
    plain = load_rig(name)
    s = TwinSettings()
    k_elevating = factor * s.elevating_stiffness_n_m_rad
    rig = replace(plain, twin={**plain.twin, "elevating_stiffness_n_m_rad": k_elevating, "tube_modes": 0})
    k, c = s.ground_stiffness_n_m, s.ground_damping_n_s_m
    true = np.array([k_elevating, s.elevating_damping_n_m_s_rad, k, c, rig.mechanism.f, k, c, k, c])
    true = np.concatenate([true, derived_values(rig.mechanism, true)])
    symbols = (*SYMBOLS, *(symbol for symbol, _, _ in DERIVED))
    shots = []
    for seed in range(FIRST_SEED, FIRST_SEED + count):
        simulated = simulate_shot(rig, tmp_path / str(seed), seed=seed, shot=f"s{seed}")
        out = tmp_path / "shots"
        shots.append(ingest_files(rig, simulated.files, shot=f"s{seed}", out=out, on=dt.date(2026, 6, 1)).shot)
        for file in simulated.files:
            file.unlink()

    findings = benchmark.pedantic(
        lambda: [find(Case(FiredShot(shot, rig))) for shot in shots], rounds=1, warmup_rounds=0
    )

    value, u = (
        np.array([[getattr(f.quantity(symbol), key) for symbol in symbols] for f in findings]) for key in ("value", "u")
    )
    error = 100 * (value / true - 1)
    held = np.where(np.isfinite(value), np.abs(value - true) <= 1.96 * u, np.nan)
    with capsys.disabled():
        print(f"\n{name}, elevating stiffness times {factor:g}, {count} shots, {sum(f.valid for f in findings)} valid,")
        print(f"{benchmark.stats.stats.min / count:.1f} s each")
        print(f"{'quantity':20} {'bias %':>8} {'sd %':>7} {'mean u %':>9} {'coverage':>9} {'shots':>6}")
        for i, symbol in enumerate(symbols):
            known = np.isfinite(value[:, i])
            print(
                f"{symbol:20} {error[known, i].mean():+8.2f} {error[known, i].std(ddof=1):7.2f} "
                f"{np.mean(100 * u[known, i] / true[i]):9.2f} {held[known, i].mean():9.2f} {known.sum():6d}"
            )
    assert np.isfinite(value).mean() > 0.95
    assert np.nanmean(held) >= 0.9
    assert np.nanmin(np.nanmean(held, axis=0)) >= 0.75
    assert np.abs(np.nanmean(error[:, :2], axis=0)).max() < 3.0
