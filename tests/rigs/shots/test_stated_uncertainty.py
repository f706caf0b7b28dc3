"""What certificates state of what all shots share, and the rig as if they stated other."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recoil_acquisition.errors import RigError
from recoil_rigs.rig import load_rig
from recoil_rigs.shots.stated_uncertainty import stated_uncertainties, with_uncertainties
from tests.builders.virtual_shots import with_twin


def test_what_a_rig_states_is_listed_by_key_and_can_be_stated_anew() -> None:
    rig = load_rig("field-2013")
    stated = stated_uncertainties(rig)
    assert stated == {
        "acc_recoil.u_rel": 0.005, "p_breech.u_rel": 0.005, "p_brake.u_rel": 0.004, "p_recuperator.u_rel": 0.004,
        "x_camera.u_rel": 0.001, "u_friction": 150.0, "u_bore_area": 0.0, "u_brake_area": 0.0,
        "u_recuperator_area": 0.0, "u_bore_friction": 0.006, "u_unread_share": 0.01, "u_slide_friction": 0.0,
        "u_carried_mass": 0.0, "unread_force": 0.002,
    }  # fmt: skip
    other = {key: 0.5 * u or 1e-6 for key, u in stated.items()}
    assert stated_uncertainties(with_uncertainties(rig, other)) == other
    assert stated_uncertainties(rig) == stated
    assert replace(with_uncertainties(rig, {}), channels=rig.channels) == rig


def test_the_part_of_a_standard_shrinks_with_the_whole_and_does_not_grow() -> None:
    rig = with_twin("field-2013", u_standard_rel=0.003)
    halved = with_uncertainties(rig, {"p_breech.u_rel": 0.0025}).channel("p_breech").sensor
    assert halved.u_reference_rel == pytest.approx(0.0015)
    doubled = with_uncertainties(rig, {"p_breech.u_rel": 0.01}).channel("p_breech").sensor
    assert doubled.u_reference_rel == pytest.approx(0.003)


def test_every_key_that_is_none_and_every_number_that_is_no_uncertainty_is_named_at_once() -> None:
    stated = {
        "p_brech.u_rel": 0.002, "acc_carriage_x.u_rel": 0.01, "u_frction": 3.0, "u_friction": -1.0,
        "p_brake.u_rel": 2.0, "u_bore_area": 0.5, "u_bore_friction": 0.6, "acc_recoil.u_rel": float("nan"),
    }  # fmt: skip
    with pytest.raises(RigError) as raised:
        with_uncertainties(load_rig("field-2013"), stated)
    told = {fault.key: fault.problem for fault in raised.value.faults}
    assert list(told) == list(stated)
    assert "did you mean 'p_breech.u_rel'?" in told["p_brech.u_rel"]
    assert "did you mean 'u_friction'?" in told["u_frction"]
    assert "0.002 is 0.2 %" in told["p_brake.u_rel"]
    assert "half of bore_area = 0.00883" in told["u_bore_area"]
