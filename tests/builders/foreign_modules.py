"""A user's folder whose files bear the names of modules, each of which leaves a mark where it is imported."""

from __future__ import annotations

from pathlib import Path

NAMES = ("numpy", "daq", "processing", "identification", "rigs", "recoil_daq", "logging", "json", "h5py", "re")


def hostile_folder(folder: Path) -> Path:
    """Make the folder, and return it."""
    folder.mkdir()
    for name in NAMES:
        mark = folder / f"{name}.was_run"
        (folder / f"{name}.py").write_text(f"open({str(mark)!r}, 'w').close()\n", encoding="utf-8")
    return folder


def modules_run(folder: Path) -> set[str]:
    """Return the names of its modules that were imported."""
    return {path.stem for path in folder.glob("*.was_run")}
