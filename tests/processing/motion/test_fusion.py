from dataclasses import replace

import numpy as np
import pytest

from recoil_processing.gaps import bridge
from recoil_processing.motion.fusion import FusedMotion, fuse
from tests.builders.sharp_recoil import ONSET_S, Recorded, motion, record_recoil

SIGMA, ACCELERATION_SIGMA = 5e-5, 5.0
ROWS = ((2000.0, 5e-5, 5.0), (1000.0, 2e-4, 20.0), (500.0, 5e-4, 20.0))
"""Frame rate in Hz, noise of the marker in m and of the accelerometer in m/s^2."""


def fused(
    recorded: Recorded, sigma=SIGMA, acceleration_sigma=ACCELERATION_SIGMA, shift_s=0.0, **options
) -> FusedMotion:
    result = fuse(
        recorded.frame_times_s + shift_s,
        recorded.displacement_m,
        0.0,
        recorded.step_s,
        recorded.acceleration_m_s2,
        marker_sigma_m=sigma,
        acceleration_density=acceleration_sigma**2 * recorded.step_s,
        **options,
    )
    assert isinstance(result, FusedMotion)
    return result


def record(seed: int, row: tuple[float, float, float] = ROWS[0], **options) -> Recorded:
    rate, sigma, acceleration_sigma = row
    return record_recoil(
        seed, frame_rate_hz=rate, marker_sigma_m=sigma, acceleration_sigma_m_s2=acceleration_sigma, **options
    )


def in_motion(result: FusedMotion) -> np.ndarray:
    return (result.times_s > ONSET_S) & (result.times_s < ONSET_S + 0.3)


def standardised(result: FusedMotion) -> tuple[np.ndarray, np.ndarray]:
    """Errors over standard uncertainties of travel and velocity, in the motion."""
    x, v, _ = motion(result.times_s)
    at = in_motion(result)
    return (
        ((result.position_m - x) / result.u_position_m)[at],
        ((result.velocity_m_s - v) / result.u_velocity_m_s)[at],
    )


@pytest.mark.exhaustive
@pytest.mark.parametrize("row", ROWS)
def test_stated_uncertainties_are_those_of_the_errors(row):
    found = [standardised(fused(record(seed, row), *row[1:])) for seed in range(24)]
    for z in zip(*found, strict=True):
        assert 0.85 < np.sqrt(np.mean(np.square(z))) < 1.15
        assert 0.92 < np.mean(np.abs(z) < 1.96) < 0.98


def test_gain_and_zero_are_found_within_their_uncertainty():
    results = [fused(record(seed)) for seed in range(12)]
    gains = [(r.gain - 1.01) / r.u_gain for r in results]
    zeros = [(r.bias_m_s2 + 1.01 * 2.0) / r.u_bias_m_s2 for r in results]
    assert 0.5 < np.sqrt(np.mean(np.square(gains))) < 1.6
    assert 0.5 < np.sqrt(np.mean(np.square(zeros))) < 1.6
    assert results[0].u_gain < 1e-3
    assert np.mean([r.innovation_statistic for r in results]) == pytest.approx(1.0, abs=0.03)


def test_the_result_at_the_frames_and_the_residual_add_up_to_the_camera():
    recorded = record(1)
    result = fused(recorded)
    inside = recorded.frame_times_s <= 0.6
    seen = recorded.displacement_m[inside]
    between = np.interp(recorded.frame_times_s[inside], result.times_s, result.position_m)
    assert np.abs(seen - result.residual_m - between).max() < 2e-6
    assert result.rms_residual_m == pytest.approx(SIGMA, rel=0.05)


def test_the_velocity_is_the_derivative_of_the_travel():
    result = fused(record(2))
    slope = np.diff(result.position_m) / np.diff(result.times_s)
    assert np.abs(slope - 0.5 * (result.velocity_m_s[1:] + result.velocity_m_s[:-1])).max() < 2e-3


def test_an_exact_record_is_reproduced():
    recorded = record(3, (2000.0, 0.0, 0.0))
    result = fused(recorded)
    x, v, _ = motion(result.times_s)
    assert np.abs(result.position_m - x).max() < 5e-6
    assert result.frames_set_aside == 0
    assert np.abs(result.velocity_m_s - v).max() < 1e-3
    assert result.gain == pytest.approx(1.01, rel=1e-4)


