"""A gap of the reference clock in the motion that another clock is aligned by: the cause, and said first."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from recoil_rigs.twin import TwinShot


def ingested(run: Any, shot: TwinShot, out: Path, first: int, last: int) -> Any:
    """Take rows out of the recorder's file, and ingest it."""
    table = next(file for file in shot.files if file.name.endswith("_dewetron.csv"))
    lines = table.read_text("utf-8").split("\n")
    spoilt = out / table.name
    spoilt.write_text("\n".join([*lines[:first], *lines[last:]]), encoding="utf-8")
    others = [file for file in shot.files if file != table]
    result = run("ingest", shot.rig_file, spoilt, *others, "--out", out, "--json")
    assert result.exit_code in (0, 1), result.output
    return json.loads(result.stdout)


@pytest.mark.whole_way
def test_a_gap_in_the_motion_is_said_before_the_clock_that_it_leaves_in_doubt(
    run, mixed_shot: TwinShot, tmp_path: Path
) -> None:
    document = ingested(run, mixed_shot, tmp_path, 3000, 4500)
    reason = document["reasons"][0]
    assert reason.startswith("acc_recoil: about 1500 instants are missing between 7250; longest step 60 ms")
    assert "it is the motion by which camera is aligned; this explains 6 more" in reason
    told = {(one["code"], one["about"]): one["severity"] for one in document["findings"]}
    assert told["gap of the reference", "acc_recoil"] == "fatal"
    # the role that one clock in doubt leaves without a channel, and the other clock
    assert (told["role", "tipping_rate"], told["clock", "camera"]) == ("note", "note")


@pytest.mark.whole_way
def test_a_gap_that_leaves_no_clock_in_doubt_is_named_by_itself(run, mixed_shot: TwinShot, tmp_path: Path) -> None:
    document = ingested(run, mixed_shot, tmp_path, 1000, 1500)
    assert document["reasons"] == []
    assert {"time steps"} <= {one["check"] for one in document["quality"] if one["channel"] == "acc_recoil"}
