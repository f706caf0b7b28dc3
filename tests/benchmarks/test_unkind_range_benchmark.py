"""The mass where a range is unkind: forces that no gauge reads, a rest that is quiet, a motion that is loud.

`RECOIL_DAQ_UNKIND_SHOTS` sets how many shots of each rig are fired for each row (1 by default; the published figures
are of 12), and of how many of the range as it is drawn the coverage is (ten times as many). Each row draws its own
errors of sensors and friction. Two processes share them.
"""

from __future__ import annotations

import datetime as dt
import math
import os
import tempfile
import zlib
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, binomtest

from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.remark import ReasonCode
from recoil_daq.recording.ingest import ingest_files
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from tests.builders.judged import halves, interval_score, worst_group
from tests.builders.virtual_shots import with_twin

SHOTS = int(os.environ.get("RECOIL_DAQ_UNKIND_SHOTS", "1"))
RIGS = ("field-2013", "mixed")
MPA = 1e6
FORCES: Mapping[str, Mapping[str, float]] = {
    "packings 1 %": {"packing_share": 0.01},
    "packings 2 %": {"packing_share": 0.02},
    "packings 3 %": {"packing_share": 0.03},
    "vacuum -0.1 MPa": {"back_pressure_pa": -0.1 * MPA},
    "back pressure +0.3 MPa": {"back_pressure_pa": 0.3 * MPA},
    "slides 60 N s/m": {"slide_n_s_m": 60.0},
    "slides 150 N s/m": {"slide_n_s_m": 150.0},
    "rod 2 %": {"rod_share": 0.02},
    "rod 4 %": {"rod_share": 0.04},
    "floating piston 0.1 MPa": {"floating_piston_pa": 0.1 * MPA},
    "breakaway twofold": {"breakaway": 2.0},
    "6 kg of gas leave": {"leaving_gas_kg": 6.0},
    "packings 1 % and vacuum": {"packing_share": 0.01, "back_pressure_pa": -0.1 * MPA},
    "the two and slides": {"packing_share": 0.01, "back_pressure_pa": -0.1 * MPA, "slide_n_s_m": 50.0},
    "friction by place 30 %": {"friction_by_place": 0.3},
    "friction by speed": {"friction_by_speed": 0.5, "friction_speed_m_s": 0.5},
    "rough force 0.5 %": {"rough_share": 0.005},
    "rough force 1 %": {"rough_share": 0.01},
    "slide that stiffens": {"stiffening_n": 1000.0},
    "bump": {"bump_n": 1500.0},
    "stick": {"stick_n": 1000.0},
    "swing": {"swing_n": 400.0},
}
"""Forces that no gauge reads, of the size that they really have; the last four have a shape that no column knows."""
CHANGING = frozenset({
    "breakaway twofold", "6 kg of gas leave", "friction by place 30 %", "friction by speed", "rough force 0.5 %",
    "rough force 1 %", "slide that stiffens", "bump", "stick", "swing",
})  # fmt: skip
"""Those by which mass or friction does change in the shot: to say so is right."""
BORE: Mapping[str, Mapping[str, float]] = {
    f"bore {100 * share:g} %": {"bore_drag": share} for share in (0.005, 0.01, 0.015)
}
"""Friction in the bore until the exit, in the place of the one that the rig takes."""
READINGS: Mapping[str, Mapping[str, float]] = {
    "recuperator behind 5 ms": {"recuperator_orifice_s": 0.005},
    "recuperator behind 10 ms": {"recuperator_orifice_s": 0.01},
    "rest half as loud": {"rest_noise": 0.5},
    "rest a quarter as loud": {"rest_noise": 0.25},
    "rest a twentieth as loud": {"rest_noise": 0.05},
    "motion 0.6 %": {"noise_of_acceleration": 0.006, "noise_of_reading": 0.006},
    "motion 1.2 %": {"noise_of_acceleration": 0.012, "noise_of_reading": 0.012},
    "motion 3 %": {"noise_of_acceleration": 0.03, "noise_of_reading": 0.03},
    "motion 8 times louder": {"structure_borne_m_s2": 40.0},
    "motion 34 times louder": {"structure_borne_m_s2": 170.0},
    "12 knocks": {"knocks": 12},
}
BREECH_CHAIN: Mapping[str, Mapping[str, float]] = {
    "linearity 0.5 %": {"breech_linearity": 0.005},
    "linearity 1 %": {"breech_linearity": 0.01},
    "linearity and hysteresis 1 %": {"breech_linearity": 0.01, "breech_hysteresis": 0.01},
    "gauge ahead 1 %": {"gauge_ahead": 0.01},
    "gauge ahead 2 %": {"gauge_ahead": 0.02},
    "bracket of 800 Hz": {"accelerometer_bracket_hz": 800.0},
    "tube of 900 Hz": {"tube_axial_hz": 900.0},
    "tube of 600 Hz": {"tube_axial_hz": 600.0},
}
"""Readings that the breech chain makes wrong, of which the rigs state nothing."""
MUZZLE: Mapping[str, Mapping[str, float]] = {"muzzle brake 10 %": {"muzzle_brake": 0.1}}
STATED: Mapping[str, tuple[str, str]] = {
    "linearity 1 %, stated": ("", "u_linearity_rel = 0.007"),
    "linearity and hysteresis 1 %, stated": ("", "u_linearity_rel = 0.007"),
    "gauge ahead 2 %, stated": (
        "", "gauge_ahead = { chamber_length_m = 0.5, projectile_mass_kg = 15.0, u_share = 0.015 }",
    ),
    "tube of 900 Hz, stated": ("tube_axial_hz = 900.0", ""),
    "tube of 600 Hz, stated": ("tube_axial_hz = 600.0", ""),
    "muzzle brake 10 %, stated": (
        "muzzle_brake = 0.1\nu_muzzle_brake = 0.02\nprojectile_mass = 15.0\nbore_length = 2.0", "",
    ),
}  # fmt: skip
"""Rows of which the rig states what the breech chain does: keys of the mechanism, and of the breech gauge's sensor."""
NOTHING, AS_DRAWN = "nothing unread", "as drawn"
BEYOND = 3.0
"""Standard uncertainties beyond which a valid mass is wrong."""
LEAST_COVERED, LEAST_OF_24 = 0.93, 20
MOST_CHANGING = 0.02
CHARGES = (1.0, 0.8, 0.65)
LEAST_OF_THE_WORST = 0.85
"""Share of the worst group's intervals that hold; what is not valid is nothing to trust, and says so."""


