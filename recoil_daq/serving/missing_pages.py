"""Pages and overviews that a folder lacks: those of a day that no session is writing any more."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from recoil_daq.live.page.page_files import write_pages
from recoil_daq.recording.overview import refresh_overviews


def write_missing(folder: Path) -> list[str]:
    """Write the page on which channels are zoomed, and the overviews that it reads, of a folder of shots.

    Returns
    -------
    list of str
        Lines on what cannot be written, and why; a folder without shot files needs none.
    """
    if not any(folder.glob("[!.]*.h5")):
        return []
    try:
        write_pages(folder)
    except OSError as error:
        return [f"{folder} has no page to zoom in: {error.strerror or error}"]
    return refresh_overviews(folder)


def write_beside(folder: Path, told: Callable[[str], None]) -> None:
    """Begin to write what is missing, while the folder is served; lines on what cannot be written are told."""

    def write() -> None:
        for line in write_missing(folder):
            told(line)

    threading.Thread(target=write, name="write what is missing", daemon=True).start()
