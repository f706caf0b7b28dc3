from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.calibration.trace import choose_trace_window, trace_window
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.filters import LowPass
from recoil_rigs.fired_shot import FiredShot
from tests.builders.bench_shots import MASS_KG, bench_regression
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
