"""Of two suspects that explain as much, the one is likelier of which less was certain."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import t

from recoil_identification.campaign.suspicion import CERTIFIED, WRITTEN, Suspicion


@pytest.mark.parametrize("freedom", [WRITTEN, CERTIFIED])
@pytest.mark.parametrize("size", [0.5, 8.0])
def test_the_odds_are_the_integral_over_all_errors_that_it_may_have(freedom: float, size: float) -> None:
    u, gain = 0.02, 0.5 * (size / 0.02) ** 2
    errors = np.linspace(size - 0.2, size + 0.2, 20001)
    likelihood = np.exp(-0.5 * ((errors - size) / u) ** 2) * t.pdf(errors / 0.1, freedom) / 0.1
    expected = gain + math.log(np.trapezoid(likelihood, errors))
    assert Suspicion(gain, size, u, 0.1, freedom).log_odds == pytest.approx(expected, abs=0.05)


def test_a_mass_that_was_weighed_well_is_suspected_less_than_a_gauge_that_explains_a_little_less() -> None:
    weight = Suspicion(8.4, -8.9, 2.15, 0.05, WRITTEN)
    assert weight.log_odds < Suspicion(7.1, -0.0314, 0.0084, 0.005, CERTIFIED).log_odds
    # nobody gets a calibrated gauge wrong by that many of its uncertainties
    assert weight.log_odds > Suspicion(8.4, -0.1, 0.0084, 0.005, CERTIFIED).log_odds


def test_what_was_stated_is_taken_away_from_an_estimate() -> None:
    """Of readings that say -9 with u 2, and a statement of 0 with u 3."""
    u = 1 / math.hypot(1 / 2, 1 / 3)
    value = -9.0 / 4 * u**2
    of_prior = Suspicion.of_prior(value, u, 3.0, -9.0 / math.hypot(2.0, 3.0), CERTIFIED)
    assert (of_prior.size, of_prior.u) == (pytest.approx(-9.0), pytest.approx(2.0))
    assert of_prior.gain == pytest.approx(0.5 * 81 / 13)


def test_of_what_nothing_else_tells_nothing_is_suspected() -> None:
    assert Suspicion.of_prior(0.0, 3.0, 3.0, 0.0, WRITTEN).log_odds == 0.0
