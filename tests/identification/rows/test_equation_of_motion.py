"""The rows of the motion against the equation written out, and their derivatives against its differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_identification.rows.equation_of_motion import ACCELERATION, CAMERA, EquationOfMotion, change, ramps, shift
from tests.builders.written_out_motion import acceleration_m_s2, drawn_motion, drawn_values

FEW = st.integers(0, 2)


@st.composite
def motions(draw: st.DrawFn) -> tuple[EquationOfMotion, dict[str, float]]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    block = drawn_motion(rng, draw(FEW), draw(FEW), draw(FEW), draw(st.sampled_from([ACCELERATION, CAMERA])))
    return block, drawn_values(rng, block.unknowns)


@given(motions())
def test_a_row_is_what_the_equation_leaves_of_the_acceleration_in_standard_deviations(drawn):
    block, values = drawn
    left, _ = block.linearised(values)
    for row, at in enumerate(block.rows):
        read = float(block.regression.acceleration_m_s2[at])
        expected = (read - acceleration_m_s2(block, values, at)) / block.sigma_m_s2[row]
        assert left[row] == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(motions())
def test_a_derivative_is_what_a_small_step_of_its_unknown_does_to_the_equation(drawn):
    block, values = drawn
    _, derivatives = block.linearised(values)
    assert derivatives.shape == (block.rows.size, len(block.unknowns))
    for column, name in enumerate(block.unknowns):
        step = 1.0 if name.startswith("friction") else 1e-4
        for row, at in enumerate(block.rows):
            up, down = (acceleration_m_s2(block, values | {name: values[name] + by}, at) for by in (step, -step))
            expected = (up - down) / (2 * step) / block.sigma_m_s2[row]
            assert derivatives[row, column] == pytest.approx(expected, rel=1e-5, abs=1e-5), name


@given(motions())
def test_every_error_that_a_row_hangs_on_is_an_unknown_of_its_own(drawn):
    block, _ = drawn
    shifts = 0 if block.regression.shifts is None else block.regression.shifts.shape[1]
    changes = 0 if block.changes is None else block.changes.shape[1]
    names = [unknown.name for unknown in block.all_unknowns]
    assert len(set(names)) == len(names) == 8 + shifts + len(block.causes) + changes
    assert block.unknowns == tuple(names)


def test_an_unknown_that_is_counted_says_which_it_is_and_in_which_unit():
    assert [(shift(i).name, shift(i).unit) for i in (0, 1)] == [
        ("shift 1 of the zero", "m/s^2"),
        ("shift 2 of the zero", "m/s^2"),
    ]
    assert [(change(i).name, change(i).unit) for i in (0, 1)] == [
        ("change 1 of ln mass", "1"),
        ("change 2 of ln mass", "1"),
    ]


def test_one_iteration_moves_no_scale_by_more_than_a_linear_model_of_it_holds_for():
    block = drawn_motion(np.random.default_rng(1), 1, 1, 1)
    for unknown in block.all_unknowns:
        if unknown.name.startswith("ln ") or unknown.name.endswith("ln mass"):
            # in halves of a second order term: 0.3^2 / 2 is a twentieth of one
            assert unknown.largest_step**2 / 2 < 0.05
        else:
            assert unknown.largest_step == math.inf


@given(st.integers(1, 6), st.floats(-1.0, 1.0), st.floats(0.1, 2.0))
def test_ramps_follow_one_another_and_are_a_line_over_the_whole_interval_together(count, start_s, length_s):
    times_s = np.linspace(start_s - 0.1, start_s + length_s + 0.1, 200)
    found = ramps(times_s, (start_s, start_s + length_s), count)
    assert found.shape == (times_s.size, count)
    assert found.min() == 0
    assert found.max() == 1
    line = count * np.clip((times_s - start_s) / length_s, 0.0, 1.0)
    np.testing.assert_allclose(found.sum(axis=1), line, atol=1e-9)
    # none rises before the one before it has risen
    assert np.all((found[:, :-1] > 1 - 1e-9) | (found[:, 1:] < 1e-9))
