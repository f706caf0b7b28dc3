from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.calibration.trace import choose_trace_window, mass_trace, reached, trace_window
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.filters import LowPass
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import MASS_KG, bench_motion, bench_regression, bench_shot
from tests.builders.virtual_shots import identified, virtual_shot


def shot_of(mass_kg: np.ndarray | float, sigma: float, seed: int = 2):
    """A filtered shot of a mass that may change, in noise that does not."""
    plain = bench_regression()
    noise = np.random.default_rng(seed).normal(0.0, sigma, plain.times_s.size)
    return replace(plain, acceleration_m_s2=plain.force_n / mass_kg + noise).filtered(LowPass(300.0))


def window_of(regression) -> float:
    window_s, choice = choose_trace_window(regression, regression.acceleration_m_s2, regression.force_n)
    assert choice.window in [tried.window for tried in choice.tried]
    return window_s


def test_a_constant_mass_has_a_memory_longer_than_one_that_changes():
    start, end = bench_regression().interval_s
    since = np.clip((bench_regression().times_s - start) / (end - start), 0.0, 1.0)
    constant = window_of(shot_of(MASS_KG, 20.0))
    changing = window_of(shot_of(MASS_KG * (1 - 0.6 * since), 5.0))
    assert changing < 0.5 * constant


def test_the_reason_is_a_sentence_with_the_windows_that_were_tried():
    regression = shot_of(MASS_KG, 20.0)
    _, choice = choose_trace_window(regression, regression.acceleration_m_s2, regression.force_n)
    assert f"of windows of {choice.tried[0].window} to {choice.tried[-1].window} samples" in choice.reason


def test_a_shot_too_short_to_choose_from_says_how_to_give_the_memory():
    regression = shot_of(MASS_KG, 20.0)
    start = regression.interval_s[0]
    brief = replace(regression, interval_s=(start, start + 0.01))
    with pytest.raises(IdentificationError, match="--window-s"):
        choose_trace_window(brief, brief.acceleration_m_s2, brief.force_n)


@pytest.mark.whole_way
def test_a_memory_longer_than_the_interval_is_refused_with_its_length():
    virtual = virtual_shot("field-2013")
    start, end = identified("field-2013").route.filtered.interval_s
    with pytest.raises(IdentificationError) as caught:
        identify_shot(FiredShot(virtual.shot, virtual.rig), Options(window_s=1.01 * (end - start)))
    assert caught.value.expected == f"at most {end - start:.3g} s"
    assert "--window-s" in str(caught.value)
    regression = shot_of(MASS_KG, 20.0)
    longest = regression.interval_s[1] - regression.interval_s[0]
    assert trace_window(longest, regression, regression.acceleration_m_s2, regression.force_n) == (longest, None)


@pytest.mark.whole_way
def test_a_virtual_shot_is_given_the_memory_that_predicts_best_and_its_mass_stays():
    virtual = virtual_shot("field-2013")
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(window_s=None))
    usual = identified("field-2013")
    assert found.window_choice is not None
    assert usual.window_choice is None
    assert found.chosen.trace.window_s >= 0.02
    assert found.chosen.estimate.mass_kg == usual.chosen.estimate.mass_kg
    assert found.chosen.rpe_percent < usual.chosen.rpe_percent + 0.05


def test_a_default_that_does_not_fit_is_chosen_and_what_is_asked_for_is_refused_without_a_circle():
    regression = shot_of(MASS_KG, 20.0)
    start = regression.interval_s[0]
    brief = replace(regression, interval_s=(start, start + 0.016))
    both = brief, brief.acceleration_m_s2, brief.force_n
    for asked, default in ((0.02, 0.02), (None, None)):
        window_s, choice = trace_window(asked, *both, default_s=default)
        assert window_s == pytest.approx(0.004, rel=0.1)
        assert choice.reason.startswith("the shot is too short to choose the memory of the trace from: ")
    with pytest.raises(IdentificationError, match="give a shorter --window-s, or auto"):
        trace_window(0.02, *both)
    with pytest.raises(IdentificationError, match=r"shorter than 10 samples.*give a longer --window-s, or auto"):
        trace_window(5.0 * regression.step_s, *both, default_s=0.02)


WINDOW_S = 0.01


def noisy(sigma: float, seed: int = 1):
    regression = bench_regression()
    noise = np.random.default_rng(seed).normal(0.0, sigma, regression.times_s.size)
    return replace(regression, acceleration_m_s2=regression.acceleration_m_s2 + noise).filtered(LowPass(300.0))


def trace_of(regression, direction="reverse", systematic_rel=0.0, window_s=WINDOW_S, **more):
    return mass_trace(
        regression, regression.acceleration_m_s2, regression.force_n, window_s,
        direction=direction, systematic_rel=systematic_rel, **more,
    )  # fmt: skip


