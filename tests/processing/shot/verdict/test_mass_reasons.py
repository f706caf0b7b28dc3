"""What the range says of a record the desk says of its mass, and the other way round."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.remark import ReasonCode
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.shot.verdict.mass_reasons import against_the_record
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import VirtualShot, virtual_shot


def with_sensor(virtual: VirtualShot, name: str, line: str) -> Rig:
    """Declare more of a channel's sensor."""
    head, _, tail = virtual.rig.text.partition(f'[[channel]]\nname = "{name}"')
    assert tail
    return parse_rig(head + f'[[channel]]\nname = "{name}"' + tail.replace("sensor = { ", f"sensor = {{ {line}, ", 1),
                     virtual.rig.path, virtual.rig.databases)  # fmt: skip


@pytest.mark.exhaustive
@pytest.mark.parametrize("status", ["ambiguous", "failed"])
def test_a_doubted_clock_is_the_same_reason_at_range_and_desk(status: str) -> None:
    virtual = virtual_shot()
    (good,) = virtual.shot.alignments
    shot = replace(virtual.shot, alignments=(replace(good, status=status, reasons=("two candidates",)),))
    found = identify_shot(FiredShot(shot, virtual.rig), Options())
    desk = [one for one in found.reasons if one.code is ReasonCode.CLOCK]
    assert [one.about for one in desk] == ["camera"]
    assert desk[0].startswith(f"clock camera: alignment {status}: two candidates")
    assert ("; look at both records" in desk[0]) is (status == "ambiguous")
    # one that failed is a failed check already
    assert list(against_the_record(FiredShot(shot, virtual.rig))) == (desk if status == "ambiguous" else [])


@pytest.mark.exhaustive
@pytest.mark.parametrize(("name", "line", "code"), [("p_recuperator", "time_constant_s = 5.0", ReasonCode.COUPLING)])
def test_what_the_rig_declares_against_a_mass_is_said_at_the_range(name: str, line: str, code: ReasonCode) -> None:
    virtual = virtual_shot()
    rig = with_sensor(virtual, name, line)
    (reason,) = against_the_record(FiredShot(virtual.shot, rig))
    assert (reason.code, reason.about) == (code, name)
    assert reason in identify_shot(FiredShot(virtual.shot, rig), Options()).reasons


@pytest.mark.exhaustive
def test_a_tipping_part_of_which_nothing_tells_is_said_at_the_range() -> None:
    virtual = virtual_shot()
    shot = virtual.shot.without_channel("gyro_tipping")
    (reason,) = against_the_record(FiredShot(shot, virtual.rig))
    assert (reason.code, reason.about) == (ReasonCode.ROLE, "tipping_rate")
    assert identify_shot(FiredShot(shot, virtual.rig), Options()).reasons == (reason,)


@pytest.mark.parametrize("channel", ["p_breech", "p_brake", "p_recuperator"])
def test_a_force_that_is_missing_is_said_at_the_range_where_identify_finds_no_mass(channel: str) -> None:
    virtual = virtual_shot()
    shot = virtual.shot.without_channel(channel)
    role = virtual.shot.channels[channel].role
    assert (ReasonCode.ROLE, role) in [
        (one.code, one.about) for one in against_the_record(FiredShot(shot, virtual.rig))
    ]
    with pytest.raises(IdentificationError, match=role):
        identify_shot(FiredShot(shot, virtual.rig), Options())


def test_a_motion_that_is_missing_is_said_at_the_range_where_identify_finds_no_mass() -> None:
    virtual = virtual_shot()
    shot = virtual.shot.without_channel("acc_recoil").without_channel("x_camera")
    assert "no mass without a motion" in against_the_record(FiredShot(shot, virtual.rig))[0]
    with pytest.raises(IdentificationError, match="no channel of role recoil_acceleration"):
        identify_shot(FiredShot(shot, virtual.rig), Options())


def test_a_sound_record_has_no_reason() -> None:
    for name in ("field-2013", "mixed"):
        assert against_the_record(FiredShot(virtual_shot(name).shot, virtual_shot(name).rig)) == ()
