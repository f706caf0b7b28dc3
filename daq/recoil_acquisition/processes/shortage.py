"""A shortage of memory or threads: what shows it, and how much address space this process may have.

Libraries meet a shortage in ways of their own: numpy with a MemoryError, the loader of a library with an ImportError,
the interpreter with a RuntimeError where no thread can be started. OpenBLAS, which numpy and scipy bring with them,
asks the system for memory again and again, for ever: whoever starts with too little must be told before it is loaded.
"""

from __future__ import annotations

import errno
import sys

from recoil_acquisition.errors import ShortageError

LEAST_BYTES = 750_000_000
"""Address space with which no command was seen to run short: from 450 to 600 MB on they do, each at another place."""
REMEDY = "close other programs, or raise the limit of this process (`ulimit -v`)"
_NUMBERS = frozenset({errno.ENOMEM, errno.EAGAIN})
_NO_THREAD = "can't start new thread"
"""Message of CPython where no thread can be started: its RuntimeError has nothing else to be known by."""


def address_space_bytes() -> int | None:
    """Return the limit of this process's address space; None if there is none, or the system has no such thing."""
    if sys.platform == "win32":
        return None
    import resource

    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def check_address_space() -> None:
    """Refuse to start with too little.

    Raises
    ------
    ShortageError
        If this process may not have `LEAST_BYTES`.
    """
    limit = address_space_bytes()
    if limit is not None and limit < LEAST_BYTES:
        raise ShortageError(
            "this process may use too little address space", expected=f"at least {LEAST_BYTES / 1e6:.0f} MB",
            found=f"a limit of {limit / 1e6:.0f} MB", remedy="raise it, `ulimit -v unlimited`",
        )  # fmt: skip


def is_shortage(error: BaseException) -> bool:
    """Return whether an error comes of a shortage of memory or threads."""
    if isinstance(error, ImportError):
        # a library that is there and cannot be mapped; without a limit it is another fault
        return bool(error.path) and not str(error.path).endswith(".py") and address_space_bytes() is not None
    if isinstance(error, OSError):
        return error.errno in _NUMBERS
    return isinstance(error, MemoryError) or (isinstance(error, RuntimeError) and str(error) == _NO_THREAD)


def shortage_of(error: BaseException) -> ShortageError:
    """Return the one line of a shortage that an error came of."""
    said = " ".join(str(error).split())[:160]
    found = f"{type(error).__name__}: {said}" if said else type(error).__name__
    return ShortageError("there is not enough memory", found=found, remedy=REMEDY)
