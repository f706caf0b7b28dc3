"""The size of a change that is found, against data sets that are drawn with it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_identification.inference.change_odds import (
    FOUND,
    LEAST_FACTOR,
    could_hide_text,
    found_size,
    ln_odds_of_change,
)
from recoil_identification.inference.score import Scores

ROWS, STEPS = 80, 12
SD = np.array([0.03, *[0.02] * STEPS])


def table() -> tuple[np.ndarray, np.ndarray]:
    """Return columns that are estimated anyway, and those of a drift and of steps, over the noise."""
    t = np.linspace(0.0, 1.0, ROWS)
    pulse = np.exp(-(((t - 0.2) / 0.15) ** 2))
    force = 300.0 * (pulse - 0.35)
    nuisance = np.column_stack([force, 300.0 * pulse, np.ones(ROWS)])
    steps = [t >= at for at in np.linspace(0.05, 0.9, STEPS)]
    return nuisance, force[:, np.newaxis] * np.column_stack([t, *steps])


def scores_of(left: np.ndarray) -> Scores:
    nuisance, columns = table()
    covariance = np.linalg.inv(nuisance.T @ nuisance + np.diag([0.0, 1e4, 0.0]))
    estimate = covariance @ nuisance.T @ left
    return Scores.of(left - nuisance @ estimate, nuisance, covariance, columns)


@pytest.mark.parametrize("change", [0, 5])
def test_a_change_of_the_size_is_found_in_nineteen_of_twenty_and_of_half_of_it_in_few(change: int) -> None:
    size, rng = found_size(scores_of(np.zeros(ROWS)), SD, change), np.random.default_rng(4)
    column = table()[1][:, change]
    shares = []
    for share in (1.0, 0.5, 0.0):
        found = [scores_of(share * size * column + rng.standard_normal(ROWS)) for _ in range(400)]
        shares.append(np.mean([ln_odds_of_change(one.ln_bayes_factors(SD)) > LEAST_FACTOR for one in found]))
    assert shares[0] == pytest.approx(FOUND, abs=0.04)
    assert shares[1] < 0.6
    assert shares[2] < 0.05


def test_drift_and_step_are_as_likely_beforehand_and_every_instant_as_the_others() -> None:
    factors = np.array([math.log(4.0), *[math.log(2.0)] * 3, math.log(8.0)])
    assert ln_odds_of_change(factors) == pytest.approx(math.log(0.5 * (4.0 + (2.0 + 2.0 + 2.0 + 8.0) / 4)))


def test_what_the_unknowns_explain_can_have_any_size() -> None:
    told = np.array([False, True])
    scores = Scores(np.zeros(2), np.eye(2), told, np.array([0.0, 4e6]), np.zeros((0, 2)))
    assert found_size(scores, SD[:2], 0) == math.inf
    assert 0.0 < found_size(scores, SD[:2], 1) < 0.01


def test_what_could_hide_is_said_but_for_what_is_more_than_all_of_the_mass() -> None:
    said = could_hide_text({"drift": 3.33, "step": 0.745}, "shots")
    assert said == "in 19 shots of 20 one of 3.3 % over the travel or 0.74 % at once would be, a smaller one may hide"
    assert "one of 0.74 % at once would be" in could_hide_text({"drift": math.inf, "step": 0.745}, "shots")
    nothing = could_hide_text({"drift": math.inf, "step": 140.0}, "campaigns")
    assert nothing == "none would be in 19 campaigns of 20, whatever its size: all may hide"
