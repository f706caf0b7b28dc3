"""Stretches that differ by more than their rows allow are said to, and weights that do; white noise is none of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_identification.calibration.misfit import (
    MOST_OF_ITSELF,
    PRIOR_FREEDOM,
    SHARES_OF_STROKE,
    largest_misfit,
    misfit_of_stretches,
    misfit_of_weights,
)

ROWS, STRETCHES = 400, 20
TIMES_S = np.arange(ROWS) * 0.01
"""Instants of four seconds of rows: 20 stretches of 0.2 s."""
INFLUENCE = np.full(ROWS, 0.01)


def test_white_noise_leaves_what_its_rows_say() -> None:
    rng = np.random.default_rng(3)
    found = [misfit_of_stretches(TIMES_S, INFLUENCE, rng.standard_normal(ROWS), 0.2) for _ in range(200)]
    u = np.sqrt(np.mean([one[0] ** 2 for one in found]))
    # a fit that bends to none of it: each stretch hides nothing, and is taken to hide its share
    by_rows, counts = math.sqrt(INFLUENCE @ INFLUENCE), (STRETCHES - 1) / (STRETCHES - 1 + PRIOR_FREEDOM)
    assert u == pytest.approx(by_rows * math.sqrt(counts) / (1.0 - 1.0 / STRETCHES), rel=0.05)
    assert found[0][1] == pytest.approx(STRETCHES - 1 + PRIOR_FREEDOM, rel=1e-2)


def test_what_goes_from_stretch_to_stretch_is_told() -> None:
    rng = np.random.default_rng(4)
    each = np.repeat(rng.standard_normal(STRETCHES), ROWS // STRETCHES)
    slow, _ = misfit_of_stretches(TIMES_S, INFLUENCE, each, 0.2)
    assert slow > 3.0 * math.sqrt(INFLUENCE @ INFLUENCE)


def test_one_stretch_that_tells_all_says_nothing() -> None:
    alone = np.where(TIMES_S < 0.2, 1.0, 1e-9)
    u, freedom = misfit_of_stretches(TIMES_S, alone, np.ones(ROWS), 0.2)
    assert u < 1e-3 * alone.sum() / (1.0 - MOST_OF_ITSELF)
    assert freedom == pytest.approx(PRIOR_FREEDOM)
    assert misfit_of_stretches(TIMES_S, 0.0 * INFLUENCE, np.ones(ROWS), 0.2) == (0.0, PRIOR_FREEDOM)


def test_the_length_that_says_most_counts() -> None:
    left = np.sin(2 * np.pi * TIMES_S / 0.8)
    each = [misfit_of_stretches(TIMES_S, INFLUENCE, left, share * 2.0)[0] for share in SHARES_OF_STROKE]
    assert largest_misfit(TIMES_S, INFLUENCE, left, 2.0)[0] == max(each)


def test_a_length_is_positive() -> None:
    with pytest.raises(ValueError, match="stretch_s must be positive, not 0"):
        misfit_of_stretches(TIMES_S, INFLUENCE, INFLUENCE, 0.0)


def test_weights_that_differ_by_chance_say_nothing() -> None:
    assert misfit_of_weights(1e-3, 1e-6)[0] == 0.0
    u, freedom = misfit_of_weights(0.013, 25e-6)
    assert u == pytest.approx(0.012 / math.sqrt(1.0 + PRIOR_FREEDOM))
    assert freedom == 1.0 + PRIOR_FREEDOM
    assert misfit_of_weights(0.01, -1.0)[0] == pytest.approx(0.01 / math.sqrt(3.0))
