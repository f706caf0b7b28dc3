"""Files forced to the disk itself, and not only out of this computer's memory."""

from __future__ import annotations

import os
from collections.abc import Callable

try:
    from fcntl import F_FULLFSYNC, fcntl  # type: ignore[attr-defined,unused-ignore]  # macOS alone has it

    _whole: Callable[[int], object] | None = lambda descriptor: fcntl(descriptor, F_FULLFSYNC)  # noqa: E731
except ImportError:
    _whole = None


def sync(descriptor: int) -> None:
    """Force an open file to the disk; OSError if it cannot be.

    On macOS ``fsync`` leaves it in the memory of the drive, which goes with the power; file systems without the call
    that empties that (shares, some sticks) get what ``fsync`` does.
    """
    if _whole is not None:
        try:
            _whole(descriptor)
        except OSError:
            pass  # a disk that fails fails the next call, too
        else:
            return
    os.fsync(descriptor)


def sync_data(descriptor: int) -> None:
    """Force the content of an open file to the disk, and of what describes it as much as its reader needs."""
    if _whole is None and hasattr(os, "fdatasync"):
        os.fdatasync(descriptor)
    else:
        sync(descriptor)
