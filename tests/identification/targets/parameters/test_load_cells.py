"""Equations of motion in which loads that nothing measures cancel."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_identification.targets.parameters.load_cells import LOAD_CELLS, lost_equations, usable_equations
from recoil_rigs.mechanism.mechanism_regressor import EQUATIONS, LOADS, Geometry, load_directions
from recoil_rigs.rig import load_rig

GEOMETRY = Geometry.of(load_rig("field-2013").mechanism)


def measured(*names: str) -> np.ndarray:
    return np.array([name in (*names, "breech", "resistance") for name in LOADS])


@pytest.mark.parametrize(
    ("names", "usable"),
    [
        (tuple(LOAD_CELLS), (0, 1, 2, 3, 4)),
        ((), (4,)),
        (("elevating",), (3, 4)),
        (("ground_x", "ground_y", "ground_d", "ground_friction"), (0, 1, 2, 4)),
        (("elevating", "ground_y", "ground_d"), (1, 3, 4)),
        (("elevating", "ground_x", "ground_d", "ground_friction"), (0, 2, 3, 4)),
    ],
)
def test_unmeasured_loads_cancel_and_cost_an_equation_each(names, usable):
    rng = np.random.default_rng(2)
    alpha, beta = rng.normal(0.0, 0.01, (2, 30))
    there = measured(*names)
    combine, found = usable_equations(GEOMETRY, alpha, beta, there)
    assert found == usable
    effect = combine @ load_directions(GEOMETRY, alpha, beta)
    np.testing.assert_allclose(effect[:, list(found)][:, :, ~there], 0.0, atol=1e-12)
    assert all(np.allclose(combine[:, i, i], 1.0) for i in found)


def test_a_friction_that_is_not_measured_is_taken_out_by_the_force_at_c():
    there = measured("elevating", "ground_x", "ground_y", "ground_d")
    _, found = usable_equations(GEOMETRY, np.zeros(1), np.zeros(1), there)
    assert len(found) == 4
    assert {1, 3, 4} <= set(found)


def test_what_is_lost_is_said_with_the_role_that_is_missing():
    assert lost_equations((0, 1, 2, 3, 4), measured(*LOAD_CELLS)) == ""
    text = lost_equations((4,), measured())
    assert all(role in text for role in LOAD_CELLS.values())
    assert all(name in text for name in EQUATIONS[:4])
