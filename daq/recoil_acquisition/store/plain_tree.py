"""A shot file's tree in memory, made of what `recoil_acquisition.store.file_tree` wrote of it: no library, no file."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Dataset:
    """An array, or texts, with its attributes.

    Parameters
    ----------
    values
        None where the samples were not asked for.
    """

    def __init__(
        self, name: str, attrs: dict[str, Any], shape: tuple[int, ...], dtype: np.dtype[Any], values: Any
    ) -> None:
        self.name, self.attrs, self.shape, self.dtype = name, attrs, shape, dtype
        self._values = values

    def __getitem__(self, key: tuple[()]) -> Any:
        if key != ():
            raise TypeError(f"{self.name} is a dataset, not a group")
        if self._values is None:
            raise ValueError(f"{self.name} is larger than any of its kind")
        return self._values[()]

    def asstr(self) -> Dataset:
        """Return itself if it holds texts; TypeError if not."""
        if self.dtype.kind != "O":
            raise TypeError(f"{self.name} holds no text")
        return self


class Group(dict[str, Any]):
    """Groups and datasets by name, with attributes."""

    def __init__(self, name: str, attrs: dict[str, Any]) -> None:
        super().__init__()
        self.name, self.attrs = name, attrs

    def __missing__(self, key: object) -> Any:
        raise KeyError(f"{self.name} has no {key!r}")


def last_word(content: bytearray) -> dict[str, Any]:
    """Return the last word of what was written; ValueError if it broke off."""
    size = int.from_bytes(content[-8:], "little")
    word = json.loads(bytes(content[-8 - size : -8])) if 0 < size <= len(content) - 8 else None
    if not isinstance(word, dict):
        raise ValueError("the reading broke off")
    return word


def tree_of(content: bytearray) -> Group:
    """Make the tree of what was written; the arrays lie in it as they came."""
    size = int.from_bytes(content[:8], "little")
    nodes = json.loads(bytes(content[8 : 8 + size]))
    made = [_made(node, content, 8 + size) for node in nodes]
    for node, item in zip(nodes, made, strict=True):
        if isinstance(item, Group):
            item.update({key: made[place] for key, place in node["items"].items()})
    root = made[0]
    if not isinstance(root, Group):
        raise TypeError("the root is no group")
    return root


def _made(node: dict[str, Any], content: bytearray, start: int) -> Group | Dataset:
    name, attrs = node["name"], node["attributes"]
    if "items" in node:
        return Group(name, attrs)
    shape = tuple(node["shape"])
    if "texts" in node:
        texts: NDArray[Any] = np.empty(len(node["texts"]), dtype=object)
        texts[:] = node["texts"]
        return Dataset(name, attrs, shape, texts.dtype, texts.reshape(shape))
    dtype = np.dtype(node["dtype"])
    if "at" not in node:
        return Dataset(name, attrs, shape, dtype, None)
    count = int(np.prod(shape, dtype=np.int64))
    values = np.frombuffer(content, dtype, count, start + node["at"]).reshape(shape)
    return Dataset(name, attrs, shape, dtype, values.astype(dtype.newbyteorder("="), copy=False))
