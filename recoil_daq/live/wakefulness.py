"""The computer kept awake while a range is armed: one that sleeps records nothing."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress

ASLEEP = "this computer cannot be kept awake from here, and records nothing while it sleeps"
REMEDY = "switch its sleep off in its settings"


@contextmanager
def kept_awake(say: Callable[[str], None]) -> Iterator[None]:
    """Keep the computer awake meanwhile, by what its system has for it; where that fails, say so once and go on.

    It is wakepy's to do: Windows' execution state, ``caffeinate`` of macOS, on Linux the session of a desktop. A lid
    that is closed and a key for sleep go before all of these.
    """
    awake, why = ExitStack(), ""
    try:
        from wakepy import keep

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            active = awake.enter_context(keep.running(on_fail="pass")).active
    except Exception as error:  # whatever a desktop answers, it keeps no range from being armed
        active, why = False, f" ({type(error).__name__}: {error})"
    if not active:
        say(f"{ASLEEP}{why}: {REMEDY}")
    try:
        yield
    finally:
        with suppress(Exception):  # the desktop may be gone by now
            awake.close()
