"""Kind of an HDF5 file, tracks of a camera or measured channels, as far as its names show."""

from __future__ import annotations

from pathlib import Path
from typing import Any

SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""First bytes of an HDF5 file (HDF5 File Format Specification, superblock)."""
SLEAP_NAMES = ("tracks", "node_names", "track_names")
"""Datasets of an analysis file of SLEAP."""


def names_beyond_head(head: bytes) -> bool:
    """Return whether the root group's names (its local heap, HDF5 format III.D) lie behind the first bytes."""
    heap = head.find(b"HEAP")
    # the address of the names stands 24 bytes behind the heap's signature; byte 13 is the size of addresses
    if heap < 0 or head[13] != 8 or len(head) < heap + 32:
        return False
    return int.from_bytes(head[heap + 24 : heap + 32], "little") >= len(head)


def is_in_file(file: Any, name: str) -> bool:
    """Return whether an open file itself has an object of a name: what a link leads to may be any other file."""
    return type(file.get(name, getlink=True)).__name__ == "HardLink"


def is_sleap_file(path: Path) -> bool:
    """Return whether a file is an analysis of SLEAP by its names; False where they cannot be read."""
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            return all(is_in_file(file, name) for name in SLEAP_NAMES)
    except Exception:
        return False
