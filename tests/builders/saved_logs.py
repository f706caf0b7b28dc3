"""Files as a person's program saved them a while ago: what was saved just now is waited for."""

from __future__ import annotations

import os
import time
from pathlib import Path

AGO_S = 60.0


def saved(path: Path, content: str | bytes) -> Path:
    """Write a file in place, as long ago as a person's save usually was."""
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    long_ago(path)
    return path


def long_ago(path: Path) -> None:
    """Date a file as if nobody had written it for a while."""
    then = time.time() - AGO_S
    os.utime(path, (then, then))
