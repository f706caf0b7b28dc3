"""python-can, and cantools with it, loaded without the library of MDF files.

Where asammdf is installed python-can imports it, and it imports pandas and sympy: a second of every command on a rig
with a bus. No MDF file is read or written through python-can here.
"""

from __future__ import annotations

import logging
import sys


def load_can_library() -> None:
    """Import python-can if nobody has yet; to be called before what imports it.

    Its own reader and writer of MDF files say afterwards that asammdf is not installed. A program that wants these
    imports ``can`` first.
    """
    # cantools logs messages of one name, which are told apart here; nobody's log keeps it off the screen
    if not (told := logging.getLogger("cantools")).handlers:
        told.addHandler(logging.NullHandler())
    if "can" in sys.modules or "asammdf" in sys.modules:
        return
    sys.modules["asammdf"] = None  # type: ignore[assignment] # Python's way to say that there is no such module
    try:
        import can  # noqa: F401 - loaded here for those who import it
    finally:
        sys.modules.pop("asammdf", None)