@dataclass(frozen=True)
class Outcome:
    """What became of one shot: its error over u, relative u and interval score, whether its interval holds the
    truth, the verdicts, and whether the breech chain speaks against it."""

    row: str
    rig: str
    charge: float
    z: float
    u_percent: float
    score_percent: float
    covered: bool
    valid: bool
    changing: bool
    chain: bool = False


def outcome(job: tuple[str, str, int]) -> Outcome:
    """Simulate, ingest and identify one shot of a row."""
    row, name, number = job
    effect = row.removesuffix(", stated")
    mechanism = (("bore_friction", 0.0), ("u_bore_friction", 0.0)) if row in BORE else ()
    charge = CHARGES[zlib.crc32(f"{number}, {row}, {name}".encode()) % len(CHARGES)]
    settings = {"unread_errors": row == AS_DRAWN, "peak_pressure_pa": 130.0 * MPA * charge}
    rig = with_twin(name, mechanism, 0.001, kind=False, **settings)
    unread, readings = {**FORCES, **BORE, **MUZZLE}.get(effect, {}), {**READINGS, **BREECH_CHAIN}.get(effect, {})
    tables = "".join(
        f"[twin.{table}]\n" + "".join(f"{key} = {value}\n" for key, value in values.items())
        for table, values in (("unread", unread), ("readings", readings))
    )
    seed = zlib.crc32(f"{row}, {name}".encode()) % 1_000_000 * 1000 + number
    bundled = knowing(load_rig(name), *STATED.get(row, ("", "")))
    with tempfile.TemporaryDirectory() as folder:
        simulated = simulate_shot(parse_rig(rig.text + tables, rig.path), Path(folder) / "files", seed=seed, shot="s")
        out = Path(folder) / "shots"
        shot = ingest_files(bundled, simulated.files, shot="s", out=out, on=dt.date(2026, 6, 1)).shot
    truth_kg = float(simulated.truth["m3"])
    try:
        found = identify_shot(FiredShot(shot, bundled), Options())
    except RecoilDaqError:  # no number at all is honest
        return Outcome(row, name, charge, math.nan, math.nan, math.nan, False, False, False)
    estimate, constancy = found.chosen.estimate, found.constancy
    low, high = estimate.interval_kg
    return Outcome(
        row,
        name,
        charge,
        (estimate.mass_kg - truth_kg) / estimate.u_kg,
        100 * estimate.u_kg / estimate.mass_kg,
        100 * interval_score(low, high, truth_kg) / truth_kg,
        low <= truth_kg <= high,
        found.valid,
        constancy is not None and not constancy.constant,
        any(one.code is ReasonCode.BREECH_CHAIN for one in found.reasons),
    )


