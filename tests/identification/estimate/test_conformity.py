"""Decision rules against a Monte Carlo method, and the probability against what must hold of any."""

from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_identification.estimate.conformity import conformity_of, stated_conformity
from recoil_rigs.tables.issue import Issue
from recoil_rigs.tables.specification import Specification

DRAWS = 400_000
OF = Specification(782.0, u_m3_kg=0.5, added_kg=120.0, u_added_kg=0.3, carried_kg=6.0, u_carried_kg=0.9)
BARE = Specification(782.0)
OPEN = math.inf


def drawn(off_kg: float, u_kg: float, freedom: float = math.inf, seed: int = 20261126):
    """True deviations, by what is known of them after the measurement."""
    rng = np.random.default_rng(seed)
    unit = rng.standard_normal(DRAWS) if math.isinf(freedom) else rng.standard_t(freedom, DRAWS)
    return off_kg + u_kg * unit


@pytest.mark.parametrize(
    "tolerance_kg", [(-4.0, 4.0), (-1.0, 6.0), (2.0, 3.0), (-30.0, -10.0), (-OPEN, 2.0), (-1.0, OPEN)]
)
@pytest.mark.parametrize(("off_kg", "u_kg"), [(0.0, 2.5), (3.1, 2.5), (-6.0, 1.0), (4.0, 0.05)])
@pytest.mark.parametrize("freedom", [math.inf, 7.0])
def test_the_probability_is_the_share_of_draws_inside(tolerance_kg, off_kg, u_kg, freedom):
    found = conformity_of(tolerance_kg, OF, OF.mass_kg + off_kg, u_kg, freedom)
    true_off_kg = drawn(off_kg, math.sqrt(u_kg**2 + 0.3**2 + 0.9**2), freedom)
    inside = float(np.mean((true_off_kg >= tolerance_kg[0]) & (true_off_kg <= tolerance_kg[1])))
    assert found.probability == pytest.approx(inside, abs=4 * 0.5 / math.sqrt(DRAWS))


def test_what_was_added_and_goes_along_is_drawn_by_itself_and_the_specified_mass_is_not():
    rng = np.random.default_rng(7)
    mass_kg, u_kg = 911.0, 2.5
    part_kg = (
        mass_kg + u_kg * rng.standard_normal(DRAWS)
        - (120.0 + 0.3 * rng.standard_normal(DRAWS)) - (6.0 + 0.9 * rng.standard_normal(DRAWS))
    )  # fmt: skip
    inside = float(np.mean(np.abs(part_kg - 782.0) <= 4.0))
    assert conformity_of((-4.0, 4.0), OF, mass_kg, u_kg).probability == pytest.approx(inside, abs=3e-3)


def by_draws(rule, tolerance_kg, off_kg, u_kg, freedom):
    """The word by drawn true values alone: no formula of the package, no quantile of a distribution."""
    low_kg, high_kg = tolerance_kg
    true_kg = drawn(off_kg, u_kg, freedom, seed=52)
    if rule == "simple":
        return "conforms" if low_kg <= off_kg <= high_kg else "does not conform"
    if rule == "guard band":
        # U holds the truth with 95 %: what lies beyond the limit by more than it, or within by as much, is decided
        first, last = np.quantile(true_kg, [0.025, 0.975])
        if low_kg <= first and last <= high_kg:
            return "conforms"
        return "does not conform" if last < low_kg or first > high_kg else "not shown"
    inside = float(np.mean((true_kg >= low_kg) & (true_kg <= high_kg)))
    return "conforms" if inside >= rule else "does not conform" if inside <= 1.0 - rule else "not shown"


