"""A recorder that skews its channels: the skew is measured, and taken out of the equation of motion."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_identification.rows.causes import SKEW
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.alignment.channel_skew import Skew, measure_skew
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import VirtualShot, identified, virtual_shot

LATE = {"skew_s": "{ acc_recoil = 5e-4 }"}


def net_force_and_acceleration(virtual: VirtualShot) -> tuple[np.ndarray, np.ndarray, float]:
    mechanism = virtual.rig.mechanism

    def of(role: str) -> np.ndarray:
        channel = virtual.shot.by_role(role)
        assert channel is not None
        return np.asarray(channel.samples, dtype=np.float64)

    net = mechanism.bore_area * of("breech_pressure") - mechanism.brake_area * of("brake_pressure")
    net = net - mechanism.recuperator_area * of("recuperator_pressure")
    acceleration = virtual.shot.by_role("recoil_acceleration")
    assert acceleration is not None
    return net, of("recoil_acceleration"), acceleration.time_base.rate_hz


@pytest.mark.whole_way
@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize("skew_s", [0.0, 1e-4])
def test_the_accelerometer_is_as_much_later_than_the_net_force_as_the_recorder_made_it(seed, skew_s):
    settings = {"skew_s": f"{{ acc_recoil = {skew_s} }}"} if skew_s else {}
    net, acceleration, rate_hz = net_force_and_acceleration(virtual_shot(seed=seed, **settings))
    found = measure_skew(net, acceleration, rate_hz, 300.0)
    assert isinstance(found, Skew), found
    assert abs(found.skew_s - skew_s) < found.u_s < 2e-5
    assert found.significant == (skew_s > 0)


@pytest.mark.whole_way
def test_a_skew_is_taken_out_together_with_the_clock_that_was_aligned_by_the_late_channel():
    sound, skewed = (identified("mixed", 3, **settings) for settings in ({}, LATE))
    assert sound.route.skew.corrected_s == 0.0
    # what the correction leaves, in at most so many steps, the inference finds
    rest = skewed.route.calibration.inferred
    assert skewed.route.skew.corrected_s + rest.value(SKEW) == pytest.approx(5e-4, abs=5 * rest.u(SKEW))
    assert skewed.chosen.estimate.mass_kg == pytest.approx(sound.chosen.estimate.mass_kg, rel=4e-4)
    assert skewed.valid
    (row,) = [row for row in skewed.chosen.estimate.budget if row.source == SKEW]
    assert 0.0 < row.u_kg < 0.1


@pytest.mark.whole_way
def test_the_camera_beside_the_others_is_without_the_skew_that_its_clock_was_aligned_with():
    virtual = virtual_shot("mixed", 3, **LATE)
    compared = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(compare=True))
    alone, sound = compared.results["camera"].estimate, identified("mixed", 3).chosen.estimate
    assert abs(alone.mass_kg - sound.mass_kg) < alone.u_kg
    assert not [note for note in compared.notes if "by the camera alone" in note]


@pytest.mark.whole_way
def test_a_cutoff_of_ones_own_that_is_high_leaves_the_skew_to_be_told():
    virtual = virtual_shot("field-2013", 3, sample_rate_hz=5e3)
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(cutoff_hz=0.35 * 5e3))
    assert np.isfinite(found.route.skew.skew_s)
    assert abs(found.route.skew.skew_s) < 1e-4  # half a sample
