"""Whether the headline numbers of breech force, balances and gas law are as uncertain as they say, by worst group."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.targets import target_function
from recoil_identification.targets.target import Case
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import draw_scene, read_settings, simulate_shot
from tests.builders.virtual_shots import with_twin

SHOTS_OF_EACH = 20
GROUPS = (("mixed", False, 9000), ("mixed", True, 9100), ("field-2013", False, 9200), ("field-2013", True, 9300))
"""Rig, whether its gauges read all forces in time, and first seed; no two shots share a draw."""
CHARGES = (1.0, 0.8)
PEAK_PA = 130e6
LEAST_OF_GROUP = 20
HEADLINES = {
    "breech-force": ("impulse", "impulse_inversion"),
    "resistance": ("energy_left_end", "momentum_left_end", "p0", "V0", "n_gas"),
}
RMS, LEAST_COVERAGE, LEAST_OF_WORST = (0.75, 1.25), 0.9, 0.85


class Judged(NamedTuple):
    """Error of one number over its standard uncertainty, and what its shot belongs to."""

    symbol: str
    z: float
    groups: tuple[str, ...]


def judged(rig: Rig, seed: int, charge: float, kind: bool, folder: Path) -> Iterator[Judged]:
    """Fire, ingest and identify a shot, and compare its targets with the truth."""
    simulated = simulate_shot(rig, folder / "files", seed=seed, shot="1")
    shot = ingest_files(rig, simulated.files, shot="1", out=folder / "shots", on=dt.date(2026, 6, 1)).shot
    case, settings, motion = Case(FiredShot(shot, rig)), read_settings(rig), draw_scene(rig, seed, "1").motion
    found = {name: target_function(name)(case) for name in HEADLINES}
    columns = found["breech-force"].series.columns
    free = np.isfinite(columns["force_n"])
    # what the projectile's friction in the bore takes off does not drive the part
    area_m2 = (1.0 - simulated.truth["bore_friction"]) * rig.mechanism.bore_area
    force_n = area_m2 * np.interp(columns["time_s"], motion.times_s, motion.breech_pressure_pa)
    impulse = float(np.trapezoid(force_n[free], columns["time_s"][free]))
    truth = {
        "impulse": impulse,
        "impulse_inversion": impulse,
        "energy_left_end": 0.0,
        "momentum_left_end": 0.0,
        "p0": settings.recuperator_pressure_pa,
        "V0": settings.recuperator_volume_m3,
        "n_gas": settings.polytropic,
    }
    groups = (f"rig {rig.name}", "kind" if kind else "unkind", f"charge {charge:g}")
    for name, symbols in HEADLINES.items():
        for symbol in symbols:
            quantity = found[name].quantity(symbol)
            yield Judged(symbol, (quantity.value - truth[symbol]) / quantity.u, groups)


def test_targets_are_as_uncertain_as_they_say(capsys, tmp_path: Path):
    every: list[Judged] = []
    for name, kind, first in GROUPS:
        for number in range(SHOTS_OF_EACH):
            charge = CHARGES[number % len(CHARGES)]
            rig = with_twin(
                name, u_zero_rel=0.001, kind=kind, sample_rate_hz=25e3, duration_s=0.4,
                peak_pressure_pa=charge * PEAK_PA,
            )  # fmt: skip
            every += judged(rig, first + number, charge, kind, tmp_path / f"{first + number}")

    faults = []
    with capsys.disabled():
        print(f"\n{'number':20} {'rms z':>6} {'mean':>6} {'in U95':>7}  worst group of at least {LEAST_OF_GROUP}")
        for symbol in (one for symbols in HEADLINES.values() for one in symbols):
            own = [one for one in every if one.symbol == symbol]
            z = np.array([one.z for one in own])
            groups = {group: np.array([one.z for one in own if group in one.groups]) for group in of_all(own)}
            shares = {
                group: float(np.mean(np.abs(of) < 1.96)) for group, of in groups.items() if of.size >= LEAST_OF_GROUP
            }
            worst, rms, coverage = (
                min(shares, key=lambda group: shares[group]),
                np.sqrt(np.mean(z**2)),
                float(np.mean(np.abs(z) < 1.96)),
            )
            print(
                f"{symbol:20} {rms:6.2f} {z.mean():6.2f} {coverage:7.2f}  {worst}: {shares[worst]:.2f}, "
                f"rms {np.sqrt(np.mean(groups[worst] ** 2)):.2f}"
            )
            if not (RMS[0] <= rms <= RMS[1] and coverage >= LEAST_COVERAGE and shares[worst] >= LEAST_OF_WORST):
                faults.append(symbol)
    assert faults == []


def of_all(judged_ones: list[Judged]) -> list[str]:
    return sorted({group for one in judged_ones for group in one.groups})
