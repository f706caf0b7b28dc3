"""The tree of a shot file, read with care, written as plain values, and made again of those.

The HDF5 library was not made for damaged files: of shot files in which twenty bytes are changed it ends the process
that reads them, more often than not. So this runs in a process of its own
(`recoil_acquisition.processes.reader_process`), which writes another what it found, as bytes: a document of the tree
in JSON, the arrays one behind the other, and a last word. Of these bytes `tree_of` makes the tree in memory, without
the library and without the file.

Nothing is followed that leads out of the file, and nothing is read before all of it is known to be no larger than a
file of that size may hold.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.processes.reader_process import most_bytes
from recoil_acquisition.store.seal import CHANGED, DIGEST, SEAL, seal_of


class Dataset:
    """An array, or texts, with its attributes.

    Parameters
    ----------
    values
        Samples; None where they were not asked for.
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
    """Groups and datasets by name, with attributes; of the root also what was changed since the file was sealed."""

    def __init__(self, name: str, attrs: dict[str, Any], changed: str = "") -> None:
        super().__init__()
        self.name, self.attrs, self.changed = name, attrs, changed

    def __missing__(self, key: object) -> Any:
        raise KeyError(f"{self.name} has no {key!r}")


def last_word(content: bytearray) -> dict[str, Any]:
    """Return the last word of what was written; ValueError if it broke off."""
    size = int.from_bytes(content[-8:], "little")
    word = json.loads(bytes(content[-8 - size : -8])) if 0 < size <= len(content) - 8 else None
    if not isinstance(word, dict):
        raise ValueError("the reading broke off")
    return word


def tree_of(content: bytearray, changed: str = "") -> Group:
    """Make the tree of what was written; the arrays lie in it as they came. ``changed`` goes to the root."""
    size = int.from_bytes(content[:8], "little")
    nodes = json.loads(bytes(content[8 : 8 + size]))
    made = [_made(node, content, 8 + size) for node in nodes]
    for node, item in zip(nodes, made, strict=True):
        if isinstance(item, Group):
            item.update({key: made[place] for key, place in node["items"].items()})
    root = made[0]
    if not isinstance(root, Group):
        raise TypeError("the root is no group")
    root.changed = changed
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


LARGEST_CHUNK_BYTES = 16 << 20
DEEPEST = 8
MOST_OBJECTS, MOST_ATTRIBUTES = 50_000, 1000
"""Most objects of a file, and attributes of each: looking for one takes the longer the more there are."""
SMALL_BYTES = 1 << 16
"""Arrays up to this size are read with the headers; those of the samples are larger, or not of interest then."""

PARTS: dict[str, dict[str, tuple[str, ...]]] = {
    "schema": {"": ()},
    "origin": {"": ("entry",), "/entry": ("entry_identifier", "inputs", "history")},
}
"""Parts of a group that are looked at, by its name, where not all of the tree is."""

WHOLE = ("headers", "all")
"""Parts that a seal can be asked of."""
ALIGNMENT = 16
_FILTERS = (h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32)
_PIECE, _TEXTS = 1 << 16, 8


def write_tree(path: Path, what: str, write: Callable[[bytes], object]) -> None:
    """Write what is in a file: ``schema``, the root's attributes alone; ``origin``; ``headers``; or ``all`` of it.

    Whatever goes wrong is in the last word: ``{"fault": "..."}`` in place of ``{}``, and its length in 8 bytes. A seal
    that does not fit is no fault, so that what is wrong can be told more closely: ``{"changed": "..."}``.
    """
    last: dict[str, str] = {}
    try:
        size = path.stat().st_size
        # A shot file never changes once it has its name, so no lock is needed, and some network drives have none
        with h5py.File(path, "r", locking=False) as file:
            last = {"changed": _Tree(file, what, most_bytes(size)).write_to(write)}
    except MemoryError:
        last = {"fault": "it asks for more memory than a shot file of its size needs"}
    except Exception as error:  # the library's binding raises what it likes
        last = {"fault": " ".join(str(error.args[0] if error.args else error).split()) or type(error).__name__}
    word = json.dumps(last).encode()
    write(word + len(word).to_bytes(8, "little"))


