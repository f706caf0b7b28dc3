"""A day at a virtual range, served while it is armed: what somebody at another screen sees of a shot, and when."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.builders.driven_browser import DRIVEN, asked, driven, shows, told, until

pytestmark = [
    pytest.mark.real_time,
    DRIVEN,
    pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals for the virtual port"),
]
MASS_WITHIN_S = 90.0


def test_a_shot_is_seen_from_its_trigger_to_its_mass_at_a_screen_and_from_a_file(tmp_path: Path) -> None:
    out = tmp_path / "shots"
    command = [
        sys.executable, "-P", "-m", "recoil_daq.cli", "ingest", "mixed", "--live", "--shots", "1", "--serve",
        "--no-screen", "--out", str(out),
    ]  # fmt: skip
    with (
        driven() as browser,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8") as session,
    ):
        assert session.stdout is not None
        lines: list[str] = []
        address = _address(session.stdout, lines)
        while not (out / "live.html").exists():
            assert session.poll() is None, lines
            time.sleep(0.1)
        began_s = time.monotonic()
        browser.get(address)
        until(browser, "!document.documentElement.hasAttribute('data-unsure')", 3.0)
        print(f"\nseen after {time.monotonic() - began_s:.2f} s")
        until(browser, shows("state", "ARMED"), 30.0)
        until(browser, shows("verdict", "0001 USABLE"), MASS_WITHIN_S)
        until(browser, shows("verdict", "± "), MASS_WITHIN_S)
        until(browser, "document.querySelectorAll('#panels canvas').length >= 4", 10.0)
        until(browser, shows("state", "ENDED"), 10.0)
        # once the session's server has ended, too, the page asks in vain
        assert [line for line in told(browser) if "ERR_CONNECTION_REFUSED" not in line or session.poll() is None] == []
        assert all(one.startswith((address, "data:,")) for one in asked(browser))
        rest = session.stdout.read()
        assert session.wait(60) == 0, rest
        assert "Traceback" not in rest
        browser.get("about:blank")
        told(browser)
        browser.get((out / "live.html").as_uri())
        until(browser, shows("state", "ENDED"), 3.0)
        until(browser, shows("step", "copy the folder"), 3.0)
        until(browser, "document.querySelectorAll('#panels canvas').length >= 4", 10.0)
        assert told(browser) == []
        _lost_nothing(browser)


def _address(stream: Any, lines: list[str]) -> str:
    """Return the address of the page, which a line of the session's says."""
    for line in stream:
        lines.append(line)
        if found := re.search(r"page: (http://\S+)", line):
            return found[1]
    pytest.fail("".join(lines))


def _lost_nothing(browser: Any) -> None:
    """Assert that nothing more is lost beside a viewer than the virtual rig leaves out."""
    sources = browser.execute_script("return window.live.sources.filter((one) => one.counters)")
    assert sources
    for one in sources:
        assert one["counters"]["kernel_drops"] in (None, 0)
        assert one["counters"]["reopened"] == 0
