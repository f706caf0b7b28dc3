"""The noise of the rows while the part moves: found with the mass, without excusing a gauge that is off."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.methods import calibrated_mass, calibrated_with_zero_shift
from recoil_identification.estimate.mass import GAUGES
from recoil_identification.rows.row_noise import RowNoise, row_noise
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.filters import LowPass
from recoil_processing.shot.clocks.estimator_inputs import BaselineNoise
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import MASS_KG, bench_motion, bench_regression, bench_rig, bench_shot

SCALES = ScaleUncertainty(0.005, (0.005, 0.004, 0.004), 150.0)
LOW_PASS = LowPass(120.0)
SIGMA_M_S2 = 20.0
"""Of the accelerometer, per sample, at rest."""
REST = BaselineNoise(slow_acceleration=SIGMA_M_S2, slow_force=0.0)


@cache
def exact() -> Regression:
    """As recorded, with Newton's law in every sample."""
    recorded = bench_regression()
    return replace(recorded, acceleration_m_s2=recorded.force_n / MASS_KG)


def correlated(seed: int, time_s: float) -> np.ndarray:
    """Draw noise of variance one, correlated over a time."""
    white = np.random.default_rng(seed).standard_normal(exact().times_s.size)
    kept, noise = math.exp(-exact().step_s / time_s), np.zeros(white.size)
    for at in range(1, white.size):
        noise[at] = kept * noise[at - 1] + math.sqrt(1.0 - kept**2) * white[at]
    return noise


def found(seed: int, added: np.ndarray | float = 0.0, baseline: BaselineNoise = REST, **scaled: float) -> Calibration:
    """Estimate the mass of the bench shot with the noise of the rest and more of it while the part moves."""
    r = exact()
    noise = SIGMA_M_S2 * np.random.default_rng(seed).standard_normal(r.times_s.size) + added * r.inside
    forces = r.forces_n.copy()
    for column, factor in enumerate((scaled.get("breech", 1.0), scaled.get("brake", 1.0))):
        forces[:, column] *= factor
    recorded = replace(r, acceleration_m_s2=r.acceleration_m_s2 + noise, forces_n=forces)
    return calibrated_with_zero_shift(recorded, recorded.filtered(LOW_PASS), SCALES, 0.2, baseline)[2]


def deviation_m_s2(noise: RowNoise, at: np.ndarray) -> float:
    return float(np.sqrt(np.mean(noise.sigma_m_s2[at] ** 2)))


