"""asammdf, opened from a stream and kept quiet.

Never from a path: asammdf's reader of mapped files trusts sizes outside of Python. A file that it cannot read it
prints to the terminal, page after page, and closing what it could not open fails a second time, where nobody can catch
it, when it is collected.
"""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Iterator
from contextlib import closing, contextmanager, redirect_stdout
from traceback import walk_tb
from typing import Any


@contextmanager
def opened(stream: io.BufferedIOBase) -> Iterator[Any]:
    """Give asammdf's view of a file; what asammdf would print meanwhile is dropped.

    Parameters
    ----------
    stream : io.BufferedIOBase
        The file's bytes.

    Yields
    ------
    asammdf.MDF

    """
    from asammdf import MDF

    try:
        with _quiet(), closing(MDF(stream)) as file:
            yield file
    except Exception as error:
        _close_what_was_half_opened(error)
        raise


def _close_what_was_half_opened(error: BaseException) -> None:
    for frame, _ in walk_tb(error.__traceback__):
        half_opened: Any = frame.f_locals.get("self")
        if type(half_opened).__name__ == "MDF4" and not half_opened._closed:
            half_opened._closed = True
            half_opened._tempfile.close()


@contextmanager
def _quiet() -> Iterator[None]:
    logger = logging.getLogger("asammdf")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings(), redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)
