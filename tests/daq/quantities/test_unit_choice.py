"""Units that somebody chose: one of a quantity, and SI of the others."""

from __future__ import annotations

from dataclasses import replace

import pytest

from recoil_acquisition.quantities.unit_choice import SI, UnitChoice
from recoil_rigs.rig import load_rig
from recoil_rigs.shots.live_sources import live_sources


def test_a_unit_is_turned_into_the_one_chosen_of_its_quantity() -> None:
    chosen = UnitChoice.named(["bar", "g", "nonsense"])
    assert chosen.factor("Pa") == (1e-5, "bar")
    assert chosen.factor("MPa") == (pytest.approx(10.0), "bar")
    assert chosen.factor("m/s^2") == (pytest.approx(1 / 9.80665), "g")
    assert chosen.factor("rad/s") == (1.0, "rad/s")
    assert chosen.factor("frames") == (1.0, "frames")
    assert SI.factor("Pa") == (1.0, "Pa")


def test_a_live_channel_is_read_in_the_units_that_the_rig_chose_its_differences_too() -> None:
    rig = load_rig("mixed")
    rig = replace(rig, report=rig.report.model_copy(update={"units": ("bar", "g")}))
    channels = {channel.name: channel for source in live_sources(rig) for channel in source.channels}
    assert channels["p_brake"].shown(1.5e6) == "15 bar"
    assert channels["acc_recoil_can"].shown(9.80665, span=True) == "1 g"
