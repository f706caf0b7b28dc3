"""Configurations that what was added tells apart are one mechanism; others have parts of their own."""

from __future__ import annotations

from dataclasses import replace

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.mechanisms import UNNAMED, mechanisms_of

SHOT = CampaignShot("1", "r", None, 900.0, 3.0, None)


def shots(*built: tuple[str, float]) -> list[CampaignShot]:
    return [replace(SHOT, configuration=name, added_mass_kg=added) for name, added in built]


def test_shots_without_a_name_are_one_mechanism_whatever_was_added() -> None:
    assert mechanisms_of(shots(("", 0.0), ("", 120.0))) == {"": UNNAMED}


def test_a_name_for_what_was_added_is_the_same_mechanism() -> None:
    assert mechanisms_of(shots(("bare", 0.0), ("ring", 120.0), ("rings", 240.0))) == {
        "bare": "bare", "ring": "bare", "rings": "bare",
    }  # fmt: skip


def test_two_names_with_the_same_mass_added_are_other_parts() -> None:
    assert mechanisms_of(shots(("old brake", 0.0), ("new brake", 0.0))) == {
        "old brake": "old brake", "new brake": "new brake",
    }  # fmt: skip


def test_the_first_is_that_of_the_first_shot_that_was_fired_though_it_does_not_count() -> None:
    fired = shots(("", 0.0), ("ring", 120.0), ("", 120.0))
    assert list(mechanisms_of(fired[1:], fired).values()) == [UNNAMED, "ring"]
    # one of which no shot counts is none
    assert mechanisms_of(fired[1:2], fired) == {"ring": "ring"}
    # a name for what was added is the same mechanism as the shots that nobody named
    assert mechanisms_of(shots(("ring", 120.0), ("", 0.0)), shots(("", 0.0), ("ring", 120.0), ("", 0.0))) == {
        "": UNNAMED, "ring": UNNAMED,
    }  # fmt: skip


def test_a_weight_on_either_of_two_builds_leaves_them_two() -> None:
    built = shots(("old", 0.0), ("old", 120.0), ("new", 0.0), ("new", 120.0))
    assert mechanisms_of(built) == {"old": "old", "new": "new"}
