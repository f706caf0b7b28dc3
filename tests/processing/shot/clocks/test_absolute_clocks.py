from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_acquisition.store import read_shot, write_shot
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.verdict.shot_quality import alignment_check
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.two_recorders import SECOND, apart, two_recorders

pytestmark = pytest.mark.whole_way


def clock_of(fired: FiredShot) -> ClockAlignment:
    return fired.shot.alignment(SECOND)


def verdict(fired: FiredShot) -> QualityCheck:
    return alignment_check(clock_of(fired))


def identified(fired: FiredShot) -> Identification:
    return identify_shot(fired, Options())


def test_a_lock_that_is_10_us_wrong_is_used_and_moves_the_mass_by_nothing() -> None:
    right, wrong = apart().at(), apart().at(1e-5)
    assert [clock_of(one).method for one in (right, wrong)] == ["absolute", "absolute"]
    assert clock_of(right).offset_s == pytest.approx(apart().offset_s, abs=1e-9)
    check = verdict(wrong)
    assert (check.check, check.verdict) == (Check.ALIGNMENT, "ok")
    assert re.search(
        r"by absolute, locked to irig-b, the reference to irig-b; redundant gives -(8|9|1\d)\.\d us from it",
        check.detail,
    )
    before, after = identified(right), identified(wrong)
    u_kg = after.chosen.estimate.u_kg
    assert abs(after.chosen.estimate.mass_kg - before.chosen.estimate.mass_kg) < 0.02 * u_kg
    assert abs(after.chosen.estimate.mass_kg - apart().m3_kg) < 2 * u_kg
    assert after.valid


def test_a_lock_that_is_1_ms_wrong_is_warned_of_and_the_mass_stays() -> None:
    right, wrong = identified(apart().at()), apart().at(1e-3)
    clock, check = clock_of(wrong), verdict(wrong)
    assert (clock.method, clock.status) == ("redundant", "ok")
    assert clock.offset_s == pytest.approx(apart().offset_s, abs=4 * clock.u_offset_s)
    assert check.verdict == "warn"
    assert re.search(r"-(99\d|100\d)\.\d us away from that by absolute time", check.detail)
    assert "redundant is used; look at the locks of both clocks" in check.detail
    found = identified(wrong)
    u_kg = found.chosen.estimate.u_kg
    assert found.valid
    assert abs(found.chosen.estimate.mass_kg - right.chosen.estimate.mass_kg) < 0.02 * u_kg
    # what would have come of the wrong lock
    all_the_same = replace(clock, offset_s=apart().offset_s + 1e-3, u_offset_s=1e-5, method="absolute")
    others = [one for one in wrong.shot.alignments if one.clock != SECOND]
    trusted = identified(FiredShot(replace(wrong.shot, alignments=(*others, all_the_same)), wrong.rig))
    assert abs(trusted.chosen.estimate.mass_kg - right.chosen.estimate.mass_kg) > 0.5 * u_kg


def test_a_lock_that_is_1_s_wrong_is_refused_and_so_is_the_mass() -> None:
    wrong = apart().at(1.0)
    assert clock_of(wrong).status == "failed"
    assert verdict(wrong).verdict == "fail"
    assert "redundant gives an offset -1 s away" in verdict(wrong).detail
    with pytest.raises(IdentificationError, match="on clocks that could be aligned"):
        identified(wrong)


def test_a_recorder_that_says_that_it_ran_free_is_aligned_by_the_motion_aloud() -> None:
    free = apart().at(said="PTP, not locked")
    assert clock_of(free).method == "redundant"
    assert verdict(free).verdict == "warn"
    assert "runs free, by what it says itself (PTP, not locked); redundant is used in its place" in verdict(free).detail


def test_a_start_to_the_millisecond_leaves_the_offset_to_the_motion() -> None:
    coarse = apart().at(digits=3)
    assert (clock_of(coarse).method, verdict(coarse).verdict) == ("redundant", "warn")
    assert "known to 0.41 ms only" in verdict(coarse).detail


def test_a_recorder_that_shares_no_motion_is_aligned_by_absolute_time_alone() -> None:
    rig = two_recorders(align="u_s = 1e-5")
    fired = apart().at()
    alone = align_clocks(FiredShot(replace(fired.shot, alignments=()), rig))
    (found,) = (one for one in alone if one.clock == SECOND)
    assert (found.method, found.status) == ("absolute", "ok")
    assert "second_method" not in found.details
    elsewhere = apart().at(3.0)
    (found,) = (
        one for one in align_clocks(FiredShot(replace(elsewhere.shot, alignments=()), rig)) if one.clock == SECOND
    )
    assert found.status == "failed"
    assert "the file is of another shot" in found.reasons[0]


def test_a_bus_read_live_has_the_hosts_time_and_the_rate_of_its_own_clock() -> None:
    fired = apart().at()
    fit = {"drift": 2e-5, "u_drift": 1e-6, "u_offset_s": 3e-5}
    shot = replace(fired.shot, alignments=(), clock_fits={SECOND: fit})
    rig = two_recorders(align="u_s = 1e-5")
    (found,) = (one for one in align_clocks(FiredShot(shot, rig)) if one.clock == SECOND)
    assert found.drift == 2e-5
    assert found.u_offset_s == pytest.approx(math.hypot(1e-5, 3e-5), rel=1e-3)
    unknown = replace(shot, clock_fits={SECOND: fit | {"u_drift": None}})
    (less_sure,) = (one for one in align_clocks(FiredShot(unknown, rig)) if one.clock == SECOND)
    assert less_sure.u_drift > 1.1 * found.u_drift
    assert less_sure.u_offset_s > found.u_offset_s


def test_locks_and_both_offsets_stand_in_the_shot_file(tmp_path: Path) -> None:
    fired = apart().at(1e-3, said="IRIG-B, locked")
    write_shot(fired.shot, tmp_path / "s.h5")
    shot = read_shot(tmp_path / "s.h5")
    details = shot.alignment(SECOND).details
    assert details["absolute"]["offset_s"] == pytest.approx(apart().offset_s + 1e-3, abs=1e-9)
    assert details["second_offset_s"] == pytest.approx(apart().offset_s, abs=5e-5)
    assert {details["absolute"][side]["lock"] for side in ("source", "reference")} == {"irig-b"}
    assert details["absolute"]["source"]["lock_by"] == "instrument"
    assert shot.channels["p_brake"].time_base.absolute_start.locked_to == "IRIG-B, locked"
