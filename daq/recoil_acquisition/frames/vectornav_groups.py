"""Fields of a VectorNav binary message, by its header.

Source: VectorNav, VN-100 User Manual (UM001), binary output groups; the sizes are those of VectorNav's
programming library. A bit of the group byte announces a 16-bit word, little endian; a bit of the word announces
a field. Fields follow each other in the order of the bits.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

SYNC = 0xFA

_NAMED = MappingProxyType(
    {
        "time_startup": ("u64", 1, ""),
        "yaw_pitch_roll": ("f32", 3, "deg"),
        "angular_rate": ("f32", 3, "rad/s"),
        "acceleration": ("f32", 3, "m/s^2"),
        "uncompensated_acceleration": ("f32", 3, "m/s^2"),
        "uncompensated_angular_rate": ("f32", 3, "rad/s"),
        "temperature": ("f32", 1, "degC"),
        "pressure": ("f32", 1, "kPa"),
        "direction_cosine": ("f32", 9, ""),
        "acceleration_ned": ("f32", 3, "m/s^2"),
        "linear_acceleration_body": ("f32", 3, "m/s^2"),
        "linear_acceleration_ned": ("f32", 3, "m/s^2"),
        "saturation": ("u16", 1, ""),
        "status": ("u16", 1, ""),
    }
)
"""Name -> type, numbers and unit of what a field holds."""

_SIZES = MappingProxyType(
    {
        0: (8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8),
        2: (2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40),
        4: (2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24),
    }
)
"""Bit of the group byte -> bytes of each field of the group."""

_CONTENTS: dict[tuple[int, int], tuple[tuple[str, int], ...]] = {
    (0, 0): (("time_startup", 0),),
    (0, 3): (("yaw_pitch_roll", 0),),
    (0, 5): (("angular_rate", 0),),
    (0, 8): (("acceleration", 0),),
    (0, 9): (("uncompensated_acceleration", 0), ("uncompensated_angular_rate", 12)),
    (0, 10): (("temperature", 12), ("pressure", 16)),
    (2, 2): (("uncompensated_acceleration", 0),),
    (2, 3): (("uncompensated_angular_rate", 0),),
    (2, 4): (("temperature", 0),),
    (2, 5): (("pressure", 0),),
    (2, 9): (("acceleration", 0),),
    (2, 10): (("angular_rate", 0),),
    (2, 11): (("saturation", 0),),
    (4, 0): (("status", 0),),
    (4, 1): (("yaw_pitch_roll", 0),),
    (4, 3): (("direction_cosine", 0),),
    (4, 5): (("acceleration_ned", 0),),
    (4, 6): (("linear_acceleration_body", 0),),
    (4, 7): (("linear_acceleration_ned", 0),),
}
"""Bits of group and field -> what of the field is decoded, and its first byte in it."""


def fields_of_header(header: bytes) -> tuple[list[dict[str, Any]], int]:
    """Return the declared fields of a message, and its length without checksum.

    Parameters
    ----------
    header
        Sync byte, group byte, and a word for each group.

    Returns
    -------
    fields : list of dict
        Fields as a framing declares them; each name once, as in the first group that has it.
    length : int

    Raises
    ------
    ValueError
        If it is no such header, or announces a group or field of unknown size.
    """
    groups = [bit for bit in range(8) if len(header) > 1 and header[1] >> bit & 1]
    if len(header) < 2 or header[0] != SYNC or not groups or len(header) != 2 + 2 * len(groups):
        raise ValueError(
            'header must be FA, a byte of groups and two bytes for each, such as "FA 01 21 01"; '
            f'found "{header.hex(" ")}"'
        )
    fields: dict[str, dict[str, Any]] = {}
    at = len(header)
    for number, group in enumerate(groups):
        word = int.from_bytes(header[2 + 2 * number : 4 + 2 * number], "little")
        sizes = _SIZES.get(group, ())
        for bit in (bit for bit in range(16) if word >> bit & 1):
            if bit >= len(sizes):
                raise ValueError(f"header: the size of field {bit} of group {group + 1} is not known")
            for name, begin in _CONTENTS.get((group, bit), ()):
                fields.setdefault(name, _declared(name, at + begin))
            at += sizes[bit]
    if not fields:
        raise ValueError(f'header: "{header.hex(" ")}" announces nothing that is decoded')
    return list(fields.values()), at


def _declared(name: str, at: int) -> dict[str, Any]:
    type_, count, unit = _NAMED[name]
    names: Any = [f"{name}_{axis}" for axis in "xyz"] if count == 3 else name
    if name == "yaw_pitch_roll":
        names = ["yaw", "pitch", "roll"]
    return {
        "name": names,
        "at": at,
        "type": type_,
        **({"unit": unit} if unit else {}),
        **({"count": count} if count > 3 else {}),
    }
