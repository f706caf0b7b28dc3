"""The documented day: eight shots as the README plans them, to a campaign that is valid and holds the truth."""

from __future__ import annotations

from pathlib import Path

import pytest

from recoil_daq.recording.simulate import first_seed
from tests.builders.documented_days import KINDS, README_SEEDS, Day, days, live


@pytest.mark.whole_way
@pytest.mark.parametrize(("rig", "kind", "seed"), [("field-2013", "120 kg", README_SEEDS[0])])
def test_it_is_valid_holds_the_truth_and_says_nothing_that_is_not_so(tmp_path: Path, rig: str, kind: str, seed: int):
    lived = live(Day(rig, kind, seed, shorter=True), tmp_path)
    mass_kg, u_kg, true_kg = lived.judged
    assert lived.answer["valid"], lived.answer["reasons"]
    assert abs(mass_kg - true_kg) < 2.6 * u_kg
    assert lived.answer["constancy"]["constant"]
    assert lived.answer["agreement"]["apart"] == []
    assert lived.answer["agreement"]["factor"] == 1.0
    assert {one["kind"] for one in lived.answer["signals"]} <= {"chart"}
    # the shots are of a noise of their own
    assert [one["seed"] for one in lived.truths] == [first_seed(seed) + k for k in range(8)]


def test_days_differ_in_noise_and_sensors_and_are_of_all_kinds():
    planned = days(60)
    assert len({one.campaign_seed for one in planned}) == 60
    assert set(README_SEEDS) <= {one.campaign_seed for one in planned if one.kind == "120 kg" and one.rig == "mixed"}
    assert sum(KINDS[one.kind][0] is not None for one in planned) == 40
    used = [first_seed(one.campaign_seed) + k for one in planned for k in range(one.shots)]
    assert len(set(used)) == len(used)
