"""Files of some bytes, opened by a reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import BY_LAYOUT, recognise

RECORDER = Declarations("dewetron")


def open_bytes(reader: Any, name: str, folder: Path, content: bytes | str, declared: Declarations = RECORDER) -> Any:
    """Write a file and open it by a reader; None for that of a rig's source whose kind is its name."""
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    if reader is None:
        kind = declared.clock
        reader = recognise(path, {kind}) if declared.layout is None else BY_LAYOUT[kind]
    return reader.open(path, declared)


def open_table(folder: Path, content: bytes | str, kind: str = "dewetron", **declared: Any) -> Any:
    """Open a table as a rig's source of a kind does; a camera's has a rate of 1 kHz."""
    return open_bytes(None, "a.csv", folder, content, Declarations(kind, **{"frame_rate_hz": 1000.0, **declared}))