@pytest.mark.parametrize("direction", ["reverse", "forward"])
def test_without_noise_every_window_has_the_mass(direction):
    trace = trace_of(bench_regression().filtered(LowPass(300.0)), direction)
    assert trace.identified.any()
    np.testing.assert_allclose(trace.mass_kg[trace.identified], MASS_KG, rtol=0.01)
    assert trace.times_s[0] == pytest.approx(0.03, abs=1e-4)
    assert trace.times_s[-1] == pytest.approx(bench_regression().interval_s[1], abs=1e-4)
    assert trace.window_s == pytest.approx(WINDOW_S)


def test_every_window_is_the_least_squares_of_its_own_samples():
    regression = noisy(5.0)
    trace = trace_of(regression)
    size = round(WINDOW_S * regression.rate_hz)
    inside = np.flatnonzero(regression.inside)
    for k in (300, 900, 1500):
        rows = slice(inside[k] - size + 1, inside[k] + 1)
        a, f = regression.acceleration_m_s2[rows], regression.force_n[rows]
        assert trace.mass_kg[k] == pytest.approx(f @ f / (a @ f), rel=1e-10)


@pytest.mark.whole_way
def test_the_uncertainty_is_the_scatter_of_the_masses():
    traces = [trace_of(noisy(15.0, seed)) for seed in range(40)]
    masses = np.array([t.mass_kg for t in traces])
    u = np.array([t.u_kg for t in traces])
    some = slice(100, 1500, 100)
    ratio = np.nanmean(u[:, some], axis=0) / np.nanstd(masses[:, some], axis=0)
    assert 0.8 < np.median(ratio) < 1.25


def test_what_all_windows_share_is_added_to_each():
    alone, shared = trace_of(noisy(5.0)), trace_of(noisy(5.0), systematic_rel=0.01)
    at = alone.identified & shared.identified
    np.testing.assert_allclose(shared.u_kg[at], np.hypot(alone.u_kg[at], 0.01 * alone.mass_kg[at]), rtol=1e-12)


def test_errors_that_windows_answer_to_differently_widen_each_as_it_answers():
    regression = noisy(5.0)
    # the breech gauge reads 1 % high: it moves the masses of the pulse, and hardly those of the brake's phase
    error = 0.01 * regression.forces_n[:, :1] / MASS_KG
    alone, widened = trace_of(regression), trace_of(regression, errors_m_s2=error[reached(regression, WINDOW_S)])
    moved = mass_trace(
        regression, regression.acceleration_m_s2 + error[:, 0], regression.force_n, WINDOW_S,
        direction="reverse", systematic_rel=0.0,
    )  # fmt: skip
    at = alone.identified & widened.identified & moved.identified
    change = np.abs(moved.mass_kg - alone.mass_kg)[at]
    extra = np.sqrt(np.maximum(widened.u_kg**2 - alone.u_kg**2, 0.0))[at]
    np.testing.assert_allclose(extra, change, rtol=0.02, atol=0.02)
    assert change.max() > 7.0
    assert change.min() < 0.1 * change.max()


def test_errors_of_the_acceleration_are_refused_where_it_is_the_regressor():
    with pytest.raises(ValueError, match="no say"):
        trace_of(noisy(5.0), "forward", errors_m_s2=np.zeros((bench_regression().times_s.size, 1)))


def test_windows_that_tell_too_little_are_marked_counted_and_left_blank():
    trace = trace_of(noisy(60.0), largest_relative_u=0.01)
    assert 0 < trace.share < 1
    assert np.isnan(trace.mass_kg[~trace.identified]).all()
    assert np.isnan(trace.u_kg[~trace.identified]).all()
    assert np.isfinite(trace.mass_kg[trace.identified]).all()
    assert sum(trace.reasons.values()) == (~trace.identified).sum()
    assert "random uncertainty above 1 % of the mass" in trace.reasons
    assert (trace.u_kg[trace.identified] <= 0.0101 * trace.mass_kg[trace.identified]).all()


def test_the_papers_way_takes_every_window():
    assert trace_of(noisy(60.0), "forward", largest_relative_u=np.inf).share > 0.99


def test_lost_samples_are_left_out_of_their_windows():
    motion = bench_motion()
    lossy = motion.breech_pa.copy()
    lossy[1000:1600] = np.nan
    regression = bench_regression(bench_shot(p_breech=lossy)).filtered(LowPass(300.0))
    trace = trace_of(regression)
    assert trace.reasons["the window has no samples or no excitation"] > 0
    # the bridge across the gap has no share in any window
    np.testing.assert_allclose(trace.mass_kg[trace.identified], MASS_KG, rtol=0.02)


def test_a_window_below_ten_samples_is_the_callers_mistake():
    with pytest.raises(ValueError, match="has 6 samples; at least 10 are needed"):
        trace_of(noisy(1.0), window_s=3e-4)


def test_an_empty_interval_has_no_share():
    trace = trace_of(noisy(1.0))
    empty = replace(trace, identified=np.zeros(0, dtype=bool))
    assert empty.share == 0.0
