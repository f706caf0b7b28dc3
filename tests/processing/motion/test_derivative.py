"""What the three methods of differentiating a displacement have in common."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.motion.derivative import Derivatives, ScaledTrack, second_derivative
from recoil_processing.motion.jerk_smoother import smooth_jerk
from recoil_processing.motion.savitzky_golay import local_polynomials
from recoil_processing.motion.smoothing_spline import smooth_spline
from tests.builders.sharp_recoil import ONSET_S, motion, record_recoil

SIGMA = 5e-5


def golay(times_s, positions_m, *, sigma_m=None) -> Derivatives:
    return local_polynomials(times_s, positions_m, window=13, sigma_m=sigma_m)


METHODS = (smooth_jerk, smooth_spline, golay)


def track(seed: int = 1, **options) -> tuple[np.ndarray, np.ndarray]:
    recorded = record_recoil(seed, begin_s=0.06, end_s=0.20, marker_sigma_m=SIGMA, **options)
    return recorded.frame_times_s, recorded.displacement_m


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("unit", [1e3, 2000.0, 2000.0 / 0.37])
def test_the_result_is_the_same_in_seconds_milliseconds_and_frames(method, unit):
    times, positions = track()
    seconds, others = method(times, positions), method(unit * times, positions)
    assert np.array_equal(seconds.edge, others.edge)
    for name, power in (("position", 0), ("velocity", 1), ("acceleration", 2)):
        for prefix in ("", "u_"):
            one, other = getattr(seconds, prefix + name), unit**power * getattr(others, prefix + name)
            assert np.allclose(one, other, rtol=0, atol=1e-7 * np.abs(one).max())


def test_the_usual_library_routine_oversmooths_in_seconds_and_ours_does_not():
    from scipy.interpolate import make_smoothing_spline

    times, positions = track()
    _, velocity, _ = motion(times)
    theirs = make_smoothing_spline(times, positions).derivative()(times)
    for method in METHODS:
        assert rms(method(times, positions).velocity - velocity) < 0.05 * rms(theirs - velocity)


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=8, deadline=None)
@given(st.floats(-3, 3), st.floats(-20, 20), st.floats(-300, 300))
def test_adding_a_parabola_adds_its_derivatives(method, place, speed, acceleration):
    times, positions = track()
    times, positions = times[60:160], positions[60:160]
    t = times - times[0]
    plain = method(times, positions, sigma_m=SIGMA)
    moved = method(times, positions + place + speed * t + 0.5 * acceleration * t**2, sigma_m=SIGMA)
    assert np.allclose(moved.velocity - plain.velocity, speed + acceleration * t, rtol=0, atol=2e-4)
    assert np.allclose(moved.acceleration - plain.acceleration, acceleration, rtol=0, atol=0.5)


@pytest.mark.parametrize("method", METHODS)
def test_noise_is_told_from_the_track_and_residuals_are_white(method):
    rng = np.random.default_rng(0)
    times = np.arange(1500) / 2000
    found = method(times, 0.3 * np.sin(8 * times) + SIGMA * rng.standard_normal(times.size))
    assert found.sigma == pytest.approx(SIGMA, rel=0.1)
    if method is not golay:  # a short window takes up much of the noise, which colours what is left
        assert found.whiteness < 3
    assert np.std(found.residual) == pytest.approx(SIGMA, rel=0.12)


def test_motion_that_was_smoothed_away_shows_in_the_whiteness():
    times, positions = track()
    assert local_polynomials(times, positions, window=61).whiteness > 20 * smooth_jerk(times, positions).whiteness


def test_whiteness_is_a_matter_of_neighbours_only_and_nan_without_any():
    rng = np.random.default_rng(1)

    def of(residual: np.ndarray) -> Derivatives:
        nothing = np.zeros(residual.size)
        return Derivatives(nothing, *(nothing,) * 6, np.zeros(residual.size, dtype=bool), "", 1.0, residual)

    values = [of(rng.standard_normal(400)).whiteness for _ in range(200)]
    assert np.mean(values) == pytest.approx(1.0, abs=0.1)
    slow = np.convolve(rng.standard_normal(400), np.ones(5) / 5, mode="same")
    assert of(slow).whiteness > 10
    assert np.isnan(of(np.where(np.arange(400) % 12 == 0, slow, np.nan)).whiteness)


@pytest.mark.parametrize("method", METHODS)
def test_lost_frames_stay_lost_and_are_edges_with_their_neighbours(method):
    times, positions = track()
    lost = np.zeros(times.size, dtype=bool)
    lost[[150, 151, 152, 153, 200]] = True
    found = method(times, np.where(lost, np.nan, positions))
    for name in ("position", "velocity", "acceleration", "u_position", "u_velocity", "u_acceleration", "residual"):
        assert np.array_equal(np.isnan(getattr(found, name)), lost)
    assert np.all(found.edge[lost])
    assert np.all(found.edge[[149, 154, 199, 201]])
    assert found.edge[0]
    assert found.edge[-1]
    _, velocity, _ = motion(times)
    assert rms(found.velocity - velocity) < 0.06


@pytest.mark.parametrize("method", METHODS)
def test_no_peak_is_read_at_an_edge(method):
    times, positions = track()
    late = times > ONSET_S + 0.0012
    found = method(times[late], positions[late])
    _, _, acceleration = motion(times[late])
    assert np.argmax(acceleration) == 0
    at, value, u = found.peak_acceleration()
    assert at > times[late][0]
    assert abs(value) < acceleration.max()
    assert u > 0


def test_where_all_is_edge_there_is_no_peak():
    with pytest.raises(ValueError, match="all 13 frames are edges"):
        golay(np.arange(13.0), np.sin(np.arange(13.0))).peak_acceleration()


def test_edges_are_half_a_window_wide_and_at_gaps_no_wider_than_allowed():
    times = np.concatenate([np.arange(20.0), 23.0 + np.arange(20.0)])
    positions = np.sin(times)
    scaled = ScaledTrack.of(times, positions, 1.0, 5)
    wide = scaled.edges(np.full(40, 6.0))
    assert np.array_equal(np.flatnonzero(~wide), [*range(6, 14), *range(26, 34)])
    narrow = scaled.edges(np.full(40, 6.0), gap_lengths=0.5)
    assert np.array_equal(np.flatnonzero(~narrow), [*range(6, 18), *range(22, 34)])
    assert np.flatnonzero(scaled.edges(np.zeros(40))).tolist() == [0, 19, 20, 39]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("times", "positions", "sigma", "message"),
    [
        (np.arange(30.0), np.zeros(29), None, "equally many"),
        (np.zeros(30), np.zeros(30), None, "increase strictly"),
        (np.append(np.arange(29.0), np.nan), np.zeros(30), None, "increase strictly"),
        (np.arange(30.0), np.full(30, np.inf), 1.0, "must be finite, or NaN"),
        (np.arange(30.0), np.full(30, np.nan), 1.0, "0 of 30 frames have a position"),
        (np.arange(30.0), np.zeros(30), None, "cannot be told from the third differences"),
        (np.arange(30.0), np.zeros(30), -1.0, "must be positive, not -1"),
    ],
)
def test_what_cannot_be_differentiated_is_refused(method, times, positions, sigma, message):
    with pytest.raises(ValueError, match=message):
        method(times, positions, sigma_m=sigma)


@pytest.mark.parametrize("share", [0.02, 0.05, 0.1])
def test_the_second_derivative_of_a_wave_is_right_where_two_gradients_are_not(share):
    times = np.arange(400) / 1000
    omega = 2 * np.pi * share * 1000
    wave, true = np.sin(omega * times), -(omega**2) * np.sin(omega * times)
    inner = slice(3, -3)
    error = np.abs(second_derivative(wave, 1e-3) - true)[inner].max() / omega**2
    gradients = np.abs(np.gradient(np.gradient(wave, 1e-3), 1e-3) - true)[inner].max() / omega**2
    assert error < 1.1 * (omega * 1e-3) ** 6 / 560
    assert gradients > 0.25 * (omega * 1e-3) ** 2


@pytest.mark.parametrize("count", [3, 6, 7, 20])
def test_the_second_derivative_of_a_short_parabola_is_its_constant_inside(count):
    found = second_derivative(3.0 * np.arange(float(count)) ** 2, 1.0)
    assert found.shape == (count,)
    assert np.allclose(found[3:-3], 6.0)
    assert np.all(np.isfinite(found))
