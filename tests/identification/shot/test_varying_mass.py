"""A part of the recoiling mass that lets go in the shot: the trace follows within a window, and the report says so."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_identification.shot.identified import Identification
from tests.builders.virtual_shots import identified, virtual_shot

RELEASED = {"released_mass_kg": 60.0, "release_after_s": 0.03}


@pytest.fixture(scope="module", params=["field-2013", "mixed"])
def case(request) -> tuple[Identification, float, float, float]:
    truth = virtual_shot(request.param, 3, **RELEASED).truth
    return identified(request.param, 3, **RELEASED), truth["m3"], truth["m3_after"], truth["t_release"]


@pytest.mark.whole_way
def test_the_trace_has_the_old_mass_before_and_the_new_one_from_a_window_after_on(case):
    found, before, after, instant_s = case
    trace = found.chosen.trace
    old = trace.identified & (trace.times_s < instant_s - 0.002)
    new = trace.identified & (trace.times_s > instant_s + trace.window_s + 0.002)
    assert old.any()
    assert new.any()
    assert np.median(np.abs(trace.mass_kg[old] - before) / trace.u_kg[old]) < 2.0
    assert np.median(np.abs(trace.mass_kg[new] - after) / trace.u_kg[new]) < 2.0
    # 2.5 % of the step here, and u is 5.5 kg at most: a window that still holds the old mass would be off by far more
    assert abs(np.median(trace.mass_kg[new]) - after) < 0.08 * abs(before - after)
    assert np.median(trace.u_kg[new]) < 8.0


def test_the_report_is_not_valid_as_one_number_and_says_when_the_mass_changed(case):
    found, before, after, instant_s = case
    assert not found.valid
    assert any("friction or the breech chain changes in the shot" in reason for reason in found.reasons), found.reasons
    assert found.constancy is not None
    said = found.constancy
    assert said.kind == "step"
    assert said.instant_s == pytest.approx(instant_s, abs=0.01)
    assert said.change_kg == pytest.approx(after - before, abs=3 * said.u_change_kg)
    assert said.before_kg == pytest.approx(before, abs=3 * said.u_before_kg)
    assert said.after_kg == pytest.approx(after, abs=3 * said.u_after_kg)


def test_the_mass_is_blamed_and_no_sensor(case):
    found, *_ = case
    assert any(reason.startswith("Mass, friction or the breech chain changes in the shot") for reason in found.reasons)
    assert not any("contradicts the other sensors" in reason for reason in found.reasons)


def test_the_mass_over_time_holds_the_old_mass_and_the_new_one(case):
    found, before, after, instant_s = case
    walk = found.walk
    true = np.where(walk.times_s < instant_s, before, after)
    far = np.abs(walk.times_s - instant_s) > 0.02
    assert np.mean(np.abs(walk.mass_kg - true)[far] < 2 * walk.u_kg[far]) > 0.9


def test_shots_of_a_constant_mass_are_not_accused():
    for name in ("field-2013", "mixed"):
        assert identified(name).constancy is not None
        assert identified(name).constancy.constant
