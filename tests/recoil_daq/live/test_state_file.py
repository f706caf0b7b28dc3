"""The state for other programs: whole or not there, and said where it cannot be written."""

from __future__ import annotations

import json
from pathlib import Path

from recoil_daq.live.state_file import StateFile
from tests.builders.live_status import state_of, status


def test_a_state_is_written_over_the_one_before_and_leaves_nothing_else(tmp_path: Path) -> None:
    file = StateFile(tmp_path)
    for state in ("armed", "recording"):
        assert file.write(state_of(status(state=state))) == ""
    assert json.loads(file.path.read_text())["state"] == "recording"
    assert [path.name for path in tmp_path.iterdir()] == ["live.json"]


def test_a_state_that_cannot_be_written_says_why_and_leaves_nothing_half(tmp_path: Path) -> None:
    (tmp_path / "live.json").mkdir()
    assert StateFile(tmp_path).write(state_of(status())) == "Is a directory"
    assert list(tmp_path.glob(".*")) == []
