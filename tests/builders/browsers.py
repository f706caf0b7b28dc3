"""A real browser, where the machine has one: it opens a page, runs a script in it, and says what the script found."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "msedge", "microsoft-edge")
"""Of one engine, whose command line is the same."""
BUDGET_MS, ATTEMPTS = 40_000, 3
"""Of the browser's own time at the first attempt, and how many there are, each with three times as much as the last."""
LONGEST_S = 600
"""That a browser may take for all pages that it is given, on a machine that others keep busy."""


def find_browser() -> str | None:
    """Return where a browser is; None if there is none."""
    return next((found for found in map(shutil.which, NAMES) if found), None)


def visit(
    browser: str,
    pages: dict[str, tuple[Path, int]],
    script: str,
    *,
    folder: Path,
    dark: bool = False,
    sandbox: str | None = None,
) -> dict[str, Any]:
    """Open pages, each in a frame of its own width, and run a script in each.

    Parameters
    ----------
    pages
        Name -> page, and how many pixels it is wide: no window of a browser is as narrow as that of a telephone.
    script
        Body of an asynchronous function; what it returns is what was found. It runs in copies of the pages, which stand
        beside them.
    folder
        Is made anew for the browser's profile and the page that holds the frames.
    dark
        Whether the reader prefers dark pages.
    sandbox
        What a frame that is shut in may do, as a mail program or a document server shuts pages in; None for frames that
        are not.

    Returns
    -------
    dict
        Of each page ``found`` and ``errors`` (of its console, uncaught ones among them); and of all of them together,
        by the name ``""``, the addresses that the browser asked for beyond this machine's files.
    """
    folder.mkdir()
    frames, shut = [], "" if sandbox is None else f' sandbox="{sandbox}"'
    for name, (page, width_px) in pages.items():
        copy = page.with_name(f"visited-{name}.html")
        text = page.read_text(encoding="utf-8")
        # the first to run, so that nothing goes unseen
        text = text.replace("<title>", f"<script>{_WATCH}</script><title>", 1)
        told = _TELL.replace("NAME", json.dumps(name)).replace("BODY", script)
        copy.write_text(text.replace("</body>", f"<script>{told}</script></body>"), encoding="utf-8")
        frames.append(f'<iframe{shut} src="{copy.as_uri()}" style="width:{width_px}px;height:900px;border:0"></iframe>')
    outer = folder / "frames.html"
    outer.write_text(f"<!doctype html><body><script>{_LISTEN}</script>{''.join(frames)}", encoding="utf-8")
    for attempt in range(ATTEMPTS):  # on a busy machine the browser's own time runs out before a page has drawn
        log = folder / f"net-{attempt}.json"
        command = [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
            "--disable-features=IsolateSandboxedIframes", "--disable-component-update", "--disable-sync",
            f"--user-data-dir={folder / f'profile-{attempt}'}",
            f"--log-net-log={log}", "--window-size=1500,1000", f"--virtual-time-budget={BUDGET_MS * 3**attempt}",
            f"--blink-settings=preferredColorScheme={0 if dark else 1}", "--dump-dom", outer.as_uri(),
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, check=True, encoding="utf-8")
        told = re.search(r'<pre id="told">(.*?)</pre>', done.stdout, re.DOTALL)
        found = json.loads(html.unescape(told.group(1)) if told else "{}")
        if set(found) >= set(pages):
            break
    return {**found, "": _asked(log)}


def print_page(browser: str, page: Path, sheets: Path) -> None:
    """Print a page, once it has drawn, as the browser prints it on A4."""
    command = [
        browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
        "--no-pdf-header-footer", f"--user-data-dir={sheets.with_suffix('')}", f"--virtual-time-budget={BUDGET_MS}",
        f"--print-to-pdf={sheets}", page.as_uri(),
    ]  # fmt: skip
    subprocess.run(command, capture_output=True, timeout=LONGEST_S, check=True)


def _asked(log: Path) -> list[str]:
    """Return what pages asked the network for; what the browser asks for on its own is of no page."""
    events = [event.get("params", {}) for event in json.loads(log.read_text(encoding="utf-8"))["events"]]
    return sorted(
        {one["url"] for one in events if "url" in one and one.get("initiator", "").startswith(("file", "null"))}
    )


_WATCH = """
window.seen = [];
addEventListener("error", (event) => seen.push(event.message || "not loaded: " + event.target.src), true);
addEventListener("unhandledrejection", (event) => seen.push("rejected: " + event.reason));
addEventListener("securitypolicyviolation", (event) => seen.push("forbidden: " + event.blockedURI));
console.error = console.warn = (...words) => seen.push(words.join(" "));
"""
_TELL = """
(async () => {
  let found;
  try { found = await (async () => { BODY })(); } catch (error) { seen.push("test: " + error.stack); }
  parent.postMessage({ name: NAME, told: { found, errors: seen } }, "*");
})();
"""
_LISTEN = """
const all = {};
addEventListener("message", (event) => {
  all[event.data.name] = event.data.told;
  const place = document.getElementById("told") || document.body.appendChild(document.createElement("pre"));
  place.id = "told";
  place.textContent = JSON.stringify(all);
});
"""
