"""The index of a thousand shots: memory and time of the process that makes it, and how soon a browser shows its page.

The reports are those of four shots of the bundled rig `mixed`, each written again under other names with other masses.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from recoil_daq import identify_folder, ingest_folder, load_rig, simulate
from recoil_identification.report.document.report_files import json_bytes, sealed
from tests.builders.browsers import find_browser

SHOTS, REAL, SEED = 1000, 4, 20
MOST_MB, LONGEST_S = 500.0, 2.0
_SHOWN = """<script>addEventListener("load", () => {
  const body = document.body, last = document.querySelector("#shots tbody tr:last-child").getBoundingClientRect();
  const told = document.createElement("pre");
  told.id = "told";
  const rows = document.querySelectorAll("#shots tbody tr").length;
  told.textContent = JSON.stringify([performance.now(), rows, last.bottom]);
  body.append(told);
});</script></body>"""
"""Element that says, once the page is loaded and laid out, how long that took and what is there."""


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home, rig = tmp_path_factory.mktemp("season"), load_rig("mixed")
    simulate(rig, home / "fired", seed=SEED, shots=REAL)
    ingest_folder(rig, home / "fired", out=home / "shots")
    real = [one.document for one in identify_folder(home / "shots", out=home / "real")]
    for number in range(SHOTS):
        document, name = real[number % REAL], f"{number + 1:04d}"
        mass = document["mass"]
        other = {**document, "shot": name, "mass": {**mass, "value": mass["value"] + 1e-3 * number}}
        folder = home / "reports" / name
        folder.mkdir(parents=True)
        (folder / "report.html").write_text("<!doctype html><title>a report</title>", encoding="utf-8")
        (folder / "report.json").write_bytes(json_bytes(sealed(other)))
    return home / "reports"


@pytest.mark.skipif(not hasattr(os, "wait4"), reason="this system does not tell the memory of one process")
def test_an_index_of_a_thousand_shots_is_small_and_shown_at_once(reports: Path, tmp_path: Path) -> None:
    out, since_s = tmp_path / "index", time.perf_counter()
    command = [sys.executable, "-m", "recoil_daq.cli", "index", str(reports), "--out", str(out), "--xlsx"]
    started = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(started.pid, 0)
    took_s, peak_mb = time.perf_counter() - since_s, used.ru_maxrss / (1e3 if sys.platform != "darwin" else 1e6)
    started.returncode = os.waitstatus_to_exitcode(status)
    page = out / "index.html"
    print(f"\n{SHOTS} shots: made in {took_s:.1f} s, peak {peak_mb:.0f} MB, page {page.stat().st_size / 1e6:.2f} MB")
    assert started.returncode == 0
    assert peak_mb < MOST_MB
    assert len((out / "index.csv").read_text("utf-8").splitlines()) == 1 + SHOTS
    browser = find_browser()
    if browser is None:
        pytest.skip("no browser of Chromium's kind on this machine: the page is not opened")
    copy = page.with_name("opened.html")
    copy.write_text(page.read_text("utf-8").replace("</body>", _SHOWN), encoding="utf-8")
    shown_ms, rows, bottom_px = _opened(browser, copy, tmp_path)
    print(f"shown after {shown_ms:.0f} ms, {rows} rows over {bottom_px:.0f} px")
    assert rows == SHOTS
    assert bottom_px > 20.0 * SHOTS
    assert shown_ms < 1e3 * LONGEST_S


def _opened(browser: str, page: Path, folder: Path) -> list[float]:
    """Open a page by the browser's own clock, and return what it says of itself."""
    command = [
        browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
        "--disable-component-update", "--disable-sync", f"--user-data-dir={folder / 'profile'}",
        "--window-size=1400,1000", "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True, encoding="utf-8")
    told = re.search(r'<pre id="told">(.*?)</pre>', done.stdout)
    assert told is not None
    found: list[float] = json.loads(told.group(1))
    return found
