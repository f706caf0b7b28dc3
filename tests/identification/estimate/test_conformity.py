"""The probability of conformity against a Monte Carlo method, and against what must hold of any probability."""

from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_identification.estimate.conformity import conformity_of
from recoil_rigs.tables.specification import Specification

DRAWS = 400_000
OF = Specification(782.0, u_m3_kg=0.5, added_kg=120.0, u_added_kg=0.3, carried_kg=6.0, u_carried_kg=0.9)


@pytest.mark.parametrize("tolerance_kg", [(-4.0, 4.0), (-1.0, 6.0), (2.0, 3.0), (-30.0, -10.0)])
@pytest.mark.parametrize(("off_kg", "u_kg"), [(0.0, 2.5), (3.1, 2.5), (-6.0, 1.0), (4.0, 0.05)])
@pytest.mark.parametrize("freedom", [math.inf, 7.0])
def test_the_probability_is_the_share_of_draws_inside(tolerance_kg, off_kg, u_kg, freedom):
    found = conformity_of(tolerance_kg, OF, OF.mass_kg + off_kg, u_kg, freedom)
    rng = np.random.default_rng(20261126)
    u_all_kg = math.sqrt(u_kg**2 + 0.3**2 + 0.9**2)
    unit = rng.standard_normal(DRAWS) if math.isinf(freedom) else rng.standard_t(freedom, DRAWS)
    true_off_kg = off_kg + u_all_kg * unit
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


def test_it_conforms_does_not_or_neither_is_shown():
    bare = Specification(782.0)
    assert conformity_of((-4.0, 4.0), bare, 782.5, 1.0).conforms is True
    assert conformity_of((-4.0, 4.0), bare, 788.0, 1.0).conforms is False
    assert conformity_of((-4.0, 4.0), bare, 786.0, 1.0).conforms is None
    assert conformity_of((-4.0, 4.0), bare, 786.0, 1.0).to_json()["limits_kg"] == [778.0, 786.0]


def test_without_tolerance_specification_or_number_there_is_none():
    bare = Specification(782.0)
    assert conformity_of(None, bare, 782.0, 1.0) is None
    assert conformity_of((-4.0, 4.0), None, 782.0, 1.0) is None
    assert conformity_of((-4.0, 4.0), bare, math.nan, 1.0) is None
