"""A shot of a live session: what its devices lost, in words."""

from __future__ import annotations

from recoil_acquisition.devices.device import Counters
from recoil_daq.live.shot import losses_of


def test_losses_are_named_the_worst_first() -> None:
    assert losses_of(Counters(counter_gaps=1, bad=2)) == "1 gap, 2 damaged"


def test_none_is_said_only_where_frames_are_counted() -> None:
    assert losses_of(Counters(counter_gaps=0)) == "none"
    assert losses_of(Counters()) == "none seen"
