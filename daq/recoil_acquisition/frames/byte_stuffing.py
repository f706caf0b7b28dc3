"""Packets whose bytes were changed so that one value ends them and occurs nowhere else."""

from __future__ import annotations

COBS_DELIMITER = b"\x00"
SLIP_DELIMITER = b"\xc0"

_ESCAPE = b"\xdb"


def decode_cobs(packet: bytes) -> bytes | None:
    """Undo consistent overhead byte stuffing.

    S. Cheshire and M. Baker, Consistent Overhead Byte Stuffing, IEEE/ACM Transactions on Networking 7(2),
    1999: a code byte n is followed by n - 1 bytes that are not zero, and stands for a zero behind them
    unless n is 255 or the packet ends.

    Parameters
    ----------
    packet
        Packet without its delimiter.

    Returns
    -------
    bytes or None
        None if a code points beyond the packet.
    """
    pieces = []
    at, size = 0, len(packet)
    while at < size:
        code = packet[at]
        behind = at + code
        if not code or behind > size:
            return None
        pieces.append(packet[at + 1 : behind])
        if code < 255 and behind < size:
            pieces.append(b"\0")
        at = behind
    return b"".join(pieces)


def decode_slip(packet: bytes) -> bytes | None:
    """Undo the escapes of SLIP.

    J. Romkey, RFC 1055, 1988: within a packet DB DC stands for C0, and DB DD for DB.

    Parameters
    ----------
    packet
        Packet without its delimiters.

    Returns
    -------
    bytes or None
        None if an escape is followed by anything else.
    """
    if _ESCAPE not in packet:
        return packet
    parts = packet.split(_ESCAPE)
    if any(part[:1] not in (b"\xdc", b"\xdd") for part in parts[1:]):
        return None
    return parts[0] + b"".join((SLIP_DELIMITER if p[:1] == b"\xdc" else _ESCAPE) + p[1:] for p in parts[1:])


def longest_packet(kind: str, maximum: int) -> int:
    """Return the most bytes, without delimiters, that a frame of a given longest length can become."""
    return maximum + maximum // 254 + 1 if kind == "cobs" else 2 * maximum
