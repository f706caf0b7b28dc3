"""What `export` prints."""

from __future__ import annotations

from typing import Any

from recoil_acquisition.exporters.publication import ExportedFile
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
                "exact": file.exact,
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
            _numbers(file),
        )
        for file in done.files
    ]  # fmt: skip
    print_table(
        f"Shot {done.shot} on rig {done.rig} as {done.format}",
        ("file", "clock", "channels", "samples", "size", "numbers"),
        rows,
        numeric=(2, 3, 4),
    )
    everywhere = [loss for loss in done.files[0].losses if all(loss in file.losses for file in done.files)]
    for file in done.files:
        for loss in file.losses:
            if loss not in everywhere:
                say(f"lost in {file.path.name}: {loss}")
    for loss in everywhere:
        say(f"lost: {loss}")
    for note in done.notes:
        say(f"note: {note}")
    say(f"-> {done.files[0].path.parent}")


def _numbers(file: ExportedFile) -> str:
    if file.left_out:
        return f"{len(file.left_out)} channels left out"
    return "exact" if file.exact else "rounded"


def size_text(size: int) -> str:
    """Write bytes as people read them."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size} B"
