"""What `check` prints: what it judged, and to what end, is its last line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from recoil_rigs.rig import find_rig
from recoil_rigs.twin import TwinShot


def last_line(text: str) -> str:
    return text.strip().splitlines()[-1]


def test_the_last_line_says_of_what_no_fault_was_found(run, field_shot: TwinShot) -> None:
    alone = run("check", "field-2013")
    assert alone.exit_code == 0
    assert last_line(alone.stdout) == (
        "no fault in 9 channels of the rig file; no recorded file was given to hold against it"
    )
    beside = run("check", "field-2013", *field_shot.files)
    assert last_line(beside.stdout) == "no fault in 9 channels of the rig file, and 9 of them in 2 recorded files"


@pytest.mark.parametrize(("faults", "repeated"), [(3, False), (12, True)])
def test_a_long_list_of_faults_ends_with_how_many_there_are(run, tmp_path: Path, faults: int, repeated: bool) -> None:
    text = find_rig("field-2013").read_text("utf-8")
    rig = tmp_path / "rig.toml"
    rig.write_text(
        re.sub(r"(?m)^(\w+) = [\d.]+ ", r'\1 = "TODO from the drawing" ', text, count=faults), encoding="utf-8"
    )
    done = run("check", rig)
    assert done.exit_code == 3
    is_last = last_line(done.output).startswith(f"{rig} is not sound yet: ") and " values stated" in last_line(
        done.output
    )
    assert is_last is repeated
