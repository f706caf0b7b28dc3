"""A document as it stands in its file: JSON types, and the same bytes wherever it is written or attached."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def to_json(value: Any) -> Any:
    """Reduce a value to JSON types; a number that is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(k): to_json(v) for k, v in value.items()}
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [to_json(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def stated(one: object, *names: str) -> dict[str, Any]:
    """Return attributes of a value by their names, which are the document's keys."""
    return {name: getattr(one, name) for name in names}


def json_bytes(document: Mapping[str, Any]) -> bytes:
    """Write a document as JSON, in ASCII, one key a line.

    Raises
    ------
    ValueError
        A number that is not finite.
    """
    return (json.dumps(document, indent=2, allow_nan=False) + "\n").encode("ascii")
