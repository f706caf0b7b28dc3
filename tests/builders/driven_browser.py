"""A real browser that a test drives: what a page shows after a while, at a size, in the dark, without scripts."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.builders.browsers import find_browser

DRIVER = shutil.which("chromedriver")
DRIVEN = pytest.mark.skipif(
    DRIVER is None or find_browser() is None,
    reason="no chromium with its driver is on this machine: no page is looked at",
)


@contextmanager
def driven(*, width: int = 1400, height: int = 900, dark: bool = False, scripts: bool = True) -> Iterator[Any]:
    """Start a browser of a size, which keeps what it says and asks for."""
    from selenium.webdriver import Chrome
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    options.binary_location = find_browser() or ""
    for word in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"):
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    if not scripts:
        options.add_experimental_option("prefs", {"profile.managed_default_content_settings.javascript": 2})
    browser = Chrome(options=options, service=Service(DRIVER))
    try:
        resize(browser, width, height)
        if dark:
            feature = {"name": "prefers-color-scheme", "value": "dark"}
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
        yield browser
    finally:
        browser.quit()


def resize(browser: Any, width: int, height: int = 900) -> None:
    """Give the page a size, as narrow as a telephone's, too."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def told(browser: Any) -> list[str]:
    """Return what its console says since the last time."""
    return [one["message"] for one in browser.get_log("browser")]


def asked(browser: Any) -> set[str]:
    """Return the addresses that pages asked for since the last time."""
    events = (json.loads(one["message"])["message"] for one in browser.get_log("performance"))
    return {event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent"}


def until(browser: Any, script: str, within_s: float) -> float:
    """Wait until a script returns what is true, and return for how long, s; fail beyond so long a time."""
    began_s = time.monotonic()
    while not browser.execute_script(f"return {script}"):
        assert time.monotonic() - began_s < within_s, f"not within {within_s} s: {script}"
        time.sleep(0.02)
    return time.monotonic() - began_s


def shows(identifier: str, text: str) -> str:
    """Return a script that says whether an element of a page shows a text."""
    return f"(document.getElementById({json.dumps(identifier)})?.innerText ?? '').includes({json.dumps(text)})"


def picture(browser: Any, path: Path) -> None:
    """Keep a picture of what is seen."""
    browser.save_screenshot(str(path))
