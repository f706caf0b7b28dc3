"""The page of an armed range in a real browser, from a file and by `serve`: what it shows, when, what it asks for."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.store import read_shot
from recoil_daq.live.page.page_files import write_pages
from recoil_daq.recording.overview import write_filtered, write_overview
from recoil_identification.report.document.report_files import read_curves
from tests.builders.driven_browser import DRIVEN, asked, driven, resize, shows, told, until
from tests.builders.range_states import SOURCES, day
from tests.builders.state_writer import HOSTILE, STATE, WITH_MASS, Written

pytestmark = [pytest.mark.real_time, DRIVEN]

SHOTS = ("0001", "0002", "0003")


@dataclass(frozen=True)
class Shown:
    """Folder of a day, and the address under which `serve` shows it."""

    folder: Path
    address: str
    server: int


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with driven() as started:
        yield started


@pytest.fixture(scope="module")
def shown(stored: Path, identified: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown]:
    """Return a folder with curves of three shots, which `serve` shows."""
    folder = tmp_path_factory.mktemp("day")
    shot = read_shot(stored)
    found = read_curves(identified.reports / "0001")
    assert found is not None
    curves = found.times_s, found.values
    for name in SHOTS:
        file = folder / f"{name}.h5"
        file.write_bytes(stored.read_bytes())
        write_overview(shot, file)
        write_filtered(folder, name, identified.report["interval_s"][0], *curves)
    write_pages(folder)
    STATE.write_to(folder)
    command = [sys.executable, "-P", "-m", "recoil_daq.cli", "serve", str(folder), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, encoding="utf-8") as process:
        assert process.stdout is not None
        yield Shown(folder, process.stdout.readline().strip(), process.pid)
        process.terminate()


@pytest.fixture
def session(shown: Shown) -> Iterator[subprocess.Popen[bytes]]:
    """Return a session that writes on and on."""
    with writing(shown.folder) as process:
        yield process
        process.kill()


def writing(folder: Path) -> subprocess.Popen[bytes]:
    here = Path(__file__).resolve().parents[4]
    roots = [str(here / part) for part in ("", "identification", "processing", "rigs", "daq")]
    return subprocess.Popen(
        [sys.executable, "-m", "tests.builders.state_writer", str(folder)],
        cwd=here, env=os.environ | {"PYTHONPATH": os.pathsep.join(roots)},
    )  # fmt: skip


def pages(shown: Shown) -> tuple[str, str]:
    return (shown.folder / "live.html").as_uri(), f"{shown.address}live.html"


@pytest.mark.usefixtures("session")
@pytest.mark.parametrize("by", [0, 1], ids=["file", "serve"])
def test_state_verdict_mass_and_curves_are_there_and_nothing_is_asked_elsewhere(
    shown: Shown, browser: Any, by: int
) -> None:
    until_written(shown.folder)
    browser.get("about:blank")  # the page of before asks for its own state once a second
    told(browser), asked(browser)
    began_s = time.monotonic()
    browser.get(pages(shown)[by])
    until(browser, "!document.documentElement.hasAttribute('data-unsure')", 1.5)
    until(browser, shows("state", "ARMED"), 1.5)
    assert time.monotonic() - began_s < 3.0, "the browser itself"
    for identifier, text in (
        ("verdict", "0003 USABLE"), ("verdict", "784.2 ± 5.2 kg"), ("verdict", "95 %: 777.8 to 788.2 kg"),
        ("next", "0004"), ("step", "Next: fire shot 0004"), ("table", "NOT USABLE"), ("peaks", "131.4 MPa"),
        ("sources", "camera"),
    ):  # fmt: skip
        until(browser, shows(identifier, text), 2.0)
    until(browser, "document.querySelectorAll('#panels canvas').length >= 4", 3.0)
    for drawn in browser.execute_script(INK):
        assert drawn > 500
    root = (shown.folder.as_uri(), shown.address)[by]
    assert all(one.startswith((root, "data:,")) for one in asked(browser))
    assert told(browser) == []


INK = """
return [...document.querySelectorAll('#panels canvas')].map((canvas) => {
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let i = 3; i < pixels.length; i += 4) count += pixels[i] > 0;
  return count;
});
"""


def until_written(folder: Path) -> None:
    was = (folder / "live.js").read_bytes()
    ends_s = time.monotonic() + 20
    while (folder / "live.js").read_bytes() == was and time.monotonic() < ends_s:
        time.sleep(0.05)


@pytest.mark.usefixtures("session")
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [1400, 700, 390])
def test_nothing_is_cut_at_any_width(shown: Shown, browser: Any, width: int, dark: bool) -> None:
    feature = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
    resize(browser, width)
    try:
        browser.get(pages(shown)[0])
        until(browser, "document.querySelectorAll('#panels canvas').length >= 4", 5.0)
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width
        letters_px = browser.execute_script(
            "return parseFloat(getComputedStyle(document.getElementById('state')).fontSize)"
        )
        assert letters_px >= 0.12 * width
        ground = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
        assert ground == ("rgb(18, 23, 29)" if dark else "rgb(244, 246, 248)")
    finally:
        resize(browser, 1400)
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.mark.parametrize("by", [0, 1], ids=["file", "serve"])
def test_without_scripts_the_last_state_is_text(shown: Shown, by: int) -> None:
    STATE.write_to(shown.folder)
    with driven(scripts=False) as browser:
        browser.get(pages(shown)[by])
        text = browser.find_element("id", "text").text
    assert text.startswith("ARMED, rig mixed, ")
    assert "next: fire shot 0004: everything is ready" in text
    assert "shot 0003: USABLE, 784.2 kg, 95 % 777.8 to 788.2, VALID" in text
    assert "source camera: for files" in text


@pytest.mark.parametrize("by", [0, 1], ids=["file", "serve"])
def test_a_session_that_is_killed_is_stale_within_two_and_a_half_seconds(shown: Shown, browser: Any, by: int) -> None:
    process = writing(shown.folder)
    try:
        until_written(shown.folder)
        browser.get(pages(shown)[by])
        until(browser, "!document.documentElement.hasAttribute('data-unsure')", 3.0)
        time.sleep(1.3)
        assert not browser.execute_script("return document.documentElement.hasAttribute('data-stale')")
        process.send_signal(signal.SIGKILL)
        process.wait()
        waited_s = until(browser, "document.documentElement.hasAttribute('data-stale')", 2.5)
    finally:
        process.kill()
        process.wait()
    assert waited_s > 1.5, "a state that is late is not stale at once"
    until(browser, shows("stale", "STALE: nothing new for"), 0.5)
    assert browser.title.startswith("STALE")


def test_a_page_of_a_session_that_died_long_ago_is_stale_from_the_first_on(shown: Shown, browser: Any) -> None:
    STATE.write_to(shown.folder)
    browser.get(pages(shown)[0])
    until(browser, shows("state", "ARMED"), 1.5)
    assert browser.execute_script("return document.documentElement.hasAttribute('data-unsure')")
    until(browser, "document.documentElement.hasAttribute('data-stale')", 2.5)


def test_another_session_in_the_folder_is_no_stale_one(shown: Shown, browser: Any) -> None:
    for number in range(8):
        STATE.write_to(shown.folder, armed_s=5000.0 + 0.2 * number)
        if number == 0:
            browser.get(pages(shown)[0])
        time.sleep(0.2)
    for number in range(20):
        STATE.write_to(shown.folder, armed_s=0.2 * number)
        assert not browser.execute_script("return document.documentElement.hasAttribute('data-stale')")
        time.sleep(0.2)


def test_names_and_notes_are_text_whatever_they_hold(shown: Shown, browser: Any) -> None:
    invalid = {**WITH_MASS, "valid": False, "reason": HOSTILE}
    hostile = Written(
        day(
            rig=HOSTILE, next_shot=HOSTILE, alert=HOSTILE, cautions=(HOSTILE,),
            sources=tuple(replace(one, name=HOSTILE, last_file=HOSTILE) for one in SOURCES),
            shots=tuple(
                replace(shot, name=HOSTILE, why=HOSTILE, mass=invalid, overview="") for shot in STATE.state.shots
            ),
            notices=tuple(replace(one, text=HOSTILE) for one in STATE.state.notices),
        )
    )  # fmt: skip
    told(browser)
    hostile.write_to(shown.folder)
    browser.get(pages(shown)[1])
    until(browser, shows("step", "<img src=x"), 2.0)
    assert browser.execute_script("return [window.owned ?? null, document.querySelectorAll('img').length]") == [None, 0]
    assert "\u202e" not in browser.execute_script("return document.body.innerText")
    assert "\\u202e" in browser.execute_script("return document.body.innerText")
    assert browser.execute_script("return document.documentElement.scrollWidth") <= 1400
    assert told(browser) == []


def test_figures_are_in_the_units_that_the_rig_chose(shown: Shown, browser: Any) -> None:
    browser.get(pages(shown)[0])
    script = (
        "Curves.choose(arguments[0]); return [Curves.engineering(131.4e6, 'Pa', 4), Curves.engineering(0.822, 'm')]"
    )
    bar = [{"quantity": "pressure", "unit": "bar", "si_per_unit": 1e5}]
    assert browser.execute_script(script, bar) == ["1314 bar", "822 mm"]
    assert browser.execute_script(script, []) == ["131.4 MPa", "822 mm"]


def test_what_is_wrong_is_said_in_three_states_of_a_source(shown: Shown, browser: Any) -> None:
    states = ("live", "not understood", "lost", "silent")
    wrong = Written(replace(STATE.state, sources=tuple(replace(SOURCES[1], name=one, state=one) for one in states)))
    wrong.write_to(shown.folder)
    browser.get(pages(shown)[0])
    until(browser, shows("sources", "bytes, none of them good"), 2.0)
    found = browser.execute_script("return [...document.querySelectorAll('#sources li')].map((one) => one.className)")
    assert found == ["ok", "doubt", "bad", "bad"]
    until(browser, shows("step", "Next: plug lost in again"), 1.0)


def test_a_report_stands_in_the_same_policy(shown: Shown, identified: Any, browser: Any) -> None:
    shutil.copytree(identified.reports, shown.folder / "reports")
    told(browser)
    browser.get(f"{shown.address}reports/0001/report.html")
    until(browser, "document.documentElement.hasAttribute('data-moved')", 20.0)
    assert told(browser) == []
