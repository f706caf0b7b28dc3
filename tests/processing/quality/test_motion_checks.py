import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.quality.balance_checks import check_braking, check_force_sign, check_impulse, check_skew
from recoil_processing.quality.motion_checks import (
    VelocityError,
    check_carriage,
    check_rest_to_rest,
    check_velocity,
    velocity_error,
)
from tests.builders.motions import travel

TIMES_S = 0.1 + np.arange(600) / 3000


def seen(noise_m: float = 5e-5, seed: int = 1) -> np.ndarray:
    return travel(TIMES_S) + noise_m * np.random.default_rng(seed).normal(size=TIMES_S.size)


@settings(deadline=None, max_examples=30)
@given(st.floats(-0.3, 0.3), st.floats(-40.0, 40.0), st.integers(0, 2**32 - 1))
def test_gain_and_zero_of_an_accelerometer_are_told_apart_by_their_velocities(gain, zero, seed):
    since = TIMES_S - TIMES_S[0]
    error = velocity_error(TIMES_S, seen(seed=seed), (1 + gain) * travel(TIMES_S) + 0.5 * zero * since**2, TIMES_S[0])
    assert error.peak_m_s == pytest.approx(9.2, rel=0.05)
    if gain == 0:
        assert error.zero_m_s2 == pytest.approx(zero, abs=0.2)
        assert error.left_m_s < 0.1
    if zero == 0:
        assert abs(error.largest_m_s) == pytest.approx(abs(gain) * error.peak_m_s, abs=0.1)


def test_frames_that_are_lost_or_jump_do_not_decide():
    positions = seen()
    positions[100:110] = np.nan
    positions[300] += 0.02
    error = velocity_error(TIMES_S, positions, travel(TIMES_S), TIMES_S[0])
    assert abs(error.largest_m_s) < 0.15


@pytest.mark.parametrize("count", [0, 1, 5, 20])
def test_too_few_frames_give_no_velocity(count):
    assert velocity_error(TIMES_S[:count], seen()[:count], seen()[:count], 0.0) is None


@pytest.mark.parametrize(
    ("error", "verdict", "words"),
    [
        (VelocityError(0.3, 10.0, 0.0, 0.3), "ok", "3.0 % of 10 m/s"),
        (VelocityError(-0.7, 10.0, 0.0, 0.7), "warn", "limit 5 %): wrong sensitivity"),
        (VelocityError(1.2, 10.0, 0.0, 1.2), "fail", "limit 10 %): wrong sensitivity"),
        (VelocityError(3.0, 10.0, 15.0, 0.4), "warn", "a zero that is off by +15 m/s^2 since the shot explains it"),
        (VelocityError(9.0, 10.0, 15.0, 1.2), "fail", "explains it"),
        (VelocityError(math.nan, 10.0, 0.0, 0.0), "warn", "check both records"),
        (VelocityError(1.0, 0.0, 0.0, 0.0), "warn", "check both records"),
    ],
)
def test_a_velocity_is_judged_by_what_explains_its_error(error, verdict, words):
    found, detail = check_velocity(error)
    assert found == verdict
    assert words in detail


@pytest.mark.parametrize(("final", "verdict"), [(0.2, "ok"), (-0.7, "warn"), (1.5, "fail"), (math.nan, "warn")])
def test_from_rest_to_rest_the_velocity_comes_back(final, verdict):
    found, detail = check_rest_to_rest(final, 10.0)
    assert found == verdict
    assert ("its zero moved" in detail) == (verdict != "ok")


@pytest.mark.parametrize(
    ("off", "u", "verdict"),
    [
        (0.019, 0.001, "ok"), (-0.03, 0.001, "warn"), (0.03, 0.012, "ok"), (0.3, 0.012, "fail"), (-0.3, 0.2, "ok"),
        (math.nan, 0.01, "warn"),
    ],
)  # fmt: skip
def test_the_tolerance_of_mass_and_sensors_is_taken_into_account(off, u, verdict):
    found, detail = check_impulse(off * 6000.0, 6000.0, u, mass_kg=782.0)
    assert found == verdict
    if math.isfinite(off):
        assert f"tolerance of mass and sensors {100 * u:.1f} %" in detail
        assert ("before the next shot" in detail) == (verdict != "ok")


