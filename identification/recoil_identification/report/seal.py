"""The digest of a report's own content: a digit that is changed in it shows, be it one that nothing is computed of."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

SEAL = "digest"
"""Key of the provenance."""


def digest_of(document: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a report without its own digest.

    It is that of the JSON text with its keys sorted, without spaces and with every number as a float, so that a
    program which reads a report and writes it anew changes nothing.
    """
    provenance = {key: value for key, value in document["provenance"].items() if key != SEAL}
    plain = _plain({**document, "provenance": provenance})
    return hashlib.sha256(json.dumps(plain, sort_keys=True, separators=(",", ":")).encode("ascii")).hexdigest()


def sealed(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a report with its digest in its provenance."""
    return {**document, "provenance": {**document["provenance"], SEAL: digest_of(document)}}


def seal_fault(document: Mapping[str, Any]) -> str:
    """Say why a report is not what was written: its digest is that of another content, or it has none; else nothing.

    A report that has none was made by an earlier version, or the digest was taken out: nothing vouches for it.
    """
    seal = document["provenance"].get(SEAL)
    if seal is None:
        return f"has no digest of its content (provenance.{SEAL})"
    if seal != digest_of(document):
        return f"was changed after it was written: its content has another digest than provenance.{SEAL}"
    return ""


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return value
