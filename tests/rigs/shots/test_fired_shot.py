"""A shot with its rig: each channel with its sensor, its source and its clock's alignment."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import virtual_shot


def fired(name: str = "mixed") -> FiredShot:
    virtual = virtual_shot(name)
    return FiredShot(virtual.shot, virtual.rig)


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_every_channel_is_put_together_with_what_the_rig_states_of_it(name: str) -> None:
    both = fired(name)
    assert set(both.channels) == set(both.shot.channels)
    for key, one in both.channels.items():
        assert one.recorded is both.shot.channels[key]
        assert one.spec is both.rig.channel(key)
        assert one.source is both.rig.source(one.spec.source)
        assert one.alignment == both.shot.alignment(one.recorded.time_base.clock)


def test_roles_hold_all_gauges_of_a_pressure_and_no_role_that_nothing_recorded() -> None:
    both = fired()
    for role, found in both.roles.items():
        assert [one.recorded for one in found] == list(both.shot.with_role(role))
        assert both.channel(role) is found[0]
    assert "" not in both.roles
    assert both.channel("driving_force") is None


def test_a_channel_that_the_rig_does_not_name_any_more_is_left_out() -> None:
    both = fired()
    less = FiredShot(both.shot, both.rig.without_channel("p_brake"))
    assert set(both.channels) - set(less.channels) == {"p_brake"}


def test_a_channel_is_left_out_as_if_it_had_never_been_or_is_missed() -> None:
    both = fired()
    gone, missed = both.without("p_brake"), both.unrecorded("p_brake")
    assert gone.rig.by_role("brake_pressure") is None
    assert missed.rig.by_role("brake_pressure") is not None
    assert "brake_pressure" not in gone.roles
    assert "brake_pressure" not in missed.roles
    assert set(both.channels) - set(missed.channels) == {"p_brake"}


def test_another_alignment_takes_the_place_of_that_clocks_own() -> None:
    both = fired()
    clock = replace(both.alignments["camera"], offset_s=1.5, status="failed")
    moved = both.aligned_by(clock)
    assert moved.alignments["camera"] == clock
    assert {k: v for k, v in moved.alignments.items() if k != "camera"} == {
        k: v for k, v in both.alignments.items() if k != "camera"
    }
    camera = moved.channel("recoil_displacement")
    assert camera is not None
    assert camera.alignment == clock


def test_the_reference_clock_is_its_own_and_an_unaligned_clock_has_none() -> None:
    both = fired()
    reference = both.alignments[both.shot.reference_clock]
    assert (reference.offset_s, reference.drift, reference.method) == (0.0, 0.0, "reference")
    before = FiredShot(replace(both.shot, alignments=()), both.rig)
    camera = before.channel("recoil_displacement")
    assert camera is not None
    assert camera.alignment is None
