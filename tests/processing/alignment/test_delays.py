from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.alignment.delays import (
    Delay,
    DelayPart,
    declared_delay,
    exposure_delay,
    filter_delay,
    mount_delay,
    sum_of,
)
from recoil_processing.filters.analog_filter import AnalogLowPass

CORNERS_HZ = st.floats(10.0, 1e5)


@pytest.mark.parametrize("order", [1, 2, 4, 8])
def test_a_butterworth_filters_delay_is_the_known_formula(order):
    part = filter_delay(800.0, "butterworth", order)
    assert part.delay_s == pytest.approx(1.0 / (2 * math.pi * 800.0 * math.sin(math.pi / (2 * order))), rel=1e-9)
    assert part.u_s == pytest.approx(0.05 * part.delay_s)


@pytest.mark.exhaustive
@pytest.mark.parametrize("kind", ["bessel", "butterworth"])
@pytest.mark.parametrize("order", [2, 4, 6])
def test_a_slow_signal_comes_out_late_by_the_delay_and_the_corner_is_3_db_down(kind, order):
    from scipy.signal import bessel, butter, lsim

    corner_hz = 500.0
    t = np.arange(40_000) * 1e-5
    slow = np.sin(2 * np.pi * 10.0 * t)
    design = butter if kind == "butterworth" else bessel
    more = {} if kind == "butterworth" else {"norm": "mag"}
    system = design(order, 2 * np.pi * corner_hz, analog=True, **more)
    _, out, _ = lsim(system, slow, t)
    delay = filter_delay(corner_hz, kind, order).delay_s
    expected = np.sin(2 * np.pi * 10.0 * (t - delay))
    assert np.abs(out - expected)[10_000:].max() < 2e-4
    assert AnalogLowPass(corner_hz, kind, order).gain(np.array([corner_hz])) == pytest.approx([math.sqrt(0.5)])


@settings(deadline=None, max_examples=30)
@given(CORNERS_HZ, st.sampled_from(["bessel", "butterworth"]), st.integers(1, 8))
def test_a_filters_delay_goes_with_the_inverse_of_its_corner(corner_hz, kind, order):
    one = filter_delay(1.0, kind, order)
    assert filter_delay(corner_hz, kind, order).delay_s == pytest.approx(one.delay_s / corner_hz, rel=1e-9)


@settings(deadline=None, max_examples=30)
@given(CORNERS_HZ)
def test_a_filter_of_unknown_type_is_not_corrected_but_all_it_may_be_is_uncertain(corner_hz):
    part = filter_delay(corner_hz)
    assert part.delay_s == 0.0
    for kind in ("bessel", "butterworth"):
        for order in (1, 2, 4, 8):
            assert filter_delay(corner_hz, kind, order).delay_s <= math.sqrt(3.0) * part.u_s * (1 + 1e-9)


def test_a_mount_delays_as_a_second_order_system_does_below_its_resonance():
    part = mount_delay(900.0, 0.03)
    assert part.delay_s == pytest.approx(10.6e-6, rel=0.01)
    assert 6e-6 > part.u_s > 2e-6
    assert mount_delay(900.0, 0.0).delay_s == 0.0


def test_stamps_of_the_shutters_opening_are_early_by_half_the_exposure():
    assert exposure_delay(1e-4, "start") == DelayPart("half the exposure", -5e-5, 0.0)
    assert exposure_delay(1e-4, "end") == DelayPart("half the exposure", 5e-5, 0.0)
    assert exposure_delay(1e-4, "middle") is None
    unsaid = exposure_delay(1e-4)
    assert unsaid is not None
    assert unsaid.delay_s == -5e-5
    # the root mean square of a correction that is missed by anything up to all of it
    assert unsaid.u_s == pytest.approx(np.sqrt(np.mean(np.linspace(0, 5e-5, 10_001) ** 2)), rel=1e-3)


@settings(deadline=None, max_examples=30)
@given(st.lists(st.tuples(st.floats(-1e-2, 1e-2), st.floats(0, 1e-2)), max_size=6))
def test_delays_add_and_their_uncertainties_add_in_quadrature(values):
    delay = sum_of([None, *(DelayPart("c", d, u) for d, u in values)])
    assert delay.delay_s == pytest.approx(sum(d for d, _ in values), abs=1e-12)
    assert delay.u_s == pytest.approx(math.sqrt(sum(u * u for _, u in values)), abs=1e-12)
    assert [row["delay_s"] for row in delay.to_json("acc")] == [d for d, _ in values]
    assert all(row["channel"] == "acc" for row in delay.to_json("acc"))


def test_nothing_declared_is_no_delay():
    assert declared_delay(0.0, 0.0) is None
    assert sum_of([None]) == Delay()
    assert (Delay().delay_s, Delay().u_s, Delay().to_json("x")) == (0.0, 0.0, [])
    assert declared_delay(0.0, 1e-5) == DelayPart("declared", 0.0, 1e-5)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: filter_delay(0.0), "cutoff_hz must be positive"),
        (lambda: filter_delay(100.0, "bessel", 26), "order must be a whole number"),
        (lambda: filter_delay(100.0, "chebyshev"), "kind must be"),  # type: ignore[arg-type]  # a caller's mistake
        (lambda: mount_delay(0.0, 0.1), "resonance_hz must be positive"),
        (lambda: mount_delay(900.0, -0.1), "damping must not be negative"),
        (lambda: exposure_delay(-1e-6), "exposure_s must not be negative"),
        (lambda: exposure_delay(1e-4, "late"), "stamp must be"),  # type: ignore[arg-type]  # a caller's mistake
    ],
)
def test_a_callers_mistakes_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
