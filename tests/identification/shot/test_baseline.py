"""What sensors read before a shot is what the record holds there, taken from the samples by themselves."""

import numpy as np
import pytest

from recoil_identification.shot.baseline import Baseline
from tests.builders.virtual_shots import identified, virtual_shot


def by_channel(name: str) -> dict[str, Baseline]:
    return {one.channel: one for one in identified(name).baseline}


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_every_sensor_of_the_motion_and_the_forces_has_a_baseline(name):
    virtual, found = virtual_shot(name), by_channel(name)
    roles = {"recoil_acceleration", "breech_pressure", "brake_pressure", "recuperator_pressure", "recoil_displacement"}
    assert roles <= {one.role for one in found.values()}
    for channel, one in found.items():
        assert one.sensor == (virtual.rig.channel(channel).sensor.serial or f"{virtual.rig.name}/{channel}")
        assert one.unit == virtual.shot.channels[channel].unit


def test_offset_and_noise_are_those_of_the_samples_before_the_onset():
    virtual, found, signals = (
        virtual_shot("field-2013"),
        by_channel("field-2013"),
        identified("field-2013").route.signals,
    )
    for channel in ("acc_recoil", "p_breech", "p_brake", "p_recuperator"):
        recorded, one = virtual.shot.channels[channel], found[channel]
        times_s = recorded.time_base.times_s
        silent = np.asarray(recorded.samples)[(times_s >= signals.baseline_s[0]) & (times_s < signals.baseline_s[1])]
        at_rest = virtual.rig.mechanism.at_rest.get(recorded.role)
        assert one.at_rest == at_rest
        scatter = float(np.std(silent))
        assert one.offset == pytest.approx(np.mean(silent) - (at_rest or 0.0), abs=scatter / 10)
        assert one.noise == pytest.approx(scatter, rel=1e-3)


def test_where_it_is_not_known_what_a_gauge_should_read_it_is_the_reading():
    gauge = by_channel("field-2013")["p_recuperator"]
    assert gauge.at_rest is None
    # in battery it is under pressure
    assert gauge.offset > 1e5
