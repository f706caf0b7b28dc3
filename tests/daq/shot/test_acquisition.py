"""What a live shot tells of its acquisition comes back from JSON, and what is damaged is refused."""

from __future__ import annotations

import json

import pytest

from recoil_acquisition.shot.acquisition import (
    AcquiredEvent,
    AcquiredSource,
    Acquisition,
    TriggerDecision,
)

ACQUISITION = Acquisition(
    shot="0001",
    rig="mixed",
    trigger_ns=5_000_000_000,
    trigger_utc="2026-05-04T10:11:12.123456",
    pre_s=0.5,
    post_s=1.0,
    pre_actual_s=0.4,
    duration_s=1.5,
    decisions=(
        TriggerDecision(-0.1, "suppressed", "within the holdoff of the last trigger", "p_brake", 2e6),
        TriggerDecision(0.0, "trigger", "", "", None),
    ),
    sources=(
        AcquiredSource(
            "can", "can", "0001.rdlog", 100, 8800, 0.4, False, 0.002, 0, 1, 2, None, 12, -0.7,
            (AcquiredEvent(0.2, "lost", "the adapter is gone"),),
        ),
    ),
)  # fmt: skip


def test_it_comes_back_from_json() -> None:
    assert Acquisition.from_json(json.loads(json.dumps(ACQUISITION.to_json()))) == ACQUISITION


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d.pop("trigger_ns"), "trigger_ns"),
        (lambda d: d.update(more=1), "more"),
        (lambda d: d.update(pre_s="1"), "pre_s must be a finite number"),
        (lambda d: d.update(recovered=1), "recovered must be true or false"),
        (lambda d: d.update(sources=3), "sources must be an array"),
        (lambda d: d["sources"][0].update(events=[4]), r"sources\[0\].events\[0\] must be a table"),
        (lambda d: d.update(trigger_ns=1.5, late=1), "trigger_ns must be .*; late is unknown"),
        (lambda d: d.update(schema="other"), "schema"),
    ],
)
def test_a_damaged_one_is_refused_with_the_place(change, says) -> None:
    document = json.loads(json.dumps(ACQUISITION.to_json()))
    change(document)
    with pytest.raises(ValueError, match=says):
        Acquisition.from_json(document)
