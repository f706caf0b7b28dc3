"""Names, texts and small tables inside a shot file.

A table is a group with one dataset per column and a dimension scale ``row``, because a netCDF
reader refuses, or warns about, a dataset whose dimension has no name.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def new_group(parent: Any, name: str, nx_class: str) -> Any:
    """Create a group of a NeXus class."""
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    return group


def tree_names(names: Iterable[str], reserved: Iterable[str]) -> list[str]:
    """Make distinct names of letters, digits and underscores, which HDF5, netCDF and NeXus all allow."""
    taken = {name.casefold() for name in reserved}
    made = []
    for name in names:
        stem = re.sub(r"[^A-Za-z0-9_]", "_", name) or "_"
        candidate, k = stem, 1
        while candidate.casefold() in taken:
            k += 1
            candidate = f"{stem}_{k}"
        taken.add(candidate.casefold())
        made.append(candidate)
    return made


def write_text(group: Any, name: str, text: str) -> None:
    """Write one text of any length; an attribute would end at 64 KiB."""
    import h5py

    group.create_dataset(name, data=text, dtype=h5py.string_dtype(), track_times=False)


def read_text(group: Any, name: str) -> str:
    """Read a text that `write_text` wrote."""
    return str(group[name].asstr()[()])


def write_table(group: Any, columns: Mapping[str, Sequence[str] | NDArray[np.int64]]) -> None:
    """Write columns of equal length, of texts or of integers; no datasets at all for no rows."""
    import h5py

    count = len(next(iter(columns.values())))
    if count == 0:
        return
    row = group.create_dataset("row", data=np.arange(count, dtype=np.int32), track_times=False)
    row.make_scale("row")
    row.attrs["units"] = "1"
    for name, values in columns.items():
        if isinstance(values, np.ndarray):
            column = group.create_dataset(name, data=values, track_times=False)
            column.attrs["units"] = "1"
        else:
            column = group.create_dataset(name, data=list(values), dtype=h5py.string_dtype(), track_times=False)
        column.dims[0].attach_scale(row)


def read_table(group: Any, names: Sequence[str], integers: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Read the named columns of a table as rows of texts, and of integers where so named.

    Raises
    ------
    KeyError, TypeError
        If a column is missing, or of another kind.
    """
    if "row" not in group:
        return []
    columns = []
    for name in names:
        dataset = group[name] if name in integers else group[name].asstr()
        if name in integers and dataset.dtype.kind not in "iu":
            raise TypeError(f"{dataset.name} holds no integers")
        columns.append(dataset[()].tolist())
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def json_text(value: Any) -> str:
    """Write JSON types, NumPy scalars among them, as one line of JSON.

    Raises
    ------
    TypeError
        If something is not of a JSON type.
    """
    return json.dumps(value, default=_json_type, ensure_ascii=False)


def finite(value: Any) -> Any:
    """Return JSON types in which a number that is not finite is None."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _json_type(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{value!r} of type {type(value).__name__} has no place in JSON")
