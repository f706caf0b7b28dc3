"""Base parameters: what the columns of a regressor tell, and what they do not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.targets.parameters.base_parameters import identifiable_part, structural_base
from recoil_identification.targets.parameters.mechanism_fit import PREFERRED, natural_scales, structural_parameters
from recoil_identification.targets.parameters.tables import expressions
from recoil_rigs.mechanism.mechanism_regressor import PARAMETERS, Geometry, regressor
from recoil_rigs.rig import load_rig

GEOMETRY = Geometry.of(load_rig("field-2013").mechanism)
ALL = (0, 1, 2, 3, 4)


def test_the_mechanism_has_ten_base_parameters_and_they_are_the_textbook_ones():
    base = structural_parameters(GEOMETRY, ALL)
    lines = expressions(base, PARAMETERS, natural_scales(GEOMETRY, 782.0))
    assert lines == (
        "m1 + (m2)",
        "m1 X1 + 1.950 (m2)",
        "m1 Y1 + 0.9000 (m2)",
        "J1 + 4.613 (m2)",
        "m3",
        "m3 b",
        "m3 d",
        "J3A + (J2)",
        "m2 s2",
        "m2 d2",
    )


def test_singular_values_find_the_same_rank():
    q, qd, qdd = np.random.default_rng(3).normal(0.0, 1.0, (3, 60, 5))
    design = regressor(GEOMETRY, q, qd, qdd).reshape(-1, len(PARAMETERS))
    assert np.linalg.matrix_rank(design) == len(structural_base(design, PREFERRED).leading) == 10


def test_along_the_bore_only_the_recoiling_part_is_seen():
    base = structural_parameters(GEOMETRY, (4,))
    assert [PARAMETERS[j] for j in base.leading] == ["m3", "m3 b", "m3 d"]
    assert np.count_nonzero(base.combinations) == 3


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 6), st.integers(0, 4), st.integers(0, 10**6))
def test_combinations_reproduce_every_design_of_deficient_rank(rank, more, seed):
    rng = np.random.default_rng(seed)
    design = rng.normal(size=(40, rank)) @ rng.normal(size=(rank, rank + more))
    base = structural_base(design)
    assert len(base.leading) == rank
    theta = rng.normal(size=rank + more)
    np.testing.assert_allclose(
        design[:, list(base.leading)] @ (base.combinations @ theta), design @ theta, atol=1e-6 * np.abs(design).max()
    )


def test_what_a_shot_tells_is_unbiased_whatever_it_does_not_tell():
    rng = np.random.default_rng(11)
    design = rng.normal(size=(200, 3))
    design[:, 2] = 2.0 * design[:, 0] + 1e-4 * design[:, 2]
    theta = np.array([3.0, -1.0, 50.0])
    misses = []
    for _ in range(300):
        q, r = np.linalg.qr(design)
        told = identifiable_part(r, q.T @ (design @ theta + rng.normal(size=200)), np.ones(3), 1.0)
        assert len(told.values) == 2
        misses.append((told.values - told.base.combinations @ theta) / told.u)
    misses = np.array(misses)
    assert np.abs(misses.mean(axis=0)).max() < 4 / np.sqrt(300)
    np.testing.assert_allclose(misses.std(axis=0), 1.0, atol=0.15)


def test_where_nothing_is_told_there_is_no_value():
    told = identifiable_part(np.zeros((3, 3)), np.zeros(3), np.ones(3), 0.1)
    assert told.values.size == 0
    assert np.isinf(told.pivots).all()


def test_a_choice_that_does_not_name_every_column_is_refused():
    with pytest.raises(ValueError, match="each of 3 columns once"):
        structural_base(np.eye(3), [0, 1, 1])
    with pytest.raises(ValueError, match="cannot tell 3 columns"):
        structural_base(np.ones((2, 3)))
