"""What a live session is shown on: the armed screen only where a terminal draws it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from recoil_daq.live.screen.armed_screen import ArmedScreen
from recoil_daq.live.screen.plain_log import PlainLog
from recoil_daq.live.tables import live_display


@pytest.mark.parametrize(
    ("terminal", "kind"), [("xterm-256color", ArmedScreen), ("dumb", PlainLog), ("unknown", PlainLog)]
)
def test_a_terminal_that_draws_nothing_gets_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, terminal: str, kind: type
) -> None:
    """On a dumb one the armed screen would stay empty until the session ends."""
    monkeypatch.setenv("TERM", terminal)
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE", "NO_COLOR"):
        monkeypatch.delenv(name, raising=False)
    with (tmp_path / "out").open("w") as stream:
        monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
        monkeypatch.setattr(sys, "stdout", stream)
        with live_display(plain=False, as_json=False) as display:
            assert isinstance(display, kind)
