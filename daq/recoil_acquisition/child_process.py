"""Processes of this program's own: started by the modules that are installed, whatever the user's folder holds."""

from __future__ import annotations

import subprocess
import sys
from typing import Any


def own_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs one of our modules.

    With ``-P`` Python does not look for modules in the working folder: a user's file that happens to be named
    ``numpy.py`` or ``daq.py`` is not run. PYTHONPATH, which is the user's will, holds.
    """
    return [sys.executable, "-P", "-m", module, *arguments]


def apart(*, below_normal: bool = False) -> dict[str, Any]:
    """Return what `subprocess` needs to start a process in a group of its own, which Ctrl-C does not reach.

    Parameters
    ----------
    below_normal
        Lower priority from the start; of effect on Windows, elsewhere a running process can be set back.
    """
    if sys.platform == "win32":
        lower = subprocess.BELOW_NORMAL_PRIORITY_CLASS if below_normal else 0
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | lower}
    return {"process_group": 0}
