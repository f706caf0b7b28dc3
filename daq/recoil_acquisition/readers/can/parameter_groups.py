"""Parameter groups of SAE J1939: what a message is, whoever sent it and with whatever priority.

Layout (SAE J1939-21): of the 29 bits of an identifier the lowest 8 are the address of the sender; above them stand 8
bits that belong to the number of the group where the 8 above those are 240 or more, and else are the address of whom
the message is for; above these two bits of the group's page and three of the priority. An address of 254 is nobody's
(J1939-81): databases write it for any.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

PRIORITY = 7 << 26
"""Bits of an identifier that are no part of its group, nor an address."""
ANYBODY = 254
_BROADCAST = 240
"""Least number of a format whose messages are for all."""
_IDENTIFIED = re.compile(r"([^#]+)#0x([0-9A-Fa-f]{8})\.(.+)")


def is_j1939(message: Any) -> bool:
    """Return whether a message of a parsed database is one of SAE J1939, which a DBC file says by its VFrameFormat."""
    return bool(message.protocol == "j1939" and message.is_extended_frame)


def group_bits(identifier: int) -> int:
    """Return which bits of an identifier say its group."""
    return 0x3FFFF00 if _is_for_all(identifier) else 0x3FF0000


def group_of(identifier: int) -> int:
    """Return an identifier's group: the bits that say it, at their place."""
    return identifier & group_bits(identifier)


def _is_for_all(identifier: int) -> bool:
    return identifier >> 16 & 0xFF >= _BROADCAST


def addresses(identifier: int) -> str:
    """Return who sent a message, and whom it is for where it is not for all."""
    sender = f"from 0x{identifier & 0xFF:02X}"
    return sender if _is_for_all(identifier) else f"{sender} to 0x{identifier >> 8 & 0xFF:02X}"


def name_in_group(message: Any) -> str:
    """Return the name that the database has for a message, of which a sender's own one is ``name#identifier``."""
    return str(message.name).partition("#")[0] if is_j1939(message) else str(message.name)


def split_identified(name: str) -> tuple[str, int] | None:
    """Return the signal and the identifier that a name such as ``Message#0x18F00403.Signal`` states; else None."""
    found = _IDENTIFIED.fullmatch(name)
    return None if found is None else (f"{found[1]}.{found[3]}", int(found[2], 16))


def message_of(messages: Sequence[Any], identifier: int) -> Any | None:
    """Return which message of one group an identifier is that none of them has; None if that is open."""
    sender = identifier & ~PRIORITY
    for meant in (
        [one for one in messages if one.frame_id & ~PRIORITY == sender],
        messages,
        [one for one in messages if one.frame_id & 0xFF == ANYBODY],
    ):
        if len(meant) == 1:
            return meant[0]
    return None


class Sender:
    """Whoever sends a message: who has its identifier, or is heard first of its group if nobody has its address.

    Parameters
    ----------
    key
        Identifier of the message, with bit 31 for 29 bits.
    of_group
        Whether its priority may be another.
    is_any
        Whether another address may send it.
    """

    def __init__(self, key: int, *, of_group: bool = False, is_any: bool = False) -> None:
        self._ignored = np.uint32(PRIORITY if of_group else 0)
        self._known = np.uint32(key) & ~self._ignored
        self._bits = np.uint32(group_bits(key) | 1 << 31)
        self._heard: np.uint32 | None = None if is_any else self._known

    def sent(self, keys: NDArray[np.uint32]) -> NDArray[np.bool_]:
        """Return which frames are its, by their identifiers with bit 31, shape (n_frames,)."""
        senders = keys & ~self._ignored
        if self._heard != self._known:
            of_group = senders[keys & self._bits == self._known & self._bits]
            if (of_group == self._known).any():
                self._heard = self._known
            elif self._heard is None and of_group.size:
                self._heard = of_group[0]
        return np.asarray(senders == (self._known if self._heard is None else self._heard), bool)