@pytest.mark.parametrize(("added_kg", "found_kg", "verdict"), [(-120.0, 902.0, "fail"), (40.0, 742.0, "warn")])
def test_the_sign_of_the_added_mass_is_doubted_first(added_kg, found_kg, verdict):
    specification_kg = 782.0 + added_kg
    excess, momentum = (found_kg - specification_kg) * 10.0, specification_kg * 10.0
    found, detail = check_impulse(excess, momentum, 0.005, mass_kg=specification_kg, added_mass_kg=added_kg)
    asked = f"is the sign of the added mass right? With {-added_kg:+g} kg instead of {added_kg:+g} kg it agrees"
    assert (found, asked in detail) == (verdict, True)
    # a gain that is off is none of it
    found, detail = check_impulse(0.5 * momentum, momentum, 0.005, mass_kg=specification_kg, added_mass_kg=added_kg)
    assert (found, "sign" in detail) == ("fail", False)


def test_without_momentum_there_is_no_closure():
    assert check_impulse(10.0, 0.0, 0.01, mass_kg=782.0)[0] == "warn"
    assert check_braking(10.0, 0.0, 0.01)[0] == "warn"


@pytest.mark.parametrize(("off", "verdict"), [(0.01, "ok"), (-0.05, "warn"), (0.9, "warn")])
def test_what_the_brake_leaves_never_fails_a_shot(off, verdict):
    found, detail = check_braking(off * 6000.0, 6000.0, 0.01)
    assert found == verdict
    assert ("check both gauges" in detail) == (verdict != "ok")


@pytest.mark.parametrize(("sign", "noise", "verdict"), [(1, 0.0, "ok"), (-1, 0.0, "fail"), (1, 1.5, "warn")])
def test_force_and_acceleration_must_point_the_same_way(sign, noise, verdict):
    force = np.sin(np.pi * np.arange(200) / 200)
    acceleration = sign * 3 * force + noise * 3 * np.random.default_rng(1).normal(size=200)
    acceleration[5] = np.nan
    found, detail = check_force_sign(force, acceleration)
    assert found == verdict
    assert ("before the next shot" in detail) == (verdict != "ok")


def test_nothing_to_correlate_is_no_fault():
    assert check_force_sign(np.full(20, np.nan), np.ones(20))[0] == "ok"


@pytest.mark.parametrize(
    ("skew", "significant", "verdict"),
    [(5e-5, True, "ok"), (3e-4, True, "warn"), (3e-4, False, "ok"), (-3e-4, True, "warn")],
)
def test_a_skew_is_named_with_what_is_late(skew, significant, verdict):
    found, detail = check_skew(skew, 2e-5, significant=significant)
    assert found == verdict
    assert f"the {'acceleration' if skew > 0 else 'force'} is" in detail
    assert ("delay_s" in detail) == (verdict != "ok")


def test_a_declared_polarity_is_named_where_force_and_acceleration_point_apart():
    force = np.sin(np.pi * np.arange(200) / 200)
    assert "turned; set `polarity = -1` of that sensor" in check_force_sign(force, -force)[1]
    detail = check_force_sign(force, -force, reversed_by=["acc_recoil"])[1]
    assert "turned; `polarity` of acc_recoil is -1: take it out if that one is, else set" in detail


@pytest.mark.parametrize(("polarity", "advice"), [(1, "set `polarity = -1`"), (-1, "take it out")])
def test_a_carriage_sensor_that_is_turned_is_told_what_its_rig_declares(polarity, advice):
    verdict, detail = check_carriage(2.0, 0.05, polarity=polarity)
    assert verdict == "fail"
    assert "the sensor is turned" in detail
    assert advice in detail


@pytest.mark.parametrize(("excess", "u", "verdict"), [(0.28, 0.08, "warn"), (0.28, 0.01, "fail"), (0.2, 0.06, "ok")])
def test_a_carriage_sensor_fails_where_all_of_its_interval_is_beyond_the_limit(excess, u, verdict):
    assert check_carriage(excess, u)[0] == verdict
    assert check_carriage(-excess, u)[0] == verdict