def seal(file: Any) -> None:
    """Seal an open `h5py.File` that was written whole; nothing in it may be changed from then on."""
    tree = _Tree(file, "all", sys.maxsize)
    tree.write_to(len)
    file.attrs[SEAL] = tree.seal()


class _Tree:
    """Walks a file once, and then writes it."""

    def __init__(self, file: Any, what: str, most: int) -> None:
        self._what, self._most = what, most
        self._nodes: list[dict[str, Any]] = []
        self._places: dict[int, int] = {}
        self._arrays: list[tuple[Any, dict[str, Any]]] = []
        self._digests: dict[str, str] = {}
        self._texts: list[tuple[Any, dict[str, Any]]] = []
        self._written_bytes = self._listed = 0
        self._walk(h5py.h5o.open(file.id, b"/"), "", 0)

    def write_to(self, write: Callable[[bytes], object]) -> str:
        """Write all of it; return what is known to be changed since it was sealed, empty if nothing is."""
        for dataset, node in self._texts:
            node["texts"] = self._strings(dataset)
        document = json.dumps(self._nodes).encode()
        # so that what follows is aligned
        document = document.ljust(-(-(8 + len(document)) // ALIGNMENT) * ALIGNMENT - 8)
        write(len(document).to_bytes(8, "little") + document)
        changed = ""
        for dataset, node in self._arrays:
            plain = dataset.dtype.newbyteorder("<")
            count, digest = int(dataset.size), hashlib.sha256()
            for start in range(0, count, _PIECE):
                part = dataset[start : start + _PIECE] if dataset.shape else dataset[()]
                piece = np.ascontiguousarray(part, dtype=plain).tobytes()
                digest.update(piece)
                write(piece)
            write(bytes(_padding(count * plain.itemsize)))
            stated = node["attributes"].get(DIGEST)
            if stated is not None and stated != digest.hexdigest():
                changed = changed or f"{node['name']} does not hold what was written"
            if stated is None and count * plain.itemsize <= SMALL_BYTES:
                self._digests[node["name"]] = digest.hexdigest()
        sealed = self._nodes[0]["attributes"].get(SEAL)
        if self._what in WHOLE and sealed is not None and sealed != self.seal():
            changed = changed or CHANGED
        return changed

    def seal(self) -> str:
        """Return the digest of all that was written."""
        return seal_of(self._nodes, self._digests)

    def _charge(self, size: int) -> None:
        self._most -= size
        if self._most < 0:
            raise ValueError("it says that it holds more than a shot file of its size can")

    def _walk(self, item: Any, name: str, depth: int) -> int:
        """Look at one object and what is below it; return its place among the nodes."""
        address = int(h5py.h5o.get_info(item).addr)
        if address in self._places:
            if isinstance(item, h5py.h5g.GroupID):
                raise ValueError(f"{name} is a group that stands in two places")
            return self._places[address]
        place = self._places[address] = len(self._nodes)
        node: dict[str, Any] = {"name": name or "/"}
        self._nodes.append(node)
        if isinstance(item, h5py.h5d.DatasetID):
            self._dataset(item, name, node)
        elif isinstance(item, h5py.h5g.GroupID):
            if depth > DEEPEST:
                raise ValueError(f"{name} lies deeper than any group of a shot file")
            node["items"] = {}
            self._listed += item.get_num_objs()
            if self._listed > MOST_OBJECTS:
                raise ValueError(f"it has more than {MOST_OBJECTS} groups and datasets")
            wanted = PARTS.get(self._what, {}).get(name)
            for link in item if wanted != () else ():
                key = self._text(link, f"a name in {name or '/'}")
                if wanted is not None and key not in wanted:
                    continue
                kind = item.links.get_info(link).type
                if kind != h5py.h5l.TYPE_HARD:
                    what = "a link to another file" if kind == h5py.h5l.TYPE_EXTERNAL else "a link"
                    raise ValueError(f"{name}/{key} is {what}, which is not followed")
                node["items"][key] = self._walk(h5py.h5o.open(item, link), f"{name}/{key}", depth + 1)
        else:
            raise TypeError(f"{name} is neither a group nor a dataset")
        node["attributes"] = self._attributes(item, name)
        return place

    def _attributes(self, item: Any, name: str) -> dict[str, Any]:
        """Read the attributes that are one text or one number; a shot file's others are for viewers."""
        found: dict[str, Any] = {}
        count = h5py.h5a.get_num_attrs(item)
        if count > MOST_ATTRIBUTES:
            raise ValueError(f"{name or '/'} has {count} attributes, and nothing in a shot file has so many")
        for i in range(count):
            attribute = h5py.h5a.open(item, index=i)
            if attribute.get_space().get_simple_extent_type() != h5py.h5s.SCALAR:
                continue
            key = self._text(attribute.name, f"a name in {name or '/'}")
            kind = attribute.get_type()
            self._charge(kind.get_size())
            is_text = kind.get_class() == h5py.h5t.STRING
            if is_text or (kind.get_class() in (h5py.h5t.INTEGER, h5py.h5t.FLOAT) and kind.get_size() <= 8):
                value = np.empty((), dtype=attribute.dtype)
                attribute.read(value)
                found[key] = self._text(value[()], f"{name}@{key}") if is_text else value.item()
        return found

    def _dataset(self, item: Any, name: str, node: dict[str, Any]) -> None:
        made = item.get_create_plist()
        if made.get_external_count():
            raise ValueError(f"{name} is stored in another file, which is not followed")
        if made.get_layout() == h5py.h5d.VIRTUAL:
            raise ValueError(f"{name} is put together from other files, which are not followed")
        if any(made.get_filter(i)[0] not in _FILTERS for i in range(made.get_nfilters())):
            raise ValueError(f"{name} is packed in a way that no shot file is")
        shape, dtype = item.shape, item.dtype
        if item.get_space().get_simple_extent_type() == h5py.h5s.NULL or len(shape) > 1:
            raise ValueError(f"{name} has the shape {shape}, and no shot file has such a dataset")
        text = h5py.check_string_dtype(dtype)
        if text is None and (dtype.kind not in "iuf" or dtype.itemsize > 8 or dtype.subdtype is not None):
            raise ValueError(f"{name} is of type {dtype}, and no shot file has such a dataset")
        if made.get_layout() == h5py.h5d.CHUNKED:
            (chunk,) = made.get_chunk()
            if chunk * dtype.itemsize > LARGEST_CHUNK_BYTES:
                raise ValueError(f"{name} has chunks of {chunk} elements, and no shot file has such large ones")
        size = (shape[0] if shape else 1) * dtype.itemsize
        self._charge(size)
        # the library would give zeros for them
        if made.get_layout() == h5py.h5d.CHUNKED and item.get_num_chunks() < -(-shape[0] // made.get_chunk()[0]):
            raise ValueError(f"{name} lacks some of its samples")
        node["shape"] = list(shape)
        dataset = h5py.Dataset(item)
        if text is not None:
            self._texts.append((dataset, node))
            return
        node["dtype"] = dtype.newbyteorder("<").str
        if self._what == "all" or size <= SMALL_BYTES:
            node["at"] = self._written_bytes
            self._arrays.append((dataset, node))
            self._written_bytes += size + _padding(size)

    def _strings(self, dataset: Any) -> list[str]:
        """Read texts few at a time: many may name one place in the file, each with all of its bytes."""
        name = str(dataset.name)
        if dataset.shape == ():
            return [self._text(dataset[()], name)]
        pieces = (dataset[start : start + _TEXTS] for start in range(0, int(dataset.size), _TEXTS))
        return [self._text(value, name) for piece in pieces for value in piece]

    def _text(self, value: Any, name: str) -> str:
        content = value.encode("utf-8", "surrogateescape") if isinstance(value, str) else bytes(value)
        self._charge(len(content))
        try:
            return content.decode()
        except UnicodeDecodeError as error:
            raise ValueError(f"{name} is not UTF-8 text") from error


def _padding(size: int) -> int:
    return -size % ALIGNMENT
