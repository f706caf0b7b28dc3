"""npTDMS, kept from writing to the screen: what it warns of, damage and cut ends, a recording's notes say."""

from __future__ import annotations

import logging
from typing import Any


def tdms_library() -> Any:
    """Return the library, imported when a file is opened; its own handler of the standard error is shut.

    What a program's own handlers take from its loggers is left as it is.
    """
    import nptdms
    from nptdms.log import log_manager

    log_manager.console_handler.setLevel(logging.CRITICAL + 1)
    return nptdms
