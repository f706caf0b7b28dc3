import numpy as np
import pytest

from recoil_processing.motion.smoothing_spline import fit_spline, smooth_spline
from tests.builders.sharp_recoil import motion, record_recoil

SIGMA = 5e-5


def test_residuals_are_as_large_as_the_noise():
    recorded = record_recoil(1, begin_s=0.06, end_s=0.3, marker_sigma_m=SIGMA)
    found = smooth_spline(recorded.frame_times_s, recorded.displacement_m, sigma_m=SIGMA)
    assert np.sqrt(np.mean(found.residual**2)) == pytest.approx(SIGMA, rel=2e-3)


def test_old_and_new_routine_of_scipy_agree():
    recorded = record_recoil(2, begin_s=0.06, end_s=0.3, marker_sigma_m=SIGMA)
    times, positions = np.arange(480.0), recorded.displacement_m / SIGMA
    new, old = fit_spline(times, positions, 480.0, legacy=False), fit_spline(times, positions, 480.0, legacy=True)
    assert np.sum((positions - old(times)) ** 2) == pytest.approx(480.0, rel=2e-3)
    assert np.sum((positions - new(times)) ** 2) == pytest.approx(480.0, rel=2e-3)
    for order in (1, 2):
        scale = np.abs(old(times, order)).max()
        assert np.abs(new(times, order) - old(times, order)).max() < 0.02 * scale


def test_a_polynomial_of_fifth_degree_is_reproduced_to_its_ends():
    times = np.arange(200) / 2000
    polynomial = np.polynomial.Polynomial([0.1, -2.0, 30.0, -100.0, 300.0, 2000.0])
    found = smooth_spline(times, polynomial(times), sigma_m=1e-9)
    assert np.allclose(found.acceleration, polynomial.deriv(2)(times), rtol=1e-4)


def test_uncertainties_are_those_of_the_errors_at_the_shot_too():
    z = []
    for seed in range(8):
        recorded = record_recoil(seed, begin_s=0.06, end_s=0.3, marker_sigma_m=SIGMA)
        _, v, a = motion(recorded.frame_times_s)
        found = smooth_spline(recorded.frame_times_s, recorded.displacement_m)
        z.append([(found.velocity - v) / found.u_velocity, (found.acceleration - a) / found.u_acceleration])
    for errors in np.moveaxis(np.array(z), 1, 0):
        assert 0.5 < np.sqrt(np.mean(errors**2)) < 1.5
