from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from recoil_identification.report.figure.ticks import linear_ticks, log_ticks


def said(label: str, exponent: int) -> float:
    return float(label.replace("−", "-")) * 10.0**exponent


@given(st.floats(-1e9, 1e9), st.floats(1e-6, 1e9), st.integers(3, 10))
def test_ticks_are_even_within_the_axis_and_labelled_by_what_they_are(low, width, most):
    high = low + width
    assume(width > 1e-6 * max(abs(low), abs(high)))
    ticks = linear_ticks(low, high, most)
    assert 1 <= len(ticks.values) <= most + 1
    assert all(low <= value <= high for value in ticks.values)
    steps = {
        round(b - a, 12 - math.ceil(math.log10(width))) for a, b in zip(ticks.values, ticks.values[1:], strict=False)
    }
    size = max(abs(low), abs(high))
    assert max(steps, default=0.0) - min(steps, default=0.0) <= 1e-9 * size
    for value, label in zip(ticks.values, ticks.labels, strict=True):
        assert said(label, ticks.exponent) == pytest.approx(value, abs=1e-9 * size)
        assert len(label) <= 12


@pytest.mark.parametrize(
    ("low", "high", "labels", "exponent"),
    [
        (0.07, 0.33, ("0.10", "0.15", "0.20", "0.25", "0.30"), 0),
        (-210.0, 205.0, ("−200", "−100", "0", "100", "200"), 0),
        (0.0, 1.2e6, ("0.0", "0.2", "0.4", "0.6", "0.8", "1.0", "1.2"), 6),
        (0.0, 4e-4, ("0", "100", "200", "300", "400"), -6),
    ],
)
def test_steps_are_of_one_two_and_five(low, high, labels, exponent):
    ticks = linear_ticks(low, high, 7)
    assert (ticks.labels, ticks.exponent) == (labels, exponent)


def test_decades_have_labels_and_what_lies_between_has_none():
    ticks = log_ticks(5.0, 2500.0, 8)
    assert [label for label in ticks.labels if label] == ["10", "100", "1000"]
    assert {5.0, 20.0, 900.0, 2000.0} <= set(ticks.values)


def test_powers_that_are_hard_to_count_are_raised():
    labels = [label for label in log_ticks(1e-12, 1e3, 6).labels if label]
    assert labels == ["10^−12", "10^−9", "10^−6", "10^−3", "10^0", "10^3"]


@given(st.floats(-280, 280), st.floats(1e-3, 30), st.integers(3, 10))
def test_a_logarithmic_axis_has_ticks_wherever_it_lies(power, decades, most):
    low, high = 10.0**power, 10.0 ** (power + decades)
    ticks = log_ticks(low, high, most)
    assert all(low <= value <= high for value in ticks.values)
    assert any(ticks.labels)
    assert list(ticks.values) == sorted(set(ticks.values))


def test_less_than_a_decade_is_labelled_between():
    assert [label for label in log_ticks(1.5, 8.0, 6).labels if label] == ["2", "5"]
