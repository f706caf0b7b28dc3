"""The mass over time beside the sensors' errors, and the test of its constancy."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_identification.calibration import Calibration, calibrated_mass
from recoil_identification.equation_of_motion import MASS, change, ramps
from recoil_identification.mass_over_time import mass_constancy, mass_over_time
from recoil_identification.row_noise import RowNoise
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from tests.builders.bench_shots import MASS_KG, bench_regression

SCALES = ScaleUncertainty(0.005, (0.006, 0.004, 0.004), 150.0)
NO_DOUBT = ScaleUncertainty(0.0, (0.0, 0.0, 0.0), 0.0)
SIGMA_M_S2 = 2.0


@cache
def recorded() -> Regression:
    return replace(bench_regression(), release_n_s=0.0)


def shot(
    seed: int, share: np.ndarray | float = 1.0, gauges: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> Regression:
    """Let a mass that is a share of the whole over time move as Newton's law has it; noise is white on the rows."""
    r = recorded()
    truth = replace(r, acceleration_m_s2=r.force_n / (MASS_KG * share)).filtered(LowPass(300.0))
    a, rows = truth.acceleration_m_s2.copy(), spaced_rows(truth)
    a[rows] += np.random.default_rng(seed).normal(0.0, SIGMA_M_S2, rows.size)
    forces = truth.forces_n.copy()
    forces[:, :3] *= gauges
    return replace(truth, acceleration_m_s2=a, forces_n=forces)


def calibrated(regression: Regression, scales: ScaleUncertainty = SCALES) -> Calibration:
    noise = RowNoise(np.full(regression.times_s.size, SIGMA_M_S2), 1.0, math.inf)
    return calibrated_mass(regression, scales, 0.2, noise=noise)


def stepping(at_s: float, by: float) -> np.ndarray:
    r = recorded()
    return np.where(r.times_s >= r.interval_s[0] + at_s, 1.0 + by, 1.0)


def drifting(by: float) -> np.ndarray:
    r = recorded()
    return 1.0 + by * ramps(r.times_s, r.interval_s, 1)[:, 0]


def test_a_constant_mass_is_called_changing_as_often_as_the_level_says():
    rng = np.random.default_rng(20130901)
    found = [
        mass_constancy(calibrated(shot(seed, gauges=tuple(1.0 + rng.normal(0.0, SCALES.gauges)))))
        for seed in range(120)
    ]
    called = [0.0 if one is None else one.p_value < 0.05 for one in found]
    assert None not in found
    assert np.mean(called) <= 0.1
    # and what the drift is measured by is standard normal
    z = [one.normalised_drift for one in found if one is not None]
    assert np.std(z) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("seed", range(3))
def test_a_step_is_found_with_its_size_its_instant_and_both_masses(seed):
    one = mass_constancy(calibrated(shot(seed, stepping(0.06, -0.04))))
    assert one is not None
    assert one.kind == "step"
    assert one.p_value < 1e-3
    assert one.instant_s - one.onset_s == pytest.approx(0.06, abs=0.003)
    assert one.interval_s[0] <= one.instant_s <= one.interval_s[1]
    assert one.change_kg == pytest.approx(-0.04 * MASS_KG, abs=4 * one.u_change_kg)
    assert one.before_kg == pytest.approx(MASS_KG, abs=4 * one.u_before_kg)
    assert one.after_kg == pytest.approx(0.96 * MASS_KG, abs=4 * one.u_after_kg)
    # their common error does not touch the change
    assert one.u_change_kg < math.hypot(one.u_before_kg, one.u_after_kg)
    assert f"{one.change_kg:+.1f} kg" in str(one)


def test_a_drift_is_called_a_drift():
    one = mass_constancy(calibrated(shot(1, drifting(-0.05))))
    assert one is not None
    assert (one.kind, one.constant()) == ("drift", False)
    assert one.change_kg == pytest.approx(-0.05 * MASS_KG, abs=4 * one.u_change_kg)
    assert "over the travel" in str(one)


def test_what_a_departure_is_measured_by_is_its_size_in_a_new_fit_over_its_uncertainty():
    """A score is a new fit's size over its uncertainty, as long as the size is small."""
    calibration = calibrated(shot(2, drifting(-0.01)))
    one = mass_constancy(calibration)
    r = calibration.block.regression
    anew = calibration.with_changes(ramps(r.times_s, r.interval_s, 1)).inferred
    size = change(0).name
    assert one is not None
    assert one.normalised_drift == pytest.approx(anew.value(size) / anew.u(size), abs=0.05)


def test_a_gauge_that_may_be_off_explains_what_else_would_be_a_change():
    regression = shot(3, gauges=(1.01, 1.0, 1.0))
    sure, unsure = (mass_constancy(calibrated(regression, scales)) for scales in (NO_DOUBT, SCALES))
    assert sure is not None
    assert unsure is not None
    assert not sure.constant()
    assert unsure.constant()


def test_the_walk_holds_masses_that_drift_and_step():
    r = recorded()
    for share in (drifting(-0.03), stepping(0.05, -0.01), 1.0):
        found = mass_over_time(calibrated(shot(4, share)))
        true = np.broadcast_to(MASS_KG * share, r.times_s.shape)[r.inside]
        assert np.mean(np.abs(found.mass_kg - true) <= 2 * found.u_kg) > 0.9
        assert found.times_s.shape == found.mass_kg.shape == found.u_kg.shape


def test_the_walk_is_least_certain_at_its_end():
    found = mass_over_time(calibrated(shot(5)))
    assert found.u_kg[-1] > 1.5 * found.u_kg.min()


def test_a_walk_that_may_not_move_is_the_constant_mass():
    calibration = calibrated(shot(6))
    r = calibration.block.regression
    held = calibration.with_changes(ramps(r.times_s, r.interval_s, 4), 1e-9)
    assert held.inferred.value(MASS.name) == pytest.approx(calibration.inferred.value(MASS.name), abs=1e-9)
    assert held.inferred.u(MASS.name) == pytest.approx(calibration.inferred.u(MASS.name), rel=1e-6)


def test_too_few_rows_tell_nothing():
    regression = shot(7)
    few = spaced_rows(regression)[:10]
    trusted = np.zeros(regression.times_s.size, dtype=bool)
    trusted[few] = True
    unknown_zero = calibrated_mass(
        replace(regression, trusted=trusted), ScaleUncertainty(0.5, (0.5, 0.5, 0.5), 1e4), math.inf
    )
    assert mass_constancy(replace(unknown_zero, common=(), own=())) is None
