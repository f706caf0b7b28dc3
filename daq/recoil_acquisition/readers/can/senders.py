"""The senders of a log's messages of SAE J1939: each has a message of its own, known by its parameter group."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from recoil_acquisition.readers.can.frames import EXTENDED, CanLog, key_of
from recoil_acquisition.readers.can.messages import CanDatabase, identifier_text
from recoil_acquisition.readers.can.parameter_groups import PRIORITY, addresses, group_of, is_j1939, message_of
from recoil_acquisition.remark import Note, NoteCode

_MOST_SHOWN = 8


def by_sender(database: CanDatabase, log: CanLog) -> tuple[CanDatabase, CanLog]:
    """Return a database and a log in which every message of J1939 is of one sender, and goes by one identifier.

    What a log holds of a group from one sender alone, who is another than the database has, is its message; what it
    holds from several is a message of each, ``Message#identifier``, and that of the database's own sender keeps its
    name. Of a group that is several messages in the database, those of their own senders are known alone.
    """
    groups: dict[int, list[Any]] = {}
    for message in database.messages:
        if is_j1939(message):
            groups.setdefault(group_of(message.frame_id), []).append(message)
    if not groups:
        return database, log
    own = {*map(key_of, database.messages), *(one.key for one in database.faulty)}
    keys, places = np.unique(log.frames.key, return_inverse=True)
    others: dict[int, dict[int, list[int]]] = {}
    for key in keys.tolist():
        if key & EXTENDED and key not in own:
            meant = message_of(groups.get(group_of(key), ()), key & ~EXTENDED)
            if meant is not None:
                others.setdefault(key_of(meant), {}).setdefault(key & ~PRIORITY, []).append(key)
    if not others:
        return database, log
    known_as: dict[int, int] = {}
    messages: list[Any] = []
    named: list[str] = []
    for message in database.messages:
        key = key_of(message)
        senders = others.get(key, {})
        same = senders.pop(key & ~PRIORITY, [])
        known_as |= dict.fromkeys(same, key)
        is_there = bool(same) or key in keys
        if is_there or not senders:
            messages.append(message)
        for several in senders.values():
            of_sender = copy(message)
            of_sender.frame_id = several[0] & ~EXTENDED
            if is_there or len(senders) > 1:
                of_sender.name = f"{message.name}#{identifier_text(several[0])}"
            messages.append(of_sender)
            known_as |= dict.fromkeys(several, several[0])
            named.append(f"{of_sender.name} {addresses(of_sender.frame_id)}")
    notes = log.notes
    if named:
        more = f" and {len(named) - _MOST_SHOWN} more" if len(named) > _MOST_SHOWN else ""
        text = (
            "messages known by their parameter group (J1939), from another address than the database has: "
            + ", ".join(named[:_MOST_SHOWN])
            + more
        )
        notes = (*notes, Note(NoteCode.NAMES, None, text))
    key = np.array([known_as.get(one, one) for one in keys.tolist()], log.frames.key.dtype)[places]
    frames = replace(log.frames, key=key)
    return replace(database, messages=tuple(messages)), replace(log, frames=frames, notes=notes)
