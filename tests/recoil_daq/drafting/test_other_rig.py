"""What another rig file states of a stand, finished or not."""

from __future__ import annotations

from pathlib import Path

import pytest

from recoil_daq.drafting.other_rig import OtherRig


def rig(*channels: dict) -> OtherRig:
    tables = {"channel": list(channels)}
    return OtherRig(Path("old.toml"), tables, tables)


@pytest.mark.parametrize(("more", "left_out"), [({"role": "recoil_acceleration"}, True), ({}, False)])
def test_only_of_a_channel_with_a_role_the_sensor_was_asked_for(more: dict, left_out: bool) -> None:
    other = rig({"name": "a", "source": "daq", "signal": "AI 1", "sensor": {"serial": "7"}, **more})
    assert other.leaves_out("daq", "AI 1", "position") is left_out
    assert not other.leaves_out("daq", "AI 1", "serial")
    assert not other.leaves_out("daq", "AI 2", "position")


def test_answers_stand_before_what_was_stated() -> None:
    other = rig({"name": "a", "source": "daq", "signal": "AI 1", "unit": "V", "sensor": {"serial": "7", "u_rel": 0.01}})
    answers = {
        "mechanism": {"m3": 1.0},
        "channel": [
            {"name": "a", "source": "daq", "signal": "AI 1", "sensor": {"u_rel": 0.02}},
            {"name": "b", "source": "daq", "signal": "AI 2", "unit": "g"},
        ],
    }
    answered = other.with_answers(answers)
    assert answered.channel_of("daq", "AI 1") == {
        "name": "a", "source": "daq", "signal": "AI 1", "unit": "V", "sensor": {"serial": "7", "u_rel": 0.02},
    }  # fmt: skip
    assert answered.channel_of("daq", "AI 2")["unit"] == "g"
    assert answered.reason == "as answered, or as in old.toml"
    # what was answered since is no sign that the file takes the rest for granted
    assert not answered.takes_as_exact("m3")
