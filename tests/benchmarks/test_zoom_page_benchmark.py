"""Sixteen channels of a million samples on the page on which they are zoomed: when they are there, how they follow."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_daq.live.page.page_files import write_pages
from recoil_daq.recording.overview import write_overview
from tests.builders.bench_shots import bench_shot
from tests.builders.driven_browser import DRIVEN, driven, until

pytestmark = DRIVEN

CHANNELS, SAMPLES = 16, 1_000_000
PAINTED_WITHIN_S, ZOOMED_WITHIN_MS = 1.0, 100.0
ZOOMS = """
const done = arguments[0], times = [];
const moves = ['in', 'in', 'right', 'in', 'left', 'in', 'in', 'out', 'in', 'in', 'in', 'all'];
const next = () => {
  if (!moves.length) return done(times);
  const began = performance.now(), was = document.documentElement.dataset.painted;
  document.querySelector(`[data-move=${moves.shift()}]`).click();
  const look = () => {
    if (document.documentElement.dataset.painted === was) return requestAnimationFrame(look);
    times.push(performance.now() - began);
    setTimeout(next, 400);
  };
  requestAnimationFrame(look);
};
next();
"""
"""From the click to the picture that follows it; between two of them the rest is read, as people leave time for it."""
ALL = "for (const one of document.querySelectorAll('#channels input:not(:checked)')) one.click()"
PAINTED = "document.documentElement.dataset.painted > 0 && document.querySelectorAll('figcaption .label').length === 16"


def test_sixteen_million_samples_are_painted_and_zoomed_while_one_waits(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    shot = bench_shot()
    gauge = next(iter(shot.channels.values()))
    base = TimeBase.uniform(shot.reference_clock, 0.0, 1e-6, SAMPLES)
    pulse = np.exp(-(((base.times_s - 0.3) / 0.05) ** 2))
    channels = {
        f"p_{number:02d}": replace(
            gauge, name=f"p_{number:02d}", role="brake_pressure", time_base=base, raw=None,
            samples=(1e6 * (number + 1) * pulse + 2e4 * random.normal(size=SAMPLES)).astype("f4"),
        )
        for number in range(CHANNELS)
    }  # fmt: skip
    file = tmp_path / "0001.h5"
    file.write_bytes(b"stands for the shot file")
    began_s = time.process_time()
    write_overview(replace(shot, name="0001", channels=channels, quality=(), alignments=()), file)
    written_s = time.process_time() - began_s
    write_pages(tmp_path)
    kilobytes = (tmp_path / "overviews/0001/overview.js").stat().st_size / 1e3
    megabytes = sum(path.stat().st_size for path in (tmp_path / "overviews/0001").iterdir()) / 1e6
    with driven() as browser:
        browser.set_script_timeout(60)
        browser.get("about:blank")
        browser.get((tmp_path / "zoom.html").as_uri())
        browser.execute_script(
            "for (const one of document.querySelectorAll('#channels input:not(:checked)')) one.click()"
        )
        until(browser, PAINTED, 10.0)
        browser.refresh()
        until(browser, "document.documentElement.dataset.painted > 0", 10.0)
        began_s = time.monotonic()
        browser.execute_script(
            "for (const one of document.querySelectorAll('#channels input:not(:checked)')) one.click()"
        )
        until(browser, PAINTED, 10.0)
        laid_s = time.monotonic() - began_s
        first_s = browser.execute_script("return performance.getEntriesByType('paint').at(-1).startTime") / 1e3
        zooms_ms = browser.execute_async_script(ZOOMS)
        detail = browser.execute_script("return document.getElementById('detail').innerText")
    print(
        f"\noverview: {written_s:.2f} s CPU, {kilobytes:.0f} kB first, {megabytes:.1f} MB in all; page "
        f"{first_s:.2f} s, 16 channels {laid_s:.2f} s; zooms, ms: {' '.join(f'{one:.0f}' for one in zooms_ms)}, "
        f"median {median(zooms_ms):.0f}; load {os.getloadavg()[0]:.1f}"
    )
    assert "stands for up to" in detail
    assert first_s + laid_s < PAINTED_WITHIN_S
    assert median(zooms_ms) < ZOOMED_WITHIN_MS
