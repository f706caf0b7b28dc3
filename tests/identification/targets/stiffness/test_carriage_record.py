"""The channels as one narrow-band table, and the supports that come from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.shot.preparation import prepare
from recoil_identification.targets.stiffness.carriage_record import MOTION_ROLES, carriage_record, with_response
from recoil_identification.targets.stiffness.supports import PARAMETERS, Assumptions, supports_of
from recoil_processing.filters.analog_filter import AnalogLowPass
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import virtual_shot, without_channels

STEP = 2e-4
TIMES = np.arange(2000) * STEP


@pytest.fixture(scope="module")
def field():
    virtual = virtual_shot("field-2013")
    prepared = prepare(FiredShot(virtual.shot, virtual.rig))
    return prepared, virtual.rig, carriage_record(prepared, virtual.rig)


def test_a_wide_channel_gets_the_amplitude_of_the_narrow_one_without_delay():
    narrow = AnalogLowPass(250.0, "bessel", 4)
    inside = slice(400, 1600)
    for hertz in (20.0, 100.0, 300.0):
        tone = np.cos(2 * np.pi * hertz * TIMES)
        changed = with_response(tone, STEP, narrow, None)
        gain = float(narrow.gain(np.array([hertz]))[0])
        assert np.abs(changed[inside] - gain * tone[inside]).max() < 0.01


def test_a_channel_with_a_filter_of_its_own_gets_only_what_is_missing():
    narrow, own = AnalogLowPass(250.0, "bessel", 4), AnalogLowPass(800.0, "bessel", 4)
    tone = np.cos(2 * np.pi * 150.0 * TIMES)

    changed = with_response(tone, STEP, narrow, own)

    at = np.array([150.0])
    ratio = float((narrow.gain(at) / own.gain(at))[0])
    assert np.abs(changed[400:1600] - ratio * tone[400:1600]).max() < 0.01


def test_a_ramp_passes_as_it_is():
    ramp = 3.0 + 2.0 * TIMES
    assert np.allclose(with_response(ramp, STEP, AnalogLowPass(250.0, "bessel", 4), None)[100:-100], ramp[100:-100])


def test_the_record_covers_the_shot_alike_for_all_channels(field):
    _, _, record = field
    assert record.times_s[0] < record.interval_s[0]
    assert record.times_s[-1] > record.interval_s[1]
    assert 1.0 / record.step_s >= 4999.0
    assert record.narrowest is None
    assert {column.shape for column in record.channels.values()} == {record.times_s.shape}


def test_the_mixed_rig_gives_all_channels_the_gyros_band():
    virtual = virtual_shot("mixed")
    record = carriage_record(prepare(FiredShot(virtual.shot, virtual.rig)), virtual.rig)
    assert record.narrowest == AnalogLowPass(250.0, "bessel", 4)


@pytest.mark.parametrize("role", MOTION_ROLES)
def test_a_missing_channel_is_named(role):
    virtual = virtual_shot("field-2013")
    channel = virtual.shot.by_role(role)
    prepared = prepare(FiredShot(without_channels(virtual.shot, channel.name), virtual.rig))

    with pytest.raises(IdentificationError, match=role):
        carriage_record(prepared, virtual.rig)


def test_slides_hold_the_part_back_as_the_rig_states(field):
    _, rig, record = field
    plain = record.motion(replace(rig.mechanism, slide_friction=0.0)).acceleration_m_s2
    held = record.motion(replace(rig.mechanism, slide_friction=60.0)).acceleration_m_s2
    recoils = record.times_s <= record.interval_s[1]
    slower = 60.0 * record.velocity_m_s[recoils] / rig.mechanism.m3
    np.testing.assert_allclose((plain - held)[recoils], slower, atol=1e-9)
    assert slower.max() > 0.1


def test_accelerometers_at_two_places_are_refused(field):
    prepared, rig, _ = field

    def moved(spec):
        if spec.role != "carriage_acceleration_y":
            return spec
        sensor = spec.sensor.model_copy(update={"position": (1.0, 0.0)})
        return spec.model_copy(update={"sensor": sensor})

    elsewhere: Rig = replace(rig, channels=tuple(moved(spec) for spec in rig.channels))
    with pytest.raises(IdentificationError, match="different places"):
        carriage_record(prepared, elsewhere)


def test_variants_change_what_they_say_and_nothing_else(field):
    _, _, record = field
    role = "carriage_acceleration_y"
    samples = record.channels[role]

    scaled, added, later = record.scaled(role, 1.01), record.added(role, 0.5), record.later((role,), 10 * record.step_s)

    assert scaled.channels[role] - samples[0] == pytest.approx(1.01 * (samples - samples[0]))
    assert added.channels[role] == pytest.approx(samples + 0.5)
    assert later.channels[role][10:] == pytest.approx(samples[:-10])
    assert all(one.channels["tipping_rate"] is record.channels["tipping_rate"] for one in (scaled, added, later))


def test_the_front_foot_lifts_off_and_the_rear_one_does_not(field):
    _, rig, record = field
    supports = supports_of(record, rig.mechanism)

    assert set(supports) == set(PARAMETERS)
    inside = (record.times_s > record.interval_s[0]) & (record.times_s < record.interval_s[0] + 0.1)
    off = record.step_s * np.sum(supports["ground_d"].contact[inside] == 0)
    assert 0.015 < off < 0.04
    assert supports["ground_c"].contact[inside].all()
    strict = supports_of(record, rig.mechanism, Assumptions(contact_share=0.2))
    assert strict["ground_d"].contact.sum() < supports["ground_d"].contact.sum()


def test_before_the_shot_no_support_is_loaded_beyond_rest(field):
    _, rig, record = field
    before = record.times_s < record.interval_s[0] - 5e-3
    for support in supports_of(record, rig.mechanism).values():
        assert abs(support.load[before].mean()) < 0.02 * np.abs(support.load).max()
