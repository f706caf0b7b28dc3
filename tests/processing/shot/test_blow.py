"""A blow is found in a long record, and what lasts is none."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_processing.shot.blow import Blow

RATE_HZ = 20e3
TIMES_S = np.arange(20_000) / RATE_HZ
EVERYWHERE = np.ones(TIMES_S.size, dtype=bool)


def pulse(at_s: float, lasts_s: float = 1e-3) -> np.ndarray:
    phase = (TIMES_S - at_s) / lasts_s
    return np.where((phase > 0) & (phase < 1), np.sin(np.pi * np.clip(phase, 0, 1)), 0.0)


@pytest.mark.parametrize("sigma", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_blow_of_a_millisecond_is_found_in_a_second(sigma: float, sign: float) -> None:
    noise = sigma * np.random.default_rng(1).standard_normal(TIMES_S.size)
    found = Blow.of(sign * pulse(0.4) + noise + 3.0, EVERYWHERE, RATE_HZ)
    assert found is not None
    assert found.lasts_s == pytest.approx(1e-3, rel=0.3)
    inside = TIMES_S[found.flags]
    assert 0.398 < inside.min() < 0.4
    assert 0.401 < inside.max() < 0.403
    assert found.cutoff_hz == pytest.approx(2e3, rel=0.4)


def test_two_blows_are_two_stretches() -> None:
    found = Blow.of(pulse(0.2) + 0.7 * pulse(0.8), EVERYWHERE, RATE_HZ)
    assert found is not None
    edges = np.flatnonzero(np.diff(found.flags.astype(int)) == 1)
    assert edges.size == 2


@pytest.mark.parametrize("lasting", [np.sin(2 * np.pi * TIMES_S), pulse(0.1, 0.3), 0.0 * TIMES_S, 0.0 * TIMES_S + 5.0])
def test_what_lasts_or_never_comes_is_no_blow(lasting: np.ndarray) -> None:
    assert Blow.of(lasting, EVERYWHERE, RATE_HZ) is None


def test_a_force_that_holds_between_strokes_is_no_noise() -> None:
    # two short strokes, and a holding force of either sign that is larger than what its spread over the record allows
    holds = np.where(TIMES_S % 0.2 < 0.1, 0.9, -0.9) * (TIMES_S > 0.3)
    assert Blow.of(holds + pulse(0.1, 0.05), EVERYWHERE, RATE_HZ) is None


def test_nothing_is_looked_for_where_nothing_is_asked() -> None:
    assert Blow.of(pulse(0.4), ~EVERYWHERE, RATE_HZ) is None
    assert Blow.of(pulse(0.4), TIMES_S > 0.5, RATE_HZ) is None
