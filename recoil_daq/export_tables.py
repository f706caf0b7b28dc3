"""What `export` prints."""

from __future__ import annotations

from typing import Any

from recoil_daq.export import Exported
from recoil_daq.tables import print_table, say


def export_document(done: Exported) -> dict[str, Any]:
    """Build the document of ``export --json``."""
    return {
        "schema": "recoil-daq/exported/1",
        "shot": done.shot,
        "rig": done.rig,
        "format": done.format,
        "aligned": done.aligned,
        "complete": done.complete,
        "files": [
            {
                "file": str(file.path),
                "clocks": list(file.clocks),
                "channels": list(file.channels),
                "samples": file.samples,
                "bytes": file.size,
                "exact": not file.losses,
                "losses": list(file.losses),
                "left_out": list(file.left_out),
            }
            for file in done.files
        ],
        "notes": list(done.notes),
    }


def print_exported(done: Exported) -> None:
    """Print a row per file, what each lost, and what concerns all of them."""
    rows = [
        (
            file.path.name, ", ".join(file.clocks), str(len(file.channels)), str(file.samples), size_text(file.size),
            "exact" if not file.losses else "see below",
        )
        for file in done.files
    ]  # fmt: skip
    print_table(
        f"Shot {done.shot} on rig {done.rig} as {done.format}",
        ("file", "clock", "channels", "samples", "size", "numbers"),
        rows,
        numeric=(2, 3, 4),
    )
    for file in done.files:
        for loss in file.losses:
            say(f"lost in {file.path.name}: {loss}")
    for note in done.notes:
        say(f"note: {note}")
    say(f"-> {done.files[0].path.parent}")


def size_text(size: int) -> str:
    """Write bytes as people read them."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size} B"
