"""How often the intervals of law, friction and balances hold the truth, over shots of the virtual rig."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.targets.resistance.target import SHARES, find
from recoil_identification.targets.target import Case
from recoil_rigs.rig import load_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import read_settings, simulate_shot

SHOTS = 20
FIRST_SEED = 7001
"""Shots that nothing was tuned on."""


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_law_of_the_resistance_is_the_true_law(benchmark, capsys, tmp_path: Path, name):
    rig = load_rig(name)
    settings, m = read_settings(rig), rig.mechanism
    loss = 0.5 * settings.oil_density_kg_m3 * (m.brake_area / settings.discharge) ** 2
    shots, truths = [], []
    for seed in range(FIRST_SEED, FIRST_SEED + SHOTS):
        simulated = simulate_shot(rig, tmp_path / str(seed), seed=seed, shot=f"s{seed}")
        out = tmp_path / "shots"
        shots.append(ingest_files(rig, simulated.files, shot=f"s{seed}", out=out, on=dt.date(2026, 6, 1)).shot)
        truths.append(simulated.truth)
        for file in simulated.files:
            file.unlink()

    cases = [Case(FiredShot(shot, rig)) for shot in shots]
    findings = benchmark.pedantic(lambda: [find(case) for case in cases], rounds=1, warmup_rounds=0)

    rows: dict[str, list[tuple[float, float, float, bool]]] = {}
    for finding, truth in zip(findings, truths, strict=True):
        true = {
            "p0": settings.recuperator_pressure_pa,
            "V0": settings.recuperator_volume_m3,
            "n_gas": settings.polytropic,
            "friction": truth["friction"],
            "friction_by_shot": truth["friction"],
            "travel": truth["stroke_m"],
            **dict.fromkeys(("energy_left_peak", "energy_left_end", "momentum_left_peak", "momentum_left_end"), 0.0),
        }
        for share in SHARES:
            symbol = f"c_{100 * share:.0f}"
            x = float(finding.quantity(symbol).basis.split(" at ")[-1].split()[0])
            orifice = settings.leak_m2 + settings.orifice_m2 * np.sqrt(1 - x / settings.stroke_m)
            true[symbol] = m.brake_area * loss / orifice**2
        for symbol, value in true.items():
            quantity = finding.quantity(symbol)
            low, high = quantity.U95
            rows.setdefault(symbol, []).append((quantity.value - value, quantity.u, value, low <= value <= high))
    valid, sound = sum(finding.valid for finding in findings), sum(case.identified.valid for case in cases)
    with capsys.disabled():
        took_s = benchmark.stats.stats.min / SHOTS
        print(f"\n{name}, {SHOTS} shots, {sound} with a valid mass, {valid} valid, {took_s:.1f} s each")
        print(f"{'quantity':20} {'truth':>10} {'bias':>10} {'sd':>10} {'mean u':>10} {'coverage':>9}")
        for symbol, found in rows.items():
            error, u, value, held = np.array(found).T
            figures = value.mean(), error.mean(), error.std(ddof=1), u.mean()
            print(f"{symbol:20}" + "".join(f" {figure:10.4g}" for figure in figures) + f" {held.mean():9.2f}")
    assert all(np.mean([row[3] for row in found]) >= 0.8 for found in rows.values())
    # a camera that repeats a picture, or a sensor that is far off by chance, is the mass's reason, not the balances'
    assert valid >= sound - 1
