"""Memory that goes back to the system when it is free."""

from __future__ import annotations

import ctypes
from contextlib import suppress

_MMAP_THRESHOLD = -3
"""Number of the option in ``malloc.h`` of the GNU C library."""
LARGE_BYTES = 1 << 17
"""Size from which on a block stands by itself, bytes: the library's own, before it moves."""


def return_large_blocks() -> bool:
    """Have each large block go back to the system as soon as it is free; return whether the C library can be told.

    The GNU C library raises the size from which on it does so with what is freed, mallopt(3). Packets of a recorder
    then lie among small blocks that stay, and of what is free between them a session of days keeps ever more.
    """
    with suppress(AttributeError, OSError, TypeError):
        return bool(ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, LARGE_BYTES))
    return False
