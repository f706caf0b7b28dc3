"""The seal of a shot file: digests by which a file that was changed since it was written is known.

It is the SHA-256 of all names, shapes, attributes and texts of the tree and of its small arrays. Each dataset of
samples bears a SHA-256 of its own as an attribute, so that the seal can be asked for without reading them. HDF5's
checksums are of packed samples alone: neither of where these lie in the file nor of what stands beside them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

SEAL, DIGEST = "seal", "sha256"
"""Attributes of the root, and of a dataset of samples. Files of before have none."""
CHANGED = "something in it was changed since it was written"


def digest_of(values: NDArray[Any]) -> str:
    """Return the digest of a dataset of samples, as little-endian numbers."""
    plain = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    return hashlib.sha256(plain.data).hexdigest()


def seal_of(nodes: Sequence[Mapping[str, Any]], digests: Mapping[str, str]) -> str:
    """Return the digest of a tree.

    Parameters
    ----------
    nodes
        Groups and datasets as `recoil_acquisition.store.file_tree` walks them: ``name``, ``attributes``, ``items`` as
        names and places among the nodes, ``shape``, ``dtype``, ``texts``.
    digests
        Digests of small arrays by name, of those that bear none.
    """
    names = [node["name"] for node in nodes]
    whole = [
        {
            "name": node["name"],
            "items": {key: names[place] for key, place in sorted(node.get("items", {}).items())},
            "attributes": {key: value for key, value in sorted(node["attributes"].items()) if key != SEAL},
            "form": [node.get("shape"), node.get("dtype")],
            "texts": node.get("texts"),
            "sha256": digests.get(node["name"]),
        }
        for node in sorted(nodes, key=lambda node: str(node["name"]))
    ]
    return hashlib.sha256(json.dumps(whole).encode()).hexdigest()
