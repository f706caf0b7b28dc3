"""File of a first contact with a recorder: every line of its commands, both ways, and every byte of its stream.

JSON Lines: what the file is; then ``at_s``, ``link`` (``scpi`` or ``stream``), ``from`` (``host`` or ``recorder``) and
``text``, or ``base64`` where it is none. Nobody here has met each recorder there is: what one said can be played back.
"""

from __future__ import annotations

import base64
import json
import threading
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, Self

from recoil_acquisition.errors import StoreError, system_errors_as
from recoil_acquisition.files.new_file import give_name, partial_path

SCHEMA = "recoil-daq/first-contact/1"
KEPT_S = 30.0
"""Time for which a recorder is listened to, s."""
_REMEDY = "give --keep another file, or --overwrite"


class FirstContact:
    """File of what a recorder and this program say to each other between entering and leaving.

    Parameters
    ----------
    path
        The file, which is there whatever ended the talk, unless nothing was said or something could not be written.

    Raises
    ------
    StoreError
        If it is there and not to be replaced, or cannot be written.
    """

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        self.path, self._overwrite = path, overwrite
        self._lock = threading.Lock()
        self._stream: IO[str] | None = None
        self._fault: OSError | None = None
        self._began_s: float | None = None

    def __enter__(self) -> Self:
        if self.path.exists() and not self._overwrite:
            raise self._taken()
        self._partial = partial_path(self.path)
        with system_errors_as(StoreError, self.path, "written", _REMEDY):
            self._stream = self._partial.open("x", encoding="utf-8", newline="\n")
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._lock:
            stream, self._stream = self._stream, None
        if stream is None:
            return
        try:
            with system_errors_as(StoreError, self.path, "written", _REMEDY):
                stream.close()
                if self._fault is not None:
                    raise self._fault
                if self._began_s is not None:
                    give_name(self._partial, self.path, overwrite=self._overwrite)
        except StoreError as error:
            if kind is None:  # else it is not what went wrong
                raise self._taken() if isinstance(error.__cause__, FileExistsError) else error from error.__cause__
        finally:
            self._partial.unlink(missing_ok=True)

    def begin(self, rig: str, source: str) -> None:
        """Say whose talk it is; times count from here."""
        self._began_s = time.monotonic()
        utc = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        self._write({"schema": SCHEMA, "rig": rig, "source": source, "utc": utc})

    def heard(self, link: str, sender: str, data: bytes) -> None:
        """Write what was said on a connection; a device that reads is never troubled by a disk that fails."""
        row = {"at_s": round(time.monotonic() - (self._began_s or 0.0), 6), "link": link, "from": sender}
        self._write(row | (_text_of(data) if link == "scpi" else _bytes_of(data)))

    def _write(self, row: dict[str, Any]) -> None:
        with self._lock:
            if self._stream is None or self._fault is not None:
                return
            try:
                self._stream.write(json.dumps(row, ensure_ascii=False) + "\n")
            except OSError as error:
                self._fault = error

    def _taken(self) -> StoreError:
        return StoreError.exists(self.path, _REMEDY, "the file")


def _text_of(data: bytes) -> dict[str, Any]:
    try:
        return {"text": data.decode()}
    except UnicodeDecodeError:
        return _bytes_of(data)


def _bytes_of(data: bytes) -> dict[str, Any]:
    return {"base64": base64.b64encode(data).decode()}
