"""MATLAB files of version 7.3, which are HDF5 behind a block of text.

Layout: MathWorks' ``save -v7.3``: each variable is a dataset of the root with the attribute
``MATLAB_class``, axes in MATLAB's order reversed; texts are 16-bit integers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.readers.hdf5.vector import Room, hdf5_file, vector_of
from recoil_acquisition.readers.mat.variable import CELL, LONGEST_TEXT, STRUCTURE, MatContents, MatVariable

MOST_VARIABLES = 5000


def read_mat_v73(path: Path) -> MatContents:
    """List the variables of a file; the numbers of vectors are not read.

    Raises
    ------
    ReadError
        If it unpacks to more than a recording does.
    CorruptFileError
        If it is damaged.
    """
    vectors: list[MatVariable] = []
    scalars: dict[str, float] = {}
    texts: dict[str, str] = {}
    left_out: dict[str, str] = {}
    room = Room(path, path.stat().st_size)
    with path.open("rb") as plain:
        header = plain.read(116).decode("latin-1").rstrip("\0 ")
    with hdf5_file(path) as file:
        if len(file) > MOST_VARIABLES:
            raise ValueError(f"{len(file)} variables")
        for name in file:
            if name.startswith("#"):
                continue
            link = file.get(name, getlink=True)
            item = file[name] if type(link).__name__ == "HardLink" else None
            if item is None or not hasattr(item, "shape"):
                left_out[name] = "a link" if item is None else STRUCTURE.format(name=name)
                continue
            _sort(path, name, item, room, vectors, scalars, texts, left_out)
    return MatContents("7.3", header, tuple(vectors), scalars, texts, left_out)


def _sort(
    path: Path, name: str, item: Any, room: Room,
    vectors: list[MatVariable], scalars: dict[str, float], texts: dict[str, str], left_out: dict[str, str],
) -> None:  # fmt: skip
    label = item.attrs.get("MATLAB_class", b"double")
    kind = label.decode("latin-1") if isinstance(label, bytes) else str(label)
    if "MATLAB_empty" in item.attrs or kind not in {"char", "double", "single", "logical"} | {
        f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
    }:
        other = {"cell": CELL, "struct": STRUCTURE.format(name=name)}
        left_out[name] = "empty" if "MATLAB_empty" in item.attrs else other.get(kind, kind)
        return
    vector = vector_of(path, item, room.size)
    if isinstance(vector, str):
        left_out[name] = vector
        return
    room.take(vector, item.id.get_storage_size())
    if kind == "char":
        if vector.count > LONGEST_TEXT:
            left_out[name] = f"a text of {vector.count} characters"
        else:
            codes = np.asarray(item[()]).reshape(-1)
            texts[name] = codes.astype("<u2").tobytes().decode("utf-16-le", "replace")
    elif vector.count == 1:
        scalars[name] = float(np.asarray(item[()]).reshape(-1)[0])
    else:
        vectors.append(MatVariable(name, vector.count, vector.dtype, vector.stored))
