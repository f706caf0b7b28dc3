"""The groups and datasets of an HDF5 file, and what its attributes say of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.containers.time_axis import unit_in_time_name
from recoil_acquisition.readers.hdf5.attributes import plain_attributes
from recoil_acquisition.readers.hdf5.vector import Hdf5Vector, Room, column_vectors, record_vectors, vector_of
from recoil_acquisition.readers.hdf5.walk import Hdf5ExcessError, objects_of
from recoil_acquisition.readers.statements import folded

_STARTING_TIME = "starting_time"
"""Dataset of one number that in NWB states the first instant, s, and by its attribute `rate` the rate, Hz."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """A dataset of numbers along one axis.

    Attributes
    ----------
    own
        Attributes of the dataset itself.
    above
        Attributes of the groups it is in, the nearest one first.
    scale
        Name of its dimension scale; None if it has none.
    """

    vector: Hdf5Vector
    own: Mapping[str, Any]
    above: Sequence[Mapping[str, Any]]
    scale: str | None

    @property
    def group(self) -> str:
        """Name of the group it is in."""
        return self.vector.name.rpartition("/")[0]

    @property
    def label(self) -> str:
        """Its name, for people."""
        return self.vector.name.lstrip("/")


@dataclass(frozen=True, eq=False)
class Contents:
    """Contents of a file.

    Attributes
    ----------
    groups
        Attributes of every group by its name, that of the root empty.
    time_names
        Names of the datasets that are times: by their own names, or as the scale of another.
    left_out
        Reasons why datasets are none of numbers, by their names.
    """

    groups: Mapping[str, Mapping[str, Any]]
    datasets: tuple[Dataset, ...]
    time_names: frozenset[str]
    left_out: Mapping[str, str]


def contents_of(path: Path, file: Any) -> Contents:
    """List what an open file holds; no samples are read.

    Raises
    ------
    ReadError
        If it holds too many objects to be a recording, or unpacks to more than one does.
    CorruptFileError
        If its datasets take more bytes than it has.
    """
    groups: dict[str, dict[str, Any]] = {}
    names: list[str] = []
    try:
        for name, item in objects_of(file):
            if not hasattr(item, "dtype"):
                groups[f"/{name}" if name else ""] = plain_attributes(item)
            elif hasattr(item, "shape"):  # a type that has a name of its own has none
                names.append(name)
    except Hdf5ExcessError as error:
        raise ReadError(str(error), path=path, remedy="export channels alone") from error
    size = path.stat().st_size
    room = Room(path, size)
    datasets: list[Dataset] = []
    left_out: dict[str, str] = {}
    for name in names:
        item = file[name]
        if item.dtype.names and item.shape is not None:
            datasets += _fields(path, name, item, groups, room, left_out)
            continue
        if item.shape == () and name.rpartition("/")[2] == _STARTING_TIME and "rate" in item.attrs:
            above = "/" + name.rpartition("/")[0] if "/" in name else ""
            rate = plain_attributes(item, ("rate",))
            groups[above].update(rate, time_offset=float(item[()]))
            continue
        if columns := column_vectors(path, item, size):
            datasets += _columns(columns, item, groups, room)
            continue
        vector = vector_of(path, item, size)
        if isinstance(vector, str):
            left_out[name] = vector
        else:
            room.take(vector, item.id.get_storage_size())
            datasets.append(_dataset(vector, item, groups))
    times = {d.vector.name for d in datasets if unit_in_time_name(d.vector.name.rpartition("/")[2]) is not None}
    times |= {d.scale for d in datasets if d.scale}
    return Contents(groups, tuple(datasets), frozenset(times), left_out)


def _fields(
    path: Path, name: str, item: Any, groups: Mapping[str, Mapping[str, Any]], room: Room, left_out: dict[str, str]
) -> list[Dataset]:
    """Return the fields of records as datasets in a group of the records' name."""
    vectors = record_vectors(path, item, room.size)
    if isinstance(vectors, str):
        left_out[name] = vectors
        return []
    stored, said = item.id.get_storage_size(), plain_attributes(item)
    found = []
    for vector in vectors:
        if isinstance(vector, tuple):
            left_out[vector[0].lstrip("/")] = vector[1]
            continue
        room.take(vector, stored)
        stored = 0  # which is that of all fields
        units = {folded(vector.field) + ending for ending in ("unit", "units")}
        unit = next((value for key, value in said.items() if folded(key) in units), None)
        own = {} if unit is None else {"unit": unit}
        found.append(Dataset(vector, own, [said, *_above(vector.name, groups)[1:]], None))
    return found


def _columns(
    columns: Sequence[Hdf5Vector], item: Any, groups: Mapping[str, Mapping[str, Any]], room: Room
) -> list[Dataset]:
    """Return the columns of a matrix as datasets in a group of its name, which has its attributes."""
    room.take(columns[0], item.id.get_storage_size())
    above = [plain_attributes(item), *_above(columns[0].name, groups)[1:]]
    return [Dataset(vector, {}, above, None) for vector in columns]


def _dataset(vector: Hdf5Vector, item: Any, groups: Mapping[str, Mapping[str, Any]]) -> Dataset:
    scales = [s.name for s in item.dims[vector.axis].values() if s.name] if len(item.dims) else []
    scale = scales[0] if scales and scales[0] != vector.name else None
    return Dataset(vector, plain_attributes(item), _above(vector.name, groups), scale)


def _above(name: str, groups: Mapping[str, Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the attributes of the groups that an object is in, the nearest first."""
    parts = name.split("/")[:-1]
    return [groups.get("/".join(parts[:n]), {}) for n in range(len(parts), 0, -1)]
