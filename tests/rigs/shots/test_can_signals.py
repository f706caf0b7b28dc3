"""Signals that a rig names must be in its CAN database."""

from __future__ import annotations

import pytest

from recoil_acquisition.errors import RigError
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.shots.can_signals import faults_of_can_signals, shared_names
from recoil_rigs.shots.live_sources import live_sources

FAULTY = """VERSION ""

BO_ 257 RecoilNode: 8 Node
 SG_ p_brake : 0|16@1+ (0.001,0) [0|0] "MPa" Node
 SG_ p_recuperator : 8|16@1+ (0.001,0) [0|0] "MPa" Node
 SG_ acc_recoil : 32|16@1- (0.2,0) [0|0] "m/s2" Node
BO_ 258 Other: 8 Node
 SG_ p_brake : 0|16@1+ (0.001,0) [0|0] "MPa" Node
"""


def rig_of(text: str, database: str | None = None) -> Rig:
    rig = load_rig("mixed")
    return parse_rig(text, rig.path, rig.databases if database is None else {"mixed.dbc": database})


def test_the_bundled_rigs_signals_are_in_its_database() -> None:
    rig = load_rig("mixed")
    assert [fault for source in rig.sources for fault in faults_of_can_signals(rig, source)] == []


def test_an_unknown_signal_is_named_with_the_nearest_names() -> None:
    rig = rig_of(load_rig("mixed").text.replace("RecoilNode.p_brake", "RecoilNode.pbrake"))
    (fault,) = faults_of_can_signals(rig, rig.source("can"))
    assert fault.key == "channel 'p_brake'.signal"
    assert fault.problem.startswith("mixed.dbc has no signal 'RecoilNode.pbrake'; nearest: 'RecoilNode.p_brake', ")


def test_a_signal_of_a_faulty_message_is_named_with_what_is_wrong() -> None:
    rig = rig_of(load_rig("mixed").text, FAULTY)
    faults = faults_of_can_signals(rig, rig.source("can"))
    assert "channel 'p_brake'.signal" in [fault.key for fault in faults]
    assert "the message 'RecoilNode' of the CAN database is faulty" in faults[0].problem


def test_a_rig_with_an_unknown_signal_is_not_armed() -> None:
    rig = rig_of(load_rig("mixed").text.replace("RecoilNode.p_brake", "RecoilNode.pbrake"))
    with pytest.raises(RigError, match=r"mixed\.dbc has no signal 'RecoilNode\.pbrake'"):
        live_sources(rig)


TWICE = FAULTY.replace("8|16@1+", "16|16@1+").replace("BO_ 258 Other", "BO_ 258 RecoilNode")


def test_a_signal_of_several_messages_of_one_name_is_not_armed() -> None:
    text = load_rig("mixed").text.replace('counters = ["RecoilNode.counter"]', "")
    (fault,) = faults_of_can_signals(rig_of(text, TWICE), rig_of(text, TWICE).source("can"))
    assert fault.key == "channel 'p_brake'.signal"
    assert "write 'RecoilNode#0x101.p_brake' or 'RecoilNode#0x102.p_brake'" in fault.problem
    chosen = rig_of(text.replace('"RecoilNode.p_brake"', '"RecoilNode#0x102.p_brake"'), TWICE)
    assert faults_of_can_signals(chosen, chosen.source("can")) == []
    assert [source.name for source in live_sources(chosen, {"can": {"interface": "virtual"}, "imu": {}})][:1] == ["can"]
    # a file says which of them came
    without = rig_of(text.replace('device = { virtual = "virtual" }', ""), TWICE)
    assert faults_of_can_signals(without, without.source("can")) == []
    assert [fault.key for fault in shared_names(without, without.source("can"))] == ["channel 'p_brake'.signal"]
    assert "write 'RecoilNode#0x101.p_brake' or" in shared_names(without, without.source("can"))[0].problem
    bundled = load_rig("mixed")
    assert shared_names(bundled, bundled.source("can")) == []
