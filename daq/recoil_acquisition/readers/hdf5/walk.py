"""A walk over what is in an HDF5 file itself, of which a recording has little: few objects, not deep, few attributes.

A file that somebody made can have a million groups in a megabyte, one within the other, which the library follows
from the root each time. Links to other files, and soft ones, are not followed; each object is met once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

MOST_OBJECTS = 5000
DEEPEST = 32
MOST_ATTRIBUTES = 20_000
"""Attributes of all objects together."""
LARGEST_ATTRIBUTE = 4096
"""Bytes of an attribute that is read."""


class Hdf5ExcessError(ValueError):
    """A file has more in it than a recording has."""


def objects_of(file: Any) -> Iterator[tuple[str, Any]]:
    """Yield the name and the object of each group, dataset and type in an open file; the root has no name.

    Raises
    ------
    Hdf5ExcessError
        If there are too many, they lie too deep, or have too many attributes.
    """
    import h5py

    met: set[int] = set()
    names, listed, attributes = [""], 1, 0
    while names:
        name = names.pop()
        # a dataset that stays open takes 20 kB of the library's memory: it is opened when it is its turn
        item = file[name or "/"]
        address = int(h5py.h5o.get_info(item.id).addr)
        if address in met:
            continue
        met.add(address)
        attributes += len(item.attrs)
        if attributes > MOST_ATTRIBUTES:
            raise Hdf5ExcessError(f"more than {MOST_ATTRIBUTES} attributes")
        yield name, item
        if not isinstance(item, h5py.Group):
            continue
        listed += len(item)
        if listed > MOST_OBJECTS:
            raise Hdf5ExcessError(f"more than {MOST_OBJECTS} groups and datasets")
        if len(item) and name.count("/") >= DEEPEST:
            raise Hdf5ExcessError(f"groups within groups beyond {DEEPEST}")
        inside = [link for link in item if type(item.get(link, getlink=True)) is h5py.HardLink]
        names += [f"{name}/{link}" if name else link for link in reversed(inside)]