# ---- clocks


def test_a_clock_error_shows_in_the_innovations_and_by_itself():
    right, wrong = fused(record(4)), fused(record(4), shift_s=50e-6)
    assert wrong.innovation_statistic > right.innovation_statistic + 0.05
    assert wrong.shift_s == pytest.approx(-50e-6, abs=4 * wrong.u_shift_s)
    assert right.shift_statistic(0.0) < 3.5
    assert wrong.shift_statistic(2e-6) > 8
    assert wrong.shift_statistic(50e-6) < 1.5
    assert np.sqrt(np.mean(np.square(standardised(wrong)[0]))) > 3


@pytest.mark.exhaustive
@pytest.mark.parametrize("row", ROWS[:2])
def test_told_of_the_clocks_uncertainty_the_intervals_cover(row):
    shifts = 50e-6 * np.random.default_rng(8).standard_normal(30)
    z = [standardised(fused(record(seed, row), *row[1:], shift_s=s, u_offset_s=50e-6)) for seed, s in enumerate(shifts)]
    x, v = (np.concatenate(part) for part in zip(*z, strict=True))
    assert 0.8 < np.sqrt(np.mean(x**2)) < 1.2
    assert 0.8 < np.sqrt(np.mean(v**2)) < 1.2
    assert np.mean(np.abs(x) < 1.96) > 0.92


def test_the_clocks_share_of_the_uncertainty_is_the_results_own_sensitivity():
    recorded = record(5)
    plain = fused(recorded)
    for changes, options in (
        (recorded.frame_times_s + 10e-6, {"u_offset_s": 10e-6}),
        (None, {"u_drift": 1e-4}),
    ):
        frames = changes
        if frames is None:
            t = recorded.frame_times_s
            weight = motion(t)[1] ** 2
            frames = t + 1e-4 * (t - np.average(t, weights=weight))
        moved = fused(replace(recorded, frame_times_s=frames))
        told = fused(recorded, **options)
        for name in ("position_m", "velocity_m_s"):
            share = np.sqrt(np.maximum(getattr(told, f"u_{name}") ** 2 - getattr(plain, f"u_{name}") ** 2, 0.0))
            change = np.abs(getattr(moved, name) - getattr(plain, name))
            at = in_motion(plain)
            assert np.abs(share - change)[at].max() < 0.05 * share[at].max()


def test_an_offset_makes_the_travel_uncertain_by_the_velocity_and_the_velocity_by_less():
    recorded = record(5)
    told = fused(recorded, u_offset_s=50e-6)
    fast = (told.times_s > 0.12) & (told.times_s < 0.2)
    _, v, a = motion(told.times_s)
    assert np.allclose(told.u_position_m[fast], 50e-6 * v[fast], rtol=0.1, atol=1.5e-5)
    assert told.u_velocity_m_s.max() < 0.3 * 50e-6 * a.max()


# ---- what was lost


def test_lost_frames_are_left_out_and_not_filled():
    recorded = record(6)
    lost = np.zeros(recorded.frame_times_s.size, dtype=bool)
    lost[[0, 205, 206, 207, 208, 400]] = True
    gone = fused(replace(recorded, displacement_m=np.where(lost, np.nan, recorded.displacement_m)))
    kept = fused(
        replace(recorded, frame_times_s=recorded.frame_times_s[~lost], displacement_m=recorded.displacement_m[~lost])
    )
    assert np.array_equal(gone.position_m, kept.position_m)
    assert np.array_equal(gone.u_position_m, kept.u_position_m)
    middle = np.argmin(np.abs(gone.times_s - recorded.frame_times_s[206]))
    assert gone.u_position_m[middle] > 1.05 * fused(recorded).u_position_m[middle]


