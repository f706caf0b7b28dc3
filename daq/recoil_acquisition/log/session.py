"""The session that a log states: cut into records where it is written, put together where it is read."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from recoil_acquisition.errors import StoreError
from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.log.record import HEAD_SIZE, OWN, SCHEMA, Kind, Record, pack_json

_PART = 400_000
"""Characters of a session in one record: as JSON within JSON they take twice the bytes at most."""


class SessionText:
    """A session to be written; ValueError or TypeError if it is not JSON."""

    def __init__(self, session: Mapping[str, Any]) -> None:
        text = json.dumps(dict(session), allow_nan=False)
        self._parts = [text[at : at + _PART] for at in range(0, len(text), _PART)]

    @property
    def record_bytes(self) -> int:
        """Bytes of its records, heads included, apart from the digits of the longest wait."""
        return sum(HEAD_SIZE + len(payload) for payload in self.payloads(None))

    def payloads(self, longest_us: int | None, filling: int = 0) -> list[bytes]:
        """Return the payloads of its records, which say the longest wait and span of all records before them too.

        Parameters
        ----------
        filling
            Blanks behind the text, which JSON passes over.
        """
        stated = {"schema": SCHEMA, "longest_us": longest_us}
        parts = [*self._parts[:-1], self._parts[-1] + " " * filling]
        return [pack_json({**stated, "part": i, "of": len(parts), "text": part}) for i, part in enumerate(parts)]


def session_in(records: Iterable[Record]) -> dict[str, Any] | None:
    """Return what the first complete session among some records says; None if there is none.

    Raises
    ------
    StoreError
        If it is of another version of the format.
    """
    parts: dict[int, str] = {}
    for record in records:
        if record.source != OWN or record.kind != Kind.SESSION:
            continue
        try:
            said = record.said
            if said["schema"] != SCHEMA:
                raise StoreError("is a log of another version", expected=SCHEMA, found=str(said["schema"])[:40])
            parts[int(said["part"])] = str(said["text"])
            if len(parts) == said["of"]:
                session = read_json("".join(parts[i] for i in range(len(parts))), finite=False)
                return session if isinstance(session, dict) else None
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
            continue
    return None