def knowing(rig: Rig, mechanism: str, sensor: str) -> Rig:
    """Let a rig file state more of its mechanism, and of its breech gauge's sensor."""
    text = rig.text.replace("[mechanism]\n", f"[mechanism]\n{mechanism}\n")
    head, role, tail = text.partition('role = "breech_pressure"')
    return parse_rig(
        head + role + tail.replace("sensor = { ", f"sensor = {{ {sensor}, " if sensor else "sensor = { ", 1),
        rig.path,
        rig.databases,
    )


@cache
def outcomes(rows: tuple[str, ...], shots: int) -> list[Outcome]:
    jobs = [(row, name, number) for row in rows for name in RIGS for number in range(shots)]
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return list(pool.map(outcome, jobs, chunksize=4))


def table(rows: list[Outcome]) -> None:
    for row in dict.fromkeys(one.row for one in rows):
        of = [one for one in rows if one.row == row]
        z = np.array([one.z for one in of])
        print(
            f"{row:28} {sum(one.covered for one in of):3} of {len(of):3} hold the truth, "
            f"{sum(one.valid for one in of):3} valid, u {np.nanmean([one.u_percent for one in of]):.2f} %, "
            f"rms z {np.sqrt(np.nanmean(z**2)):.2f}, "
            f"{sum(one.valid and abs(one.z) > BEYOND for one in of)} beyond 3 u and valid, "
            f"{sum(one.changing for one in of)} called changing, {sum(one.chain for one in of)} by the breech chain"
        )


def judge(rows: list[Outcome]) -> None:
    """Judge by the worst group of rig, charge, effect and size of u, and print it."""
    table(rows)
    groups: dict[str, list[object]] = {
        "rig": [one.rig for one in rows],
        "charge": [one.charge for one in rows],
        "effect": [one.row for one in rows],
        "": [*halves([one.u_percent for one in rows])],
    }
    share, group = worst_group([one.covered or not one.valid for one in rows], groups)
    score = np.nanmean([one.score_percent for one in rows])
    print(f"worst group: {100 * share:.0f} % ({group}); mean interval score {score:.2f} % of the mass")
    assert share >= LEAST_OF_THE_WORST


@pytest.mark.benchmark(group="unkind")
def test_the_interval_holds_where_no_gauge_reads_and_where_the_motion_is_loud(benchmark) -> None:
    rows = (*FORCES, *BORE, *READINGS)
    found = benchmark.pedantic(outcomes, args=(rows, SHOTS), rounds=1)
    judge(found)
    assert sum(one.covered for one in found) >= binom.ppf(0.025, len(found), 0.95)
    wrong = sum(one.valid and abs(one.z) > BEYOND for one in found)
    assert wrong <= binom.ppf(0.975, len(found), math.erfc(BEYOND / math.sqrt(2.0)))
    assert np.mean([one.changing for one in found if one.row not in CHANGING]) <= MOST_CHANGING
    for row in rows:
        # what is not valid is nothing to trust, and says so
        of = [one.covered or not one.valid for one in found if one.row == row]
        # three times what the prior of the share expects: no shot alone can tell it
        assert row == "packings 3 %" or sum(of) >= math.floor(LEAST_OF_24 / 24 * len(of)), row


@pytest.mark.benchmark(group="unkind")
def test_the_breech_chain_is_held_or_named_and_no_mass_that_changes_is(benchmark) -> None:
    found = benchmark.pedantic(outcomes, args=((*BREECH_CHAIN, *MUZZLE, *STATED), SHOTS), rounds=1)
    judge(found)
    assert not any(one.changing for one in found)
    held = sum(one.covered or (not one.valid and one.chain) for one in found)
    assert held >= binom.ppf(0.025, len(found), 0.95)
    stated = [one for one in found if one.row in STATED]
    assert np.mean([one.covered and one.valid for one in stated]) >= 0.85


@pytest.mark.benchmark(group="unkind")
def test_a_sound_shot_states_what_it_knows(benchmark) -> None:
    found = benchmark.pedantic(outcomes, args=((NOTHING,), SHOTS), rounds=1)
    judge(found)
    assert np.mean([one.covered for one in found]) >= min(LEAST_COVERED, 1.0 - 1.0 / len(found))
    assert np.mean([one.u_percent for one in found]) <= 0.75


@pytest.mark.benchmark(group="unkind")
def test_the_range_as_it_is_drawn_is_covered(benchmark) -> None:
    found = benchmark.pedantic(outcomes, args=((AS_DRAWN,), 10 * SHOTS), rounds=1)
    judge(found)
    interval = binomtest(sum(one.covered for one in found), len(found)).proportion_ci(0.95, "exact")
    assert interval.low <= 0.95 <= interval.high
    assert SHOTS < 10 or 0.85 <= math.sqrt(np.nanmean([one.z**2 for one in found])) <= 1.1