def test_single_frames_that_contradict_their_neighbours_are_set_aside():
    recorded = record(7)
    spiked = recorded.displacement_m.copy()
    spiked[300] += 0.012
    spiked[350] = spiked[349]
    without = recorded.displacement_m.copy()
    without[[300, 350]] = np.nan
    one, other = (fused(replace(recorded, displacement_m=z)) for z in (spiked, without))
    assert one.frames_set_aside == 2
    assert np.array_equal(one.position_m, other.position_m)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("start", "duration"), [(0.1005, 0.003), (0.15, 0.01)])
def test_bridged_samples_of_the_accelerometer_are_covered(start, duration):
    errors = []
    for seed in range(12):
        recorded = record(seed)
        lost = (recorded.times_s > start) & (recorded.times_s < start + duration)
        bridged = bridge(np.where(lost, np.nan, recorded.acceleration_m_s2))
        holed = replace(recorded, acceleration_m_s2=bridged)
        result, whole = fused(holed, bridged=lost), fused(recorded)
        inside = np.argmin(np.abs(result.times_s - start - duration / 2))
        assert result.u_velocity_m_s[inside] > 1.5 * whole.u_velocity_m_s[inside]
        x, v = standardised(result)
        errors.append((np.mean(np.abs(x) < 3), np.mean(np.abs(v) < 3)))
        assert result.innovation_statistic < 1.2
    assert np.mean(errors) > 0.97
    untold = fused(holed)
    assert untold.innovation_statistic > result.innovation_statistic


def test_the_likeliest_of_several_noise_densities_is_taken():
    recorded = record(9, (2000.0, 5e-5, 20.0))
    density = 25.0 * recorded.step_s
    result = fuse(
        recorded.frame_times_s, recorded.displacement_m, 0.0, recorded.step_s, recorded.acceleration_m_s2,
        marker_sigma_m=SIGMA, acceleration_density=[density, 16 * density, 256 * density],
    )  # fmt: skip
    assert isinstance(result, FusedMotion)
    assert result.acceleration_density == 16 * density


# ---- what cannot be fused


def test_too_few_frames_are_told_in_a_sentence():
    recorded = record(1)
    few = np.where(np.arange(recorded.frame_times_s.size) < 9, recorded.displacement_m, np.nan)
    answer = fuse(
        recorded.frame_times_s, few, 0.0, recorded.step_s, recorded.acceleration_m_s2,
        marker_sigma_m=SIGMA, acceleration_density=1e-3,
    )  # fmt: skip
    assert isinstance(answer, str)
    assert answer.startswith("only 9 frames")


def test_a_motion_that_is_a_parabola_is_told_in_a_sentence():
    frames, step = np.arange(200) / 2000, 1 / 20000
    answer = fuse(
        frames, 0.5 * 4.0 * frames**2, 0.0, step, np.full(2000, 4.0), marker_sigma_m=SIGMA, acceleration_density=1e-3
    )
    assert answer == "the motion that both records show cannot be distinguished from an error of zero or velocity"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"frame_times_s": np.zeros(20)}, "increase strictly"),
        ({"frame_times_s": np.arange(19.0)}, "equally many"),
        ({"step_s": 0.0}, "step_s must be positive"),
        ({"acceleration_m_s2": np.array([1.0, np.nan])}, "must be finite"),
        ({"acceleration_m_s2": np.array([1.0])}, "two samples"),
        ({"bridged": np.zeros(3, dtype=bool)}, "bridged must be equally many"),
        ({"marker_sigma_m": 0.0}, "marker_sigma_m must be positive"),
        ({"acceleration_density": -1.0}, "acceleration_density must be positive"),
        ({"acceleration_density": []}, "noise density"),
        ({"u_offset_s": -1.0}, "u_offset_s must not be negative"),
        ({"u_drift": np.nan}, "u_drift must not be negative"),
    ],
)
def test_a_callers_mistake_is_refused(changes, message):
    arguments = {
        "frame_times_s": np.arange(20.0), "displacement_m": np.sin(np.arange(20.0)), "start_s": 0.0, "step_s": 1.0,
        "acceleration_m_s2": np.sin(np.arange(30.0)), "marker_sigma_m": 1.0, "acceleration_density": 1.0,
    }  # fmt: skip
    with pytest.raises(ValueError, match=message):
        fuse(**(arguments | changes))
