"""A document as it stands in its file: the same bytes wherever it is written or attached."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def json_bytes(document: Mapping[str, Any]) -> bytes:
    """Write a document as JSON, in ASCII, one key a line.

    Raises
    ------
    ValueError
        A number that is not finite.
    """
    return (json.dumps(document, indent=2, allow_nan=False) + "\n").encode("ascii")
