"""A piezoelectric chain's droop is inverted exactly, and what that costs is told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_processing.double_integral import integrate
from recoil_processing.gaps import bridge
from recoil_processing.repairs.droop import invert_droop

STEP_S, T_S = 1e-4, 0.5
TIMES_S = STEP_S * np.arange(5000)


def ramp_and_hold(rise_s: float = 0.02, start_s: float = 0.05) -> tuple[np.ndarray, np.ndarray]:
    """A quantity that rises and stays, and what a chain of T makes of it: ``T / rise (1 - exp(-t / T))``, solved."""
    since, behind = np.maximum(TIMES_S - start_s, 0.0), np.maximum(TIMES_S - start_s - rise_s, 0.0)
    truth = np.minimum(since / rise_s, 1.0)
    return truth, T_S / rise_s * (np.exp(-behind / T_S) - np.exp(-since / T_S))


def test_what_stayed_stays_again():
    truth, drooping = ramp_and_hold()
    assert drooping[-1] < 0.5
    found = invert_droop(drooping, STEP_S, T_S, 0.0)
    assert np.max(np.abs(found.samples - truth)) < 1e-7
    assert found.repair.kind == "droop corrected"
    assert "T = 0.5 s was inverted" in found.repair.sentence
    assert np.array_equal(found.repair.flags, found.samples != drooping)


def test_the_arithmetic_is_that_of_one_line():
    samples = np.random.default_rng(1).normal(3.0, 1.0, 400)
    samples[50:60] = np.nan
    found = invert_droop(samples, STEP_S, T_S, 3.1)
    assert np.array_equal(found.samples, samples + integrate(bridge(samples) - 3.1, STEP_S) / T_S, equal_nan=True)


def test_a_gap_is_bridged_for_the_integral_stays_lost_and_costs_certainty():
    truth, drooping = ramp_and_hold()
    whole = invert_droop(drooping, STEP_S, T_S, 0.0)
    drooping[600:650] = np.nan
    found = invert_droop(drooping, STEP_S, T_S, 0.0)
    assert np.array_equal(np.isnan(found.samples), np.isnan(drooping))
    assert np.nanmax(np.abs(found.samples - truth)) < 1e-4
    assert found.u[-1] > 0
    assert whole.u[-1] == 0
    assert np.all(found.u[:600] == 0)
    assert "1 gaps were bridged" in found.repair.sentence


def test_the_declared_time_constant_is_known_as_well_as_it_is():
    truth, drooping = ramp_and_hold()
    for off in (-0.02, 0.02):
        found = invert_droop(drooping, STEP_S, T_S * (1 + off), 0.0, u_time_constant_s=0.02 * T_S)
        error = np.abs(found.samples - truth)[1000:]
        assert np.all(error < 1.1 * found.u[1000:])
        assert np.all(error > 0.9 * found.u[1000:])


@given(st.floats(1e-3, 10.0), st.floats(0.05, 5.0))
def test_an_error_of_the_rest_level_drifts_linearly(u_rest, t_s):
    _, drooping = ramp_and_hold()
    right = invert_droop(drooping, STEP_S, t_s, 0.0)
    wrong = invert_droop(drooping, STEP_S, t_s, u_rest, u_rest=u_rest)
    drift = right.samples - wrong.samples
    assert np.allclose(drift, u_rest * TIMES_S / t_s, rtol=1e-6, atol=1e-9 * u_rest)
    assert np.allclose(wrong.u, drift, rtol=1e-6, atol=1e-9 * u_rest)
    assert wrong.repair.figures["drift_per_s_of_u_rest"] == pytest.approx(u_rest / t_s)


def test_white_noise_walks_as_far_as_is_said():
    rng, noise = np.random.default_rng(2), 0.1
    ends = [invert_droop(noise * rng.standard_normal(500), STEP_S, T_S, 0.0, noise=noise) for _ in range(400)]
    scatter = np.std([integrated.samples[-1] - 0.0 for integrated in ends])
    assert scatter == pytest.approx(math.hypot(noise, ends[0].u[-1]), rel=0.1)


@given(st.integers(0, 2**32 - 1), st.integers(-20, 20))
def test_twice_the_signal_is_twice_the_result(seed, exponent):
    samples = np.random.default_rng(seed).normal(0.0, 1.0, 200)
    factor = 2.0**exponent
    found, scaled = (invert_droop(k * samples, STEP_S, T_S, 0.2 * k).samples for k in (1.0, factor))
    assert np.array_equal(scaled, factor * found)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"time_constant_s": 0.0}, "time_constant_s must be positive"),
        ({"step_s": -1.0}, "step_s must be positive"),
        ({"u_rest": -1.0}, "u_rest must not be negative"),
        ({"noise": math.nan}, "noise must not be negative"),
        ({"rest": math.inf}, "rest must be finite"),
        ({"samples": np.full(5, np.nan)}, "none of the 5 samples is there"),
    ],
)
def test_what_no_droop_can_be_inverted_from_is_refused(arguments, complaint):
    usual = {"samples": np.zeros(5), "step_s": STEP_S, "time_constant_s": T_S, "rest": 0.0}
    with pytest.raises(ValueError, match=complaint):
        invert_droop(**(usual | arguments))