def behind_filter(sigma_m_s2: np.ndarray) -> np.ndarray:
    """Return the standard deviation that white noise, of one at each sample, has behind the filter."""
    impulse = np.zeros(sigma_m_s2.size)
    impulse[impulse.size // 2] = 1.0
    weights = LOW_PASS.apply(impulse, exact().rate_hz) ** 2
    return np.sqrt(np.maximum(np.convolve(sigma_m_s2**2, weights, mode="same"), 0.0))


def test_a_rest_that_is_as_loud_as_the_motion_gives_the_weights_of_the_rest() -> None:
    loud_rest = replace(REST, slow_acceleration=1.4 * SIGMA_M_S2)
    calibration = found(3, baseline=loud_rest)
    noise = calibration.noise
    assert noise.sizes_m_s2.tolist() == [0.0] * 5
    assert noise.unexplained_share == 0.0
    np.testing.assert_array_equal(noise.sigma_m_s2, noise.rest_m_s2)
    regression = calibration.block.regression
    rest = row_noise(regression, calibration.m0_kg, loud_rest)
    plain = calibrated_mass(regression, SCALES, 0.2, noise=rest).estimate
    assert calibration.estimate.mass_kg == pytest.approx(plain.mass_kg, rel=1e-12)
    assert calibration.estimate.u_kg == pytest.approx(plain.u_kg, rel=1e-12)


@pytest.mark.whole_way
def test_noise_that_is_the_rests_is_not_found_to_be_coloured() -> None:
    each = [found(seed).noise for seed in range(12)]
    assert np.median([one.unexplained_share for one in each]) == 0.0
    assert max(one.unexplained_share for one in each) < 0.01
    everywhere = exact().inside
    ratios = [deviation_m_s2(one, everywhere) / float(np.median(one.rest_m_s2)) for one in each]
    assert np.median(ratios) < 1.5


@pytest.mark.whole_way
@pytest.mark.parametrize("kind", ["white", "with the velocity", "with the acceleration"])
def test_white_noise_in_the_motion_is_found_behind_the_filter(kind: str) -> None:
    r = exact()
    velocity = np.cumsum(r.inside * r.acceleration_m_s2) * r.step_s
    of_kind = {
        "white": np.full(r.times_s.size, 80.0),
        "with the velocity": 100.0 * np.abs(velocity) / np.abs(velocity).max(),
        "with the acceleration": 200.0 * np.abs(r.acceleration_m_s2) / np.abs(r.acceleration_m_s2).max(),
    }
    added = of_kind[kind]
    sigma = behind_filter(np.hypot(SIGMA_M_S2, added * r.inside))
    is_loud = r.inside & (sigma > 0.6 * sigma[r.inside].max())
    true = float(np.sqrt(np.mean(sigma[is_loud] ** 2)))
    each = []
    for seed in range(12):
        white = np.random.default_rng(1000 + seed).standard_normal(r.times_s.size)
        each.append(found(seed, added * white))
    loudly = np.median([deviation_m_s2(one.noise, is_loud) for one in each])
    if kind == "with the acceleration":  # that is large in three rows, of which gauges take much for their own
        assert 4.0 * behind_filter(np.full(r.times_s.size, SIGMA_M_S2))[r.inside].mean() < loudly < true
    else:
        assert loudly == pytest.approx(true, rel=0.25)
    z = [(one.estimate.mass_kg - MASS_KG) / one.estimate.u_kg for one in each]
    assert np.abs(z).max() < 3.0


@pytest.mark.whole_way
def test_white_noise_is_never_found_smaller_than_the_upper_half_of_the_band_tells() -> None:
    r = exact()
    for seed in range(6):
        white = 80.0 * np.random.default_rng(2000 + seed).standard_normal(r.times_s.size)
        noise = found(seed, white).noise
        assert noise.parts is not None
        assert noise.sizes_m_s2[0] >= noise.parts.least_m_s2 > 0.0


@pytest.mark.whole_way
def test_slow_noise_in_the_motion_is_found_to_be_slow_and_is_in_the_uncertainty() -> None:
    quiet = [found(seed) for seed in range(8)]
    travel_s = exact().interval_s[1] - exact().interval_s[0]
    for share in (0.03, 0.1):
        loud = [found(seed, 8.0 * correlated(500 + seed, share * travel_s)) for seed in range(8)]
        # of this some is kept back by the filter, and some is what the unknowns take for their own
        sizes = [float(np.linalg.norm(one.noise.sizes_m_s2[3:])) for one in loud]
        assert 4.0 < np.median(sizes) < 10.0
        rms = [float(np.sqrt(np.mean(one.block.regression.acceleration_m_s2[one.block.rows] ** 2))) for one in loud]
        shares = [one.noise.unexplained_share for one in loud]
        np.testing.assert_allclose(shares, np.array(sizes) / rms, rtol=1e-9)
        assert np.median([one.estimate.u_kg for one in loud]) > 1.05 * np.median([one.estimate.u_kg for one in quiet])
        assert max(abs(one.estimate.mass_kg - MASS_KG) / one.estimate.u_kg for one in loud) < 3.0


@pytest.mark.whole_way
@pytest.mark.parametrize("off", [{"breech": 1.05}, {"breech": 0.95}, {"brake": 1.09}, {"brake": 0.93}])
def test_a_gauge_that_is_off_is_not_taken_for_noise(off: dict[str, float]) -> None:
    for seed in range(4):
        sound, wrong = found(seed), found(seed, **off)
        everywhere = exact().inside
        assert deviation_m_s2(wrong.noise, everywhere) < 1.25 * deviation_m_s2(sound.noise, everywhere)
        assert wrong.noise.unexplained_share < 0.01
        assert max(abs(wrong.normalised_residuals[gauge]) for gauge in GAUGES[:2]) > 3.29


# ------------------------------------------------------------------------------------------ a rest that is quieter


@cache
def fired(seed: int, rest: float) -> Identification:
    """Fire the bench with noise in all channels, which is less before the shot."""
    motion, rng = bench_motion(), np.random.default_rng(seed)
    loudness = np.where(np.arange(motion.times_s.size) < motion.release - 20, rest, 1.0)
    recorded = {
        "acc": (motion.acceleration_m_s2, SIGMA_M_S2),
        "p_breech": (motion.breech_pa, 2e5),
        "p_brake": (motion.brake_pa, 2e4),
        "p_recuperator": (motion.recuperator_pa, 5e3),
    }
    noisy = {name: true + sigma * loudness * rng.standard_normal(true.size) for name, (true, sigma) in recorded.items()}
    return identify_shot(FiredShot(bench_shot(motion, **noisy), bench_rig()), Options())


@pytest.mark.whole_way
@pytest.mark.parametrize("rest", [0.5, 0.25, 0.05])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_rest_that_is_quieter_than_the_motion_hardly_moves_the_mass_and_voids_nothing(seed: int, rest: float) -> None:
    sound, quiet = fired(seed, 1.0), fired(seed, rest)
    estimate = sound.chosen.estimate
    assert abs(quiet.chosen.estimate.mass_kg - estimate.mass_kg) < 0.5 * estimate.u_kg
    assert quiet.chosen.estimate.u_kg == pytest.approx(estimate.u_kg, rel=0.1)
    assert quiet.valid, quiet.reasons
    assert quiet.constancy is not None
    assert quiet.constancy.constant
    # what the rest lacks is found in the motion
    noise = quiet.route.calibration.noise
    rows = quiet.route.calibration.block.rows
    assert noise.rest_m_s2.min() < 1.1 * rest * sound.route.calibration.noise.rest_m_s2.min()
    assert np.median(noise.sigma_m_s2[rows]) > 0.6 * np.median(sound.route.calibration.noise.sigma_m_s2[rows])


def test_a_mass_that_drifts_leaves_no_coloured_noise() -> None:
    r = exact()
    progress = np.clip((r.times_s - r.interval_s[0]) / (r.interval_s[1] - r.interval_s[0]), 0.0, 1.0)
    shares = [found(seed, 0.1 * progress * r.acceleration_m_s2).noise.unexplained_share for seed in range(6)]
    # a tenth of the force's fast part, which the column of a drift does not have
    assert np.median(shares) < 0.002
    assert max(shares) < 0.01
