"""A pulse that is lost is the reason, whatever channel lost it, and no sensor is blamed for it."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.verdict.shot_quality import check_shot
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from tests.builders.range_faults import Injected, frozen, late, lost, scaled
from tests.builders.virtual_shots import virtual_shot


def identified_with(inject: Injected) -> Identification:
    virtual = virtual_shot()
    shot = replace(inject(virtual, virtual.shot), alignments=(), quality=())
    alignments = align_clocks(FiredShot(shot, virtual.rig))
    quality = check_shot(
        FiredShot(replace(shot, alignments=alignments), virtual.rig),
        alignments,
        {},
        CalibrationDay(dt.date(2026, 6, 1), DayOf.START),
    )
    return identify_shot(FiredShot(replace(shot, alignments=alignments, quality=quality), virtual.rig), Options())


@pytest.mark.whole_way
@pytest.mark.parametrize("role", ["breech_pressure", "recuperator_pressure"])
def test_a_pressure_that_froze_through_the_pulse_names_what_was_lost_first(role: str) -> None:
    found = identified_with(frozen(role, 0.010))
    channel = virtual_shot().shot.by_role(role)
    assert channel is not None
    assert "of the shot's force lies where samples are lost" in found.reasons[0]
    assert channel.name in found.reasons[0]
    low, high = found.chosen.estimate.interval_kg
    assert low < virtual_shot().truth["m3"] < high


@pytest.mark.whole_way
def test_two_milliseconds_lost_of_the_pulse_cost_precision_and_not_the_result() -> None:
    found = identified_with(lost("recoil_acceleration", 0.002))
    low, high = found.chosen.estimate.interval_kg
    assert found.valid, found.reasons
    assert low < virtual_shot().truth["m3"] < high


@pytest.mark.whole_way
def test_samples_held_at_the_beginning_of_a_record_do_not_stop_the_alignment() -> None:
    # a late channel repeats its first sample there, which counts as held
    assert identified_with(late("carriage_acceleration_x", 2e-4)).alignments["camera"].status == "ok"


@pytest.mark.whole_way
def test_a_wrong_gain_is_told_by_as_much_as_the_other_sensors_say() -> None:
    found = identified_with(scaled("breech_pressure", 1.05))
    doubted = [reason for reason in found.reasons if reason.startswith("breech_pressure")]
    told = float(doubted[0].split(" by ")[1].split(" ")[0])
    u_rel = virtual_shot().shot.channels["p_breech"].u_rel
    off = virtual_shot().truth["gains"]["p_breech"] * 1.05 - 1
    assert told == pytest.approx(off / u_rel, rel=0.5)
    assert np.sign(found.chosen.estimate.mass_kg - virtual_shot().truth["m3"]) > 0
