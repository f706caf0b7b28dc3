"""The files that say how an armed range is doing, for whoever looks: ``OUT/live.json``, ``live.js`` and ``live.html``.

Programs read the first. The page is the third, and rereads the second, which is the same document as a script: a page
that was opened from a file may read nothing else.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from pathlib import Path

from recoil_acquisition.files.new_file import remove_partials
from recoil_daq.live.next_step import state_document
from recoil_daq.live.page.page_files import LIVE_PAGE, live_page, replace_text, write_pages
from recoil_daq.live.range_state import RangeState

NAME, SCRIPT = "live.json", "live.js"
PAGE_EVERY_S = 1.0
"""Time between two pages, s: where no script runs a browser asks for it every two."""


class StateFile:
    """Writes the state of a session over that of a moment ago, in one step: a reader has one or the other whole.

    It is not forced to the disk, and a state that cannot be written is left out: the next one follows at once. A reader
    knows by ``utc`` how old it is, which tells a session that was killed.

    Parameters
    ----------
    out
        Folder of the shot files, which no other session writes to.
    """

    def __init__(self, out: Path) -> None:
        self.path = out / NAME
        for name in (NAME, SCRIPT, LIVE_PAGE):
            with contextlib.suppress(OSError):
                remove_partials(out / name)  # of a session that was killed while it wrote
        self._page_s, self._page = -PAGE_EVERY_S, ""

    def write(self, state: RangeState) -> str:
        """Write a state; return why it cannot be written, empty if it was, or a reader on Windows has the file open."""
        try:
            document = state_document(state)
            text = json.dumps(document, allow_nan=False, separators=(",", ":"))
            replace_text(self.path, text)
            replace_text(self.path.with_name(SCRIPT), f"window.live = {text};\n")
            now_s = time.monotonic()
            if now_s - self._page_s >= PAGE_EVERY_S or state.state == "stopped":
                if not self._page:
                    write_pages(self.path.parent)
                page = live_page(document)
                if page != self._page:
                    replace_text(self.path.with_name(LIVE_PAGE), page)
                self._page_s, self._page = now_s, page
        except OSError as error:
            is_open = os.name == "nt" and isinstance(error, PermissionError)
            return "" if is_open else error.strerror or str(error)
        except Exception as error:  # whatever is in a state, showing it ends no recording
            return f"{type(error).__name__}: {error}"
        return ""
