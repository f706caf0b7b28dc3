"""The commands of a virtual recorder: states, replies and the queue of errors."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from recoil_rigs.twin.oxygen_scpi import OxygenScpi, ScpiChannel

PROPERTIES = {"SampleRate": '(SCALAR,200000.0,"Hz")', "Used": '(STRING,"ON")'}


@dataclass
class Calls:
    """What the commands did to the stream."""

    made: list[str] = field(default_factory=list)
    opens: bool = True

    def listen(self, port: int) -> bool:
        self.made.append(f"listen {port}")
        return self.opens

    def begin(self) -> None:
        self.made.append("begin")

    def end(self) -> None:
        self.made.append("end")

    def shut(self) -> None:
        self.made.append("shut")


@pytest.fixture
def calls() -> Calls:
    return Calls()


@pytest.fixture
def scpi(calls: Calls) -> OxygenScpi:
    channels = [ScpiChannel("1", "AI 1/p (brl), muzzle", PROPERTIES), ScpiChannel("2", "AI 2/a", PROPERTIES)]
    one = OxygenScpi(channels, calls)
    one.answer(":COMM:HEAD OFF")
    return one


def all_of(scpi: OxygenScpi, *lines: str) -> list[str | None]:
    return [scpi.answer(line) for line in lines]


def test_a_stream_goes_from_invalid_to_running_and_back(scpi: OxygenScpi, calls: Calls) -> None:
    state = ":DST:STAT1?"
    assert all_of(scpi, state, ":DST:PORT1 10003", state) == ["INVALID", None, "CONFIG"]
    assert all_of(scpi, ':DST:ITEM1 "AI 2/a","AI 1/p (brl), muzzle"', ":DST:ITEM1?") == [
        None, '"AI 2/a","AI 1/p (brl), muzzle"'
    ]  # fmt: skip
    assert all_of(scpi, ":DST:INIT 1", state, ":DST:START 1", state) == [None, "INITIALIZED", None, "RUNNING"]
    assert all_of(scpi, ":DST:STOP ALL", state, ":DST:START 1", state) == [None, "INITIALIZED", None, "RUNNING"]
    assert all_of(scpi, ':DST:ITEM1 "AI 2/a"', state, ":DST:RESET", state) == [None, "CONFIG", None, "INVALID"]
    assert calls.made == ["listen 10003", "begin", "end", "begin", "shut"]
    assert scpi.answer(":SYST:ERR:ALL?") == '0,"No error"'


def test_replies_repeat_their_heads_until_they_are_switched_off(scpi: OxygenScpi) -> None:
    scpi.answer(":COMM:HEAD ON")
    assert all_of(scpi, ":DST:STAT1?", ":ACQU:STAT?", ":DST:ITEM1?", "*VER?") == [
        ":DST:STAT INVALID", ":ACQU:STAT Started", ":DST:ITEM1 NONE",
        'SCPI,"1999.0",RC_SCPI,"1.21",OXYGEN,"7.1.0"',
    ]  # fmt: skip


def test_channels_and_their_properties_are_told(scpi: OxygenScpi) -> None:
    assert scpi.answer(":CHANNEL:NAMES?") == '("1","AI 1/p (brl), muzzle"),("2","AI 2/a")'
    assert scpi.answer(':CHANNEL:PROP? "2","SampleRate"') == '(SCALAR,200000.0,"Hz")'
    assert scpi.answer(':CHANNEL:PROP? "2","LP_Filter_Freq"') == "NONE"
    assert scpi.answer(":CHANNEL:ITEM2:ATTR:NAMES?") == '"SampleRate","Used"'


def test_a_quote_in_a_name_is_doubled_both_ways(calls: Calls) -> None:
    scpi = OxygenScpi([ScpiChannel("1", 'AI "1"', PROPERTIES)], calls, heads=False)
    assert scpi.answer(":CHANNEL:NAMES?") == '("1","AI ""1""")'
    assert all_of(scpi, ':DST:ITEM1 "AI ""1"""', ":DST:ITEM1?", ":SYST:ERR:COUNT?") == [None, '"AI ""1"""', "0"]
    assert scpi.items == ('AI "1"',)


def test_what_is_wrong_has_no_reply_and_stands_in_the_queue(scpi: OxygenScpi, calls: Calls) -> None:
    calls.opens = False
    wrong = [
        ":DST:START 1", ":DST:PORT1 70000", ':DST:ITEM1 "AI 2/a","AI 9/b"', ":DST:INIT 1", ":NUM:VAL?",
        ':CHANNEL:PROP? "7","Unit"',
    ]  # fmt: skip
    assert all_of(scpi, *wrong) == [None] * len(wrong)
    # one channel that is not there discards the whole list
    assert scpi.answer(":DST:ITEM1?") == "NONE"
    assert scpi.answer(":SYST:ERR:COUNT?") == "6"
    assert scpi.answer(":SYST:ERR?") == '-221,"Settings conflict"'
    assert scpi.answer(":SYST:ERR:ALL?") == (
        '-108,"Parameter not allowed",-108,"Parameter not allowed",-221,"Settings conflict",-113,"Undefined header",'
        '-108,"Parameter not allowed"'
    )
    all_of(scpi, ":DST:PORT1 10003", ':DST:ITEM1 "AI 2/a"', ":DST:INIT 1")
    assert scpi.answer(":DST:STAT1?") == "ERROR"
    assert all_of(scpi, "*CLS", ":SYST:ERR?") == [None, '0,"No error"']


def test_recording_and_acquisition_have_states_of_their_own(scpi: OxygenScpi) -> None:
    assert all_of(scpi, ':STOR:FILE:NAME "0007"', ":STOR:FILE:NAME?", ":STOR:START", ":STOR:STAT?") == [
        None, '"0007"', None, "Started"
    ]  # fmt: skip
    assert all_of(scpi, ":STOR:STOP", ":STOR:STAT?", ":ACQU:STOP", ":ACQU:STAT?") == [None, "Stopped", None, "Stopped"]
    all_of(scpi, ':MARK:ADD "trigger",1.5', ':HEAD:SET "shot","0007"')
    assert (scpi.markers, scpi.headers) == (['"trigger",1.5'], ['"shot","0007"'])
