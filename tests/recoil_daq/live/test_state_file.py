"""The state for other programs: whole or not there, and said where it cannot be written."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from recoil_daq.live.state_file import StateFile
from tests.builders.live_status import state_of, status
from tests.builders.range_states import MASS, day, usable

WRITTEN = {"live.json", "live.js", "live.html", "zoom.html", "pages", "overviews"}


def test_a_state_is_written_over_the_one_before_and_leaves_nothing_else(tmp_path: Path) -> None:
    file = StateFile(tmp_path)
    for state in ("armed", "recording"):
        assert file.write(state_of(status(state=state))) == ""
    assert json.loads(file.path.read_text())["state"] == "recording"
    assert {path.name for path in tmp_path.iterdir()} == WRITTEN


def test_the_script_that_a_page_reads_is_the_same_document(tmp_path: Path) -> None:
    file = StateFile(tmp_path)
    file.write(state_of(status()))
    script = (tmp_path / "live.js").read_text()
    assert script == f"window.live = {file.path.read_text()};\n"
    assert script.isascii()


def test_the_page_says_the_last_state_without_scripts_and_obeys_no_name_in_it(tmp_path: Path) -> None:
    hostile = "</noscript><script>alert(1)</script>\u202e"
    StateFile(tmp_path).write(day(rig=hostile, alert=f"{hostile} LOST"))
    page = (tmp_path / "live.html").read_text(encoding="utf-8")
    text = page.partition('<pre id="text">')[2].partition("</pre>")[0]
    assert "&lt;/noscript&gt;&lt;script&gt;alert(1)&lt;/script&gt;\\u202e LOST" in text
    assert "next: see to it" not in text
    assert "next shot 0004" in text
    assert "shot 0002: USABLE, 783.0 kg, 95 % 777.8 to 788.2, VALID" in text
    assert "<" not in text
    assert page.count("<script") == 2


def test_a_mass_without_a_number_is_shown_as_none(tmp_path: Path) -> None:
    none = {**MASS, "value": math.nan, "u": math.nan, "U95": [math.nan, math.nan]}
    assert StateFile(tmp_path).write(day(shots=(usable("0003", mass=none),))) == ""
    assert "shot 0003: USABLE, - kg, 95 % - to -, VALID" in (tmp_path / "live.html").read_text(encoding="utf-8")


def test_whatever_is_in_a_state_ends_no_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recoil_daq.live.state_file.live_page", lambda _: 1 / 0)
    assert StateFile(tmp_path).write(day()).startswith("ZeroDivisionError")
    assert json.loads((tmp_path / "live.json").read_text())["state"] == "armed"


def test_the_last_state_of_a_session_is_on_the_page_at_once(tmp_path: Path) -> None:
    file = StateFile(tmp_path)
    for state in ("armed", "stopped"):
        file.write(state_of(status(state=state)))
    assert "STOPPED, rig mixed" in (tmp_path / "live.html").read_text(encoding="utf-8")


def test_a_state_that_cannot_be_written_says_why_and_leaves_nothing_half(tmp_path: Path) -> None:
    (tmp_path / "live.json").mkdir()
    assert StateFile(tmp_path).write(state_of(status())) == "Is a directory"
    assert list(tmp_path.glob(".*")) == []