CASES = {
    "simple, inside by a hair": ("simple", (-4.0, 4.0), 3.9, 2.0, math.inf, "conforms"),
    "simple, outside by a hair": ("simple", (-4.0, 4.0), -4.1, 2.0, math.inf, "does not conform"),
    "guard band, well inside": ("guard band", (-8.0, 8.0), 1.0, 2.0, 12.0, "conforms"),
    "guard band, undecided": ("guard band", (-4.0, 4.0), 3.9, 2.0, math.inf, "not shown"),
    "guard band, one limit, beyond": ("guard band", (-OPEN, 4.0), 11.0, 2.0, 5.0, "does not conform"),
    "guard band, one limit, undecided for Student alone": ("guard band", (-OPEN, 8.5), 4.0, 2.0, 5.0, "not shown"),
    "probability 0.9, one limit": (0.9, (-2.0, OPEN), 1.0, 2.0, math.inf, "conforms"),
    "probability 0.95, undecided": (0.95, (-4.0, 4.0), 2.0, 2.0, 9.0, "not shown"),
    "probability 0.99, outside": (0.99, (-4.0, 4.0), 12.0, 2.0, math.inf, "does not conform"),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_each_rule_gives_the_word_that_drawn_true_values_give(case):
    rule, tolerance_kg, off_kg, u_kg, freedom, word = case
    found = conformity_of(tolerance_kg, BARE, 782.0 + off_kg, u_kg, freedom, rule)
    assert found.word == by_draws(rule, tolerance_kg, off_kg, u_kg, freedom) == word


@pytest.mark.parametrize("freedom", [math.inf, 6.0])
@pytest.mark.parametrize("tolerance_kg", [(-OPEN, 4.0), (-20.0, 4.0)])
def test_a_guard_band_accepts_a_mass_on_the_limit_in_one_case_of_forty(freedom, tolerance_kg):
    measured = 782.0 + drawn(4.0, 2.0, freedom, seed=9)[:4000]
    words = [conformity_of(tolerance_kg, BARE, one, 2.0, freedom, "guard band").word for one in measured]
    assert words.count("conforms") / 4000 == pytest.approx(0.025, abs=0.008)
    assert words.count("does not conform") / 4000 == pytest.approx(0.025, abs=0.008)


def test_a_result_that_is_not_valid_never_states_conformity():
    for rule in ("simple", "guard band", 0.9, None):
        issued = Issue(tolerance_kg=(-4.0, 4.0), decision_rule=rule)
        assert stated_conformity(issued, BARE, 782.0, 0.1, valid=True)["word"] == "conforms"
        found = stated_conformity(issued, BARE, 782.0, 0.1, valid=False)
        assert (found["word"], found["probability"], found["conforms"]) == ("not stated", None, None)
        assert found["rule"] == (rule or 0.95)


def test_without_tolerance_specification_or_number_none_is_stated():
    assert conformity_of(None, BARE, 782.0, 1.0) is None
    assert conformity_of((-4.0, 4.0), None, 782.0, 1.0) is None
    assert conformity_of((-4.0, 4.0), BARE, math.nan, 1.0) is None
    assert stated_conformity(Issue(), BARE, 782.0, 1.0, valid=True)["word"] == "not stated"
    assert conformity_of((-4.0, 4.0), BARE, 782.0, 0.0).word == "not stated"


def test_the_guard_band_is_as_wide_as_the_expanded_uncertainty_that_is_reported():
    assert conformity_of((-4.0, 4.0), BARE, 782.0, 2.0, 9.0, "guard band", 3.9).guard_band_kg == pytest.approx(3.9)
    assert conformity_of((-4.0, 4.0), BARE, 782.0, 2.0, 9.0, "guard band", 3.9).word == "conforms"
    assert conformity_of((-4.0, 4.0), BARE, 782.0, 2.0, 9.0, "guard band").word == "not shown"
    added = conformity_of((-4.0, 4.0), OF, OF.mass_kg, 2.0, 9.0, "guard band", 3.9)
    assert added.guard_band_kg == pytest.approx(3.9 * math.sqrt(2.0**2 + 0.3**2 + 0.9**2) / 2.0)


def test_the_limits_of_a_document_have_no_number_for_an_open_side():
    found = conformity_of((-4.0, 4.0), BARE, 782.5, 1.0)
    assert found.to_json()["limits_kg"] == [778.0, 786.0]
    assert conformity_of((-OPEN, 4.0), BARE, 782.5, 1.0, rule="guard band").to_json()["guard_band_kg"] == pytest.approx(
        1.96, abs=1e-3
    )
