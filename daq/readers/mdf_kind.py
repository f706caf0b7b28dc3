"""What kind of measurement an MDF 4 file holds, by its first bytes.

Layout: ASAM MDF 4, identification block: ``MDF`` or, if the recorder did not close the file, ``UnFinMF``, padded to
eight bytes, then the version. Bus logging has groups with a channel ``CAN_DataFrame`` (ASAM MDF bus logging).
"""

from __future__ import annotations

_IDENTIFICATIONS = (b"MDF     4.", b"UnFinMF 4.")
_FRAMES = b"CAN_DataFrame"


def is_bus_logging(head: bytes) -> bool:
    """Tell whether a file's first bytes are those of an MDF 4 file that holds frames of a CAN bus."""
    return head.startswith(_IDENTIFICATIONS) and _FRAMES in head
