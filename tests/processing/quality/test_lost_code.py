"""A value that stands for lost samples is told as that; what a sensor reads, clipped or not, is none."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_processing.quality.lost_code import find_lost_code

TIMES_S = np.arange(0.0, 0.5, 5e-4)
PULSE = 20.0 * np.exp(-0.5 * ((TIMES_S - 0.2) / 0.04) ** 2) + 0.01 * np.sin(2e3 * TIMES_S)
RANGE = (-3.0, 30.0)


def with_code(value: float, count: int, every: int = 1) -> np.ndarray:
    samples = PULSE.copy()
    samples[100 : 100 + count * every : every] = value
    return samples


@pytest.mark.parametrize("value", [-9999.0, -999.25, 1e6, 327.67, -99.99])
@pytest.mark.parametrize(("count", "every"), [(3, 1), (3, 90), (400, 1)])
def test_a_value_far_outside_that_returns_exactly_is_a_code(value: float, count: int, every: int) -> None:
    for limits in (RANGE, None):
        found = find_lost_code(with_code(value, count, every), limits)
        assert found is not None
        assert (found.value, found.count) == (value, count)
    verdict, detail = found.outcome("MPa")
    assert verdict == "fail"
    assert f"{count} samples are exactly {value:.6g} MPa" in detail
    assert "range" not in detail
    assert "polarity" not in detail


@pytest.mark.parametrize(
    "samples",
    [
        PULSE,
        np.clip(10.0 * PULSE, -3.0, 30.0),
        np.clip(10.0 * PULSE, -3.0, 33.0),
        with_code(-9999.0, 2),
        with_code(-9999.0, 700),
        with_code(0.0, 50),
        with_code(29.0, 50),
        with_code(-9999.0, 50) + np.arange(TIMES_S.size) * 1e-6,
        np.full(9, np.nan),
        np.array([1.0, -1e6, -1e6, -1e6]),
    ],
    ids=["sound", "clipped", "clipped behind", "two", "most", "zeros", "in range", "none alike", "lost", "few"],
)
def test_what_is_no_code_is_not_called_one(samples: np.ndarray) -> None:
    assert find_lost_code(samples, RANGE) is None
