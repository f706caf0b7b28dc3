"""The files of a page: what every page of a folder refers to, and ``live.html`` with the last state as text."""

from __future__ import annotations

import functools
import html
from collections.abc import Iterable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import visible
from recoil_acquisition.files.new_file import partial_path

SCRIPTS = "pages"
"""Folder of the scripts and of the style."""
LIVE_PAGE, ZOOM_PAGE = "live.html", "zoom.html"
_INDEX = "overviews/index.js"
_TEXT = "<!-- the state as text -->"


def write_pages(out: Path) -> None:
    """Write the pages of a folder of shots with their scripts and their style, where they are not as they should be.

    Raises
    ------
    OSError
        If one cannot be written.
    """
    (out / SCRIPTS).mkdir(exist_ok=True)
    wanted = {
        f"{SCRIPTS}/page.css": _report_style() + _own("page.css"),
        **{f"{SCRIPTS}/{name}": _own(name) for name in ("curves.js", "live_page.js", "zoom_page.js")},
        ZOOM_PAGE: _own("zoom.html"),
    }
    index = out / _INDEX
    if not index.exists():  # before the first shot: the page asks for it
        index.parent.mkdir(exist_ok=True)
        replace_text(index, "window.shots = [];\n")
    for name, text in wanted.items():
        path = out / name
        if not path.is_file() or path.read_bytes() != text.encode():
            replace_text(path, text)


def live_page(document: Mapping[str, Any]) -> str:
    """Return the live page, which shows the state as text where no script runs."""
    lines = "\n".join(html.escape(visible(" ".join(line.split()))) for line in state_lines(document))
    return _own("live.html").replace(_TEXT, lines)


def state_lines(document: Mapping[str, Any]) -> Iterable[str]:
    """Say in lines how the range is doing: what a page shows without scripts."""
    yield f"{document['state'].upper()}, rig {document['rig']}, {document['utc'][:19]} UTC, not a safety device"
    if document["virtual"]:
        yield "VIRTUAL: devices are played"
    if document["alert"]:
        yield document["alert"]
    yield f"next shot {document['next_shot']}"
    yield f"next: {document['next_step']['text']}"
    for source in document["sources"]:
        yield f"source {source['name']}: {source['state']}"
    for shot in reversed(document["shots"]):
        yield f"shot {shot['shot']}: {shot['state'].upper()}{_mass_text(shot)}"
        if shot["why"]:
            yield f"- {shot['why']}"
    for notice in reversed(document["notices"]):
        yield f"{notice['utc'][11:19]} {notice['text']}"


def _mass_text(shot: Mapping[str, Any]) -> str:
    from recoil_rigs.tables.specification import mass_decimals

    mass = shot["mass"]
    if mass is None:
        return ", mass to come" if shot["mass_to_come"] else ""
    places = mass_decimals(mass["u"], 1)
    value, low, high = ("-" if one is None else f"{one:.{places}f}" for one in (mass["value"], *mass["U95"]))
    valid = "VALID" if mass["valid"] else f"NOT VALID: {mass['reason']}"
    return f", {value} kg, 95 % {low} to {high}, {valid}"


def replace_text(path: Path, text: str) -> None:
    """Write a text file in one step.

    Raises
    ------
    OSError
        If it cannot be written; on Windows, too, where a reader has it open.
    """
    partial = partial_path(path)
    try:
        partial.write_text(text, encoding="utf-8", newline="\n")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


@functools.cache
def _own(name: str) -> str:
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


@functools.cache
def _report_style() -> str:
    """Return the style of the reports, which is a file: the range loads nothing of the identification."""
    spec = find_spec("recoil_identification")
    places = (spec.submodule_search_locations if spec is not None else None) or []
    return "".join((Path(place) / "report/page/frame.css").read_text(encoding="utf-8") for place in places)
