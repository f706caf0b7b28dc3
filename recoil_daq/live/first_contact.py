"""A kept conversation with a recorder: every line of its commands and every byte of its stream, with their times.

No real recorder was met when its client was written: such a file of one that does otherwise says what it does. It is
JSON in lines: the first says what it is of, each further one what was said, when, by whom and on which connection.
"""

from __future__ import annotations

import base64
import datetime as dt
import json
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import StoreError, system_errors_as
from recoil_acquisition.files.new_file import give_name, partial_path

SCHEMA = "recoil-daq/first-contact/1"
KEPT_S = 30.0
"""Time for which a conversation is kept, s."""
MOST_BYTES = 1 << 30
"""Bytes of a file, beyond which it ends: half a minute of 64 channels of 200 kHz."""


class FirstContact:
    """Keeps what a recorder and its host say to each other.

    Parameters
    ----------
    rig, source
        Names of both.
    """

    def __init__(self, rig: str, source: str) -> None:
        self._began_s = time.monotonic()
        self._lock = threading.Lock()
        self._size = 0
        head = {"schema": SCHEMA, "rig": rig, "source": source, "utc": dt.datetime.now(dt.UTC).isoformat()}
        self._lines = [json.dumps(head)]

    def keep(self, link: str, who: str, content: bytes) -> None:
        """Keep what was said on a connection, ``scpi`` or ``stream``, by the ``host`` or the ``recorder``."""
        said: dict[str, Any] = {"at_s": round(time.monotonic() - self._began_s, 6), "link": link, "from": who}
        with suppress(UnicodeDecodeError):
            said |= {"text": content.decode()} if link == "scpi" else {}
        if "text" not in said:
            said["base64"] = base64.b64encode(content).decode()
        line = json.dumps(said, ensure_ascii=False)
        with self._lock:
            if self._size < MOST_BYTES:
                self._lines.append(line)
                self._size += len(line)

    def write(self, path: Path, *, overwrite: bool) -> None:
        """Write the file, whole or not at all; StoreError if it is there already, or cannot be written."""
        part = partial_path(path)
        with self._lock, system_errors_as(StoreError, path, "written"):
            try:
                part.write_text("\n".join(self._lines) + "\n", encoding="utf-8")
                give_name(part, path, overwrite=overwrite)
            finally:
                part.unlink(missing_ok=True)
