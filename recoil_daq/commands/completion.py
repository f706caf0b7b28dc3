"""Completions of a shell: names of bundled rigs and rig files, shots of a folder."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import typer

MOST = 200
"""Names that a shell is given at once."""


def complete_rig(incomplete: str) -> list[str]:
    """Return the bundled rigs and the TOML files and folders whose names go on as begun."""
    from recoil_rigs.rig import bundled_rigs

    return [name for name in bundled_rigs() if name.startswith(incomplete)] + _paths(incomplete, ".toml")


def complete_shot(context: typer.Context, incomplete: str) -> list[str]:
    """Return the shots of the folder of --dir, and the shot files and folders whose names go on as begun."""
    folder = Path(context.params.get("folder") or "shots")
    names = [path.stem for path in _listed(folder) if path.suffix == ".h5" and path.stem.startswith(incomplete)]
    return names[:MOST] + _paths(incomplete, ".h5")


def _paths(incomplete: str, suffix: str) -> list[str]:
    """Return files with an ending, and folders, that go on as begun; a folder ends in a slash."""
    begun, _, name = incomplete.rpartition("/")
    folder = Path(f"{begun}/" if begun or incomplete.startswith("/") else ".")
    found = []
    for path in _listed(folder):
        if path.name.startswith(name) and not path.name.startswith("."):
            written = f"{begun}/{path.name}" if "/" in incomplete else path.name
            if path.is_dir():
                found.append(f"{written}/")
            elif path.suffix == suffix:
                found.append(written)
    return found[:MOST]


def _listed(folder: Path) -> Iterable[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return ()
