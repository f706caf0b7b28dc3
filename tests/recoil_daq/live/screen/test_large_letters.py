"""Verdicts are read from three metres: every state of a shot has letters of five rows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recoil_daq.live.screen.large_letters import ROWS, large
from recoil_daq.live.screen.screen_shots import LARGE_S, SHOT_STYLES, newest_verdict
from recoil_daq.live.shot import ShotState
from tests.builders.range_states import SPOILT, day, usable


@pytest.mark.parametrize("state", SHOT_STYLES)
def test_every_verdict_has_letters_that_the_smallest_terminal_has_room_for(state: ShotState) -> None:
    rows = large(str(state), 59)
    assert len(rows) == ROWS
    assert {*"".join(rows)} == {"█", " "}


def test_a_word_without_room_or_letters_has_none() -> None:
    assert large("usable", 20) == ()
    assert large("0003", 80) == ()


def test_the_newest_verdict_is_shown_for_a_minute_or_until_somebody_has_seen_it() -> None:
    old, new = usable("0001", age_s=30.0), usable("0002", age_s=5.0)
    assert newest_verdict(day(shots=(old, new))) is new
    assert newest_verdict(day(shots=(usable("0001", age_s=LARGE_S + 1.0),))) is None
    assert newest_verdict(day(shots=(usable("0001", age_s=5.0, seen=True),))) is None
    assert newest_verdict(day(shots=(usable("0001", age_s=None),))) is None
    assert newest_verdict(day(shots=(SPOILT,), state="recording")) is None
    cut_after_all = replace(SPOILT, state=ShotState.WAITING)  # it failed first, for there was no room
    assert newest_verdict(day(shots=(cut_after_all,))) is None
