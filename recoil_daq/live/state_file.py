"""The file that says how an armed range is doing, for whoever looks from another process: ``OUT/live.json``."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path

from recoil_acquisition.files.new_file import partial_path, remove_partials
from recoil_daq.live.next_step import state_document
from recoil_daq.live.range_state import RangeState

NAME = "live.json"


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
        with contextlib.suppress(OSError):
            remove_partials(self.path)  # of a session that was killed while it wrote
        self._partial = partial_path(self.path)

    def write(self, state: RangeState) -> str:
        """Write a state; return why it cannot be written, empty if it was, or a reader on Windows has the file open."""
        text = json.dumps(state_document(state), allow_nan=False, separators=(",", ":"))
        try:
            self._partial.write_text(text, encoding="ascii", newline="\n")
            self._partial.replace(self.path)
        except OSError as error:
            with contextlib.suppress(OSError):
                self._partial.unlink(missing_ok=True)
            is_open = os.name == "nt" and isinstance(error, PermissionError)
            return "" if is_open else error.strerror or str(error)
        return ""
