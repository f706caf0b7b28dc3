"""How often a change that all shots of a campaign have is found, with its size, and a force taken for one."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from recoil_identification.campaign.combination import combine
from recoil_identification.campaign.constancy import SharedConstancy
from recoil_identification.shot.shot_summary import STEPS_AT
from tests.builders.campaign_summaries import campaign_of

RING = (0.0, 120.0) * 4
CHANGED, FORCED = range(3), range(4)
"""Seeds of campaigns with a change and without one."""
DRIFT, STEP = "drift of ln mass", f"step of ln mass at {STEPS_AT[5]:g}"


def told(seed: int, force: float, changing: Mapping[str, float] | None = None) -> SharedConstancy:
    drawn = campaign_of(RING, seed=seed, unread=force, friction_rel=0.03, changing=changing)
    found = combine(drawn.shots).constancy
    assert found is not None
    return found


def test_drifts_and_steps_are_found_with_their_sizes(benchmark):
    def all_campaigns():
        return [(told(seed, 1.0, {DRIFT: -0.015}), told(seed, 1.0, {STEP: 0.005})) for seed in CHANGED]

    for drift, step in benchmark.pedantic(all_campaigns, rounds=1, warmup_rounds=0):
        assert not drift.constant
        assert not drift.step_explains_more
        assert drift.drift.size_percent == pytest.approx(-1.5, abs=3 * drift.drift.u_percent)
        assert not step.constant
        assert step.step_explains_more
        assert step.step_at == STEPS_AT[5]
        assert step.step.size_percent == pytest.approx(0.5, abs=3 * step.step.u_percent)


@pytest.mark.parametrize("force", [0.0, 1.0, 3.5])
def test_a_force_that_no_gauge_reads_is_no_changing_mass(benchmark, force):
    found = benchmark.pedantic(lambda: [told(seed, force) for seed in FORCED], rounds=1, warmup_rounds=0)
    assert all(one.constant for one in found)
    # a change is no larger than what may hide, nineteen times of twenty
    hidden = [abs(one.drift.size_percent) < one.could_hide_percent["drift"] for one in found]
    assert sum(hidden) >= len(hidden) - 1
