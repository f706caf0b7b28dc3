from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_identification.targets.forces.force_inversion import InvertedForce, invert_force
from recoil_identification.targets.forces.force_peak import find_peak
from recoil_identification.targets.forces.input_estimate import InputEstimate, estimate_input, thinning_factor
from recoil_processing.stress_waves.ringing import Mode
from tests.builders.driven_parts import GAIN_ERROR, HELD_N, ONSET_S, DrivenPart, driven_part


@cache
def estimated(seed: int = 1, tracked: bool = True) -> tuple[DrivenPart, InputEstimate]:
    part = driven_part(seed)
    return part, estimate_input(part.measured, part.tracked if tracked else None, part.modes)


@cache
def inverted(seed: int = 1) -> InvertedForce:
    part, found = estimated(seed)
    return invert_force(
        part.measured,
        part.tracked,
        error_covariance_n2=found.error_covariance_n2,
        factor=found.factor,
        onset_s=ONSET_S,
        held_n=HELD_N,
        times_s=found.times_s,
    )


def true_force(part: DrivenPart, times_s: np.ndarray) -> np.ndarray:
    return np.interp(times_s, part.measured.times_s, part.force_n)


@pytest.mark.whole_way
def test_the_force_is_found_beneath_stress_waves_of_a_seventh_of_it():
    part, found = estimated()
    truth = true_force(part, found.times_s)
    free = found.times_s > ONSET_S
    error = (found.force_n - truth)[free]
    assert np.max(np.abs(error)) < 0.05 * truth.max()
    assert np.sqrt(np.mean(error**2)) < 0.01 * truth.max()
    assert np.mean(np.abs(error) < 1.96 * found.u_force_n[free]) > 0.85
    assert found.innovation_statistic == pytest.approx(1.0, abs=0.3)
    assert np.max(np.abs(found.stress_waves_n)) > 50e3


@pytest.mark.whole_way
def test_peak_and_impulse_lie_within_their_intervals():
    part, found = estimated()
    truth = true_force(part, found.times_s)
    peak = find_peak(found, ONSET_S)
    free = found.times_s >= ONSET_S
    impulse = np.trapezoid(truth[free], found.times_s[free])
    assert abs(peak.force_n - truth.max()) < 1.96 * peak.u_force_n < 0.03 * truth.max()
    assert abs(peak.impulse_n_s - impulse) < 3 * peak.u_impulse_n_s < 0.005 * impulse
    assert abs(peak.time_s - found.times_s[np.argmax(truth)]) < 2 * peak.u_time_s + 2e-5


@pytest.mark.whole_way
def test_the_camera_tells_the_accelerometers_scale():
    _, tracked = estimated()
    _, alone = estimated(tracked=False)
    assert abs(tracked.gain_error - GAIN_ERROR) < 2 * tracked.u_gain_error
    assert tracked.u_gain_error < 0.0025
    assert alone.u_gain_error == pytest.approx(0.005, rel=0.2)
    assert find_peak(tracked, ONSET_S).u_impulse_n_s < find_peak(alone, ONSET_S).u_impulse_n_s


@pytest.mark.whole_way
def test_a_lost_stretch_widens_the_band_and_nothing_else():
    part, whole = estimated()
    force = part.measured.force_n.copy()
    lost = slice(400, 440)
    force[lost] = np.nan
    found = estimate_input(replace(part.measured, force_n=force), part.tracked, part.modes)
    inside = (found.times_s > 0.00805) & (found.times_s < 0.00875)
    assert np.all(np.isfinite(found.force_n))
    assert found.u_force_n[inside].mean() > 1.1 * whole.u_force_n[inside].mean()
    error = (found.force_n - true_force(part, found.times_s))[inside]
    assert np.all(np.abs(error) < 4 * found.u_force_n[inside])


@pytest.mark.whole_way
def test_the_inversion_agrees_with_the_smoother_and_with_the_truth():
    part, found = estimated()
    other = inverted()
    truth = true_force(part, found.times_s)
    free = found.times_s > ONSET_S
    assert np.all(np.isnan(other.force_n[~(found.times_s >= ONSET_S)]))
    error = (other.force_n - truth)[free]
    assert np.sqrt(np.mean(error**2)) < 0.01 * truth.max()
    force, u, _ = other.peak
    assert abs(force - truth.max()) < 3 * u
    impulse = np.trapezoid(truth[free], found.times_s[free])
    assert other.impulse_n_s == pytest.approx(impulse, rel=0.01)
    assert not other.inversion.at_bound


def test_the_covariance_of_the_errors_is_one():
    _, found = estimated()
    covariance = found.error_covariance_n2
    np.testing.assert_allclose(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance).min() > 0
    # the structure rests before the knock and rings behind it
    early, late = covariance[5, 5], covariance[np.searchsorted(found.times_s, ONSET_S + 1e-3)].max()
    assert late > 100 * early


def test_a_record_is_thinned_as_far_as_its_highest_mode_allows():
    assert thinning_factor(50e3, ()) == 5
    assert thinning_factor(50e3, (Mode(4000.0, 0.02, 0.1, 1.0),)) == 4
    assert thinning_factor(8e3, ()) == 1


def test_a_block_with_a_lost_sample_is_lost():
    part = driven_part()
    force = part.measured.force_n.copy()
    force[7] = np.nan
    thin = replace(part.measured, force_n=force).thinned(4)
    assert np.flatnonzero(np.isnan(thin.force_n)).tolist() == [1]
    assert thin.times_s[0] == pytest.approx(1.5 * part.measured.step_s)
    assert thin.noise_n == pytest.approx(part.measured.noise_n / 2)
    with pytest.raises(ValueError, match="at least 1"):
        part.measured.thinned(0)


def test_a_record_that_is_too_short_is_refused():
    part = driven_part()
    lost = replace(part.measured, force_n=np.full(part.measured.force_n.size, np.nan))
    with pytest.raises(ValueError, match="at least 20 samples"):
        estimate_input(lost, None, part.modes)


def test_a_peak_behind_the_end_is_refused():
    with pytest.raises(ValueError, match="the force ends"):
        find_peak(estimated()[1], 1.0)


def test_an_inversion_without_rows_is_refused():
    part, found = estimated()
    lost = replace(part.measured, force_n=np.where(part.measured.times_s > ONSET_S, np.nan, part.measured.force_n))
    with pytest.raises(ValueError, match="rows behind the release"):
        invert_force(
            lost,
            None,
            error_covariance_n2=found.error_covariance_n2,
            factor=found.factor,
            onset_s=ONSET_S,
            held_n=HELD_N,
            times_s=found.times_s,
        )
