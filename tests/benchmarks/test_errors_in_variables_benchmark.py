"""Every estimator of the mass on one recoil with noise of both sides, against the bound that no estimator beats.

The bound is Cramer and Rao's for the noise as it was drawn, ringing as a normal process of known shapes: what
accelerometer or camera tell of the mass beside the unknowns that an estimator has.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping

import numpy as np
import pytest

from recoil_identification.estimators.endogeneity import durbin_wu_hausman
from recoil_identification.estimators.errors_in_variables import (
    deming_mass,
    instrumental_mass,
    neighbouring_force,
)
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.shot.clocks.double_impulse import DoubleImpulseMass, double_impulse_mass
from tests.builders.recoil_scenario import (
    ACCELERATION_NOISE,
    AMPLITUDE_SPREAD,
    BRAKE_N,
    BREECH_N,
    FORCE_NOISE,
    MARKER_SIGMA_M,
    MASS_KG,
    RATE_HZ,
    RecordedRecoil,
    record_recoil,
    ringing_shapes,
    true_recoil,
)

SHOTS = int(os.environ.get("EIV_SHOTS", "400"))
QUIET = slice(0, 3900)
"""Samples of the silence."""
Estimate = tuple[float, float]


class Shot:
    """One recorded shot, and what every estimator asks of it."""

    def __init__(self, recorded: RecordedRecoil) -> None:
        true = true_recoil()
        self.t, self.frames_s, self.end_s = true.times_s, true.frame_times_s, true.end_s
        self.a, self.x = recorded.acceleration_m_s2, recorded.displacement_m
        self.f = np.where(self.t >= 0, recorded.force_n, 0.0)
        self.moving = self.t >= 0
        self.sigma_a = float(self.a[QUIET].std())
        self.sigma_f = float(recorded.force_n[QUIET].std())
        self.sigma_both = math.hypot(self.sigma_a, self.sigma_f / MASS_KG)

    def double_impulse(self) -> DoubleImpulseMass:
        return double_impulse_mass(
            self.frames_s, self.x, float(self.t[0]), 1 / RATE_HZ, self.f,
            release_s=0.0, end_s=self.end_s, rough_mass_kg=780.0, force_sigma_n=self.sigma_f,
        )  # fmt: skip


def estimators(shot: Shot) -> dict[str, Callable[[], Estimate]]:
    a, f, both = shot.a[shot.moving], shot.f[shot.moving], {"baseline_sigma_m_s2": shot.sigma_both}

    def stated(found) -> Estimate:
        return found.mass_kg, found.u_kg

    return {
        "forward (the paper's)": lambda: stated(deming_mass(a, f, math.inf, **both)),
        "reverse": lambda: stated(deming_mass(a, f, 0.0, **both)),
        "deming": lambda: stated(deming_mass(a, f, shot.sigma_f / shot.sigma_a, **both)),
        "instrument: force +-5": lambda: stated(instrumental_mass(a, f, neighbouring_force(f, 5))),
        "double impulse": lambda: stated(shot.double_impulse()),
    }  # fmt: skip


def table(shots: range, chosen: tuple[str, ...] | None = None, **errors: float) -> Mapping[str, tuple[float, ...]]:
    """Return bias, sd, RPE, mean stated u, and coverage of the 95 % interval, all in percent, by estimator."""
    found: dict[str, list[Estimate]] = {}
    for seed in shots:
        for name, estimate in estimators(Shot(record_recoil(seed, **errors))).items():
            if chosen is None or name in chosen:
                found.setdefault(name, []).append(estimate())
    rows = {}
    for name, pairs in found.items():
        mass, u = np.array(pairs).T
        error = 100 * (mass / MASS_KG - 1)
        covered = 100 * float(np.mean(np.abs(mass - MASS_KG) < 1.96 * u))
        rows[name] = (
            float(error.mean()),
            float(error.std(ddof=1)),
            float(np.abs(error).mean()),
            float(100 * u.mean() / MASS_KG),
            covered,
        )
    return rows


def bounds() -> dict[str, float]:
    """Cramer-Rao bound of the mass in percent: accelerometer with zero and skew unknown, and camera."""
    true = true_recoil()
    moving = true.moving
    t, force = true.times_s[moving], true.forces_n[moving].sum(axis=1)
    var_f = (FORCE_NOISE / MASS_KG) ** 2 * (BREECH_N**2 + BRAKE_N**2)
    var_a = (ACCELERATION_NOISE * true.peak_m_s2) ** 2
    # the mean square of an amplitude of 1 +- spread, uniform, and of a phase that is anything
    ringing = ringing_shapes(t) * math.sqrt(0.5 * (1 + AMPLITUDE_SPREAD**2 / 3))
    covariance = (var_a + var_f) * np.eye(t.size) + ringing @ ringing.T
    slope = np.gradient(force, 1 / RATE_HZ) / MASS_KG
    columns = np.column_stack([force, np.ones_like(t), slope])
    told = columns.T @ np.linalg.solve(covariance, columns)

    frames = true.frame_times_s[true.frame_times_s >= 0]
    travel = DoubleIntegral.of(true.forces_n.sum(axis=1), float(true.times_s[0]), 1 / RATE_HZ).at(frames)[0]
    design = np.column_stack([travel, np.ones_like(frames)])
    low, high = np.minimum.outer(frames, frames), np.maximum.outer(frames, frames)
    noise = var_f / RATE_HZ * low**2 * (3 * high - low) / 6 + MARKER_SIGMA_M**2 * np.eye(frames.size)
    seen = design.T @ np.linalg.solve(noise, design)
    seen[1, 1] += np.count_nonzero(true.frame_times_s < 0) / MARKER_SIGMA_M**2
    return {
        "accelerometer": 100 * MASS_KG / math.sqrt(told[0, 0]),
        "camera": 100 * MASS_KG * math.sqrt(np.linalg.inv(seen)[0, 0]),
    }


def test_the_estimators_against_the_bound(benchmark, capsys):
    rows = benchmark.pedantic(table, (range(SHOTS),), rounds=1)
    bound = bounds()
    of = {"double impulse": "camera"}
    with capsys.disabled():
        print(f"\n{SHOTS} shots, percent; Cramer-Rao bounds: {', '.join(f'{k} {v:.3f}' for k, v in bound.items())}")
        print(f"{'estimator':24}{'bias':>8}{'sd':>8}{'RPE':>8}{'mean u':>8}{'coverage':>10}{'sd/bound':>10}")
        for name, (bias, sd, rpe, u, covered) in rows.items():
            ratio = sd / bound[of.get(name, "accelerometer")]
            print(f"{name:24}{bias:+8.3f}{sd:8.3f}{rpe:8.3f}{u:8.3f}{covered:10.1f}{ratio:10.2f}")
    assert rows["forward (the paper's)"][0] == pytest.approx(-4.9, abs=0.2)
    for name in ("reverse", "instrument: force +-5"):
        bias, sd, rpe, _, covered = rows[name]
        assert abs(bias) <= 0.1, name
        assert rpe <= 0.35, name
        assert sd <= 1.2 * bound["accelerometer"], name
        # the instrument serves the test of bias below, and no command states its interval
        assert 93.0 <= covered <= 97.0 or name.startswith("instrument"), name
    bias, sd, rpe, _, covered = rows["double impulse"]
    assert abs(bias) <= 0.02
    assert rpe <= 0.10
    assert sd <= 1.2 * bound["camera"]
    assert 93.0 <= covered <= 97.0


PERTURBATIONS: Mapping[str, Mapping[str, float]] = {
    "zero shift of 1 %": {"zero_shift": 0.01},
    "force late by a sample": {"force_late_samples": 1},
    "breech gain +1 %": {"breech_gain": 1.01},
    "brake gain +1 %": {"brake_gain": 1.01},
    "accelerometer gain +1 %": {"acceleration_gain": 1.01},
    "camera scale +1 %": {"camera_scale": 1.01},
}


def test_the_estimators_with_errors_of_the_sensors(benchmark, capsys):
    chosen = ("reverse", "double impulse")
    shots = range(max(SHOTS // 8, 10))
    rows = benchmark.pedantic(
        lambda: {name: table(shots, chosen, **errors) for name, errors in PERTURBATIONS.items()}, rounds=1
    )
    with capsys.disabled():
        print(f"\nbias in percent (RPE), {len(shots)} shots")
        print(f"{'':26}" + "".join(f"{name:>18}" for name in chosen))
        for error, by_name in rows.items():
            print(f"{error:26}" + "".join(f"{by_name[n][0]:+10.3f} ({by_name[n][2]:.3f})" for n in chosen))
    for error in ("zero shift of 1 %", "accelerometer gain +1 %"):
        assert abs(rows[error]["double impulse"][0]) < 0.05, error
    assert rows["camera scale +1 %"]["double impulse"][0] == pytest.approx(-1.0, abs=0.1)
    assert rows["accelerometer gain +1 %"]["reverse"][0] == pytest.approx(-1.0, abs=0.2)


def test_the_test_of_endogeneity_tells_the_biased_case(benchmark, capsys):
    def verdicts() -> tuple[float, float]:
        true, biased, alarms = true_recoil(), 0, 0
        a_true = true.acceleration_m_s2[true.moving]
        for seed in range(SHOTS):
            shot = Shot(record_recoil(seed))
            a, f = shot.a[shot.moving], shot.f[shot.moving]
            biased += durbin_wu_hausman(a, f, neighbouring_force(f, 5)).biased
            noisy = MASS_KG * a_true + np.random.default_rng(seed).normal(0.0, 2e4, a_true.size)
            alarms += durbin_wu_hausman(a_true, noisy, neighbouring_force(noisy, 5)).biased
        return biased / SHOTS, alarms / SHOTS

    power, alarms = benchmark.pedantic(verdicts, rounds=1)
    with capsys.disabled():
        print(
            f"\nDurbin-Wu-Hausman at 5 %: {100 * power:.1f} % with a noisy accelerometer, {100 * alarms:.1f} % without"
        )
    assert power == 1.0
    assert alarms < 0.12
