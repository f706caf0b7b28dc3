"""Packets whose bytes were changed so that one value ends them and occurs nowhere else."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Octets = NDArray[np.uint8]
Places = NDArray[np.int64]
Mask = NDArray[np.bool_]

COBS_DELIMITER = b"\x00"
SLIP_DELIMITER = b"\xc0"

_ESCAPE = b"\xdb"
_ESCAPED_DELIMITER, _ESCAPED_ESCAPE = 0xDC, 0xDD

_FEWEST_AT_ONCE = 6
"""Number of packets from which on following their codes with arrays is quicker than one after the other."""


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


def decode_cobs_packets(octets: Octets, starts: Places, stops: Places) -> tuple[Octets, Places, Mask]:
    """Undo consistent overhead byte stuffing of many packets, as `decode_cobs` does of one.

    Parameters
    ----------
    octets : ndarray of uint8, shape (n_bytes,)
        Packets and delimiters.
    starts, stops : ndarray of int64, shape (n_packets,)
        Places of each packet's first byte and of the delimiter behind it; none is empty, and what is in none is a
        delimiter.

    Returns
    -------
    decoded : ndarray of uint8
        The packets one after the other.
    lengths : ndarray of int64, shape (n_packets,)
        Bytes of each among them.
    sound : ndarray of bool, shape (n_packets,)
        Whether a packet could be decoded; the bytes of one that could not mean nothing.
    """
    decoded, kept = octets.copy(), octets != COBS_DELIMITER[0]
    kept[starts] = False
    lengths = stops - starts - 1
    sound = np.ones(len(starts), dtype=bool)
    codes = octets[starts]
    at = starts + codes
    while True:
        beyond = at > stops
        if beyond.any():
            sound &= ~beyond
            at = np.minimum(at, stops)
        # a packet that is followed to its end stays there, as the delimiter is the code 0
        decoded[at] = 0
        full = codes == 255
        if full.any():
            full &= at < stops
            kept[at[full]] = False
            lengths -= full
        codes = octets[at]
        if np.count_nonzero(codes) < _FEWEST_AT_ONCE:
            break
        at = at + codes
    for packet in np.flatnonzero(codes).tolist():
        code = int(codes[packet])
        end, places, full_places = _follow_codes(octets[: stops[packet]].data, int(at[packet]) + code, code)
        decoded[places] = 0
        kept[full_places] = False
        lengths[packet] -= len(full_places)
        sound[packet] = end == stops[packet]
    return decoded[kept], lengths, sound


def _follow_codes(octets: memoryview, at: int, code: int) -> tuple[int, list[int], list[int]]:
    """Return where a packet's codes lead, the places of those from ``at`` on, and of those that stand for no zero."""
    places: list[int] = []
    full: list[int] = []
    while at < len(octets):
        (full if code == 255 else places).append(at)
        code = octets[at]
        at += code
    return at, places, full


def decode_slip_packets(octets: Octets, starts: Places, stops: Places) -> tuple[Octets, Places, Mask]:
    """Undo the escapes of SLIP in many packets, as `decode_slip` does in one.

    Parameters
    ----------
    octets : ndarray of uint8, shape (n_bytes,)
        Packets and delimiters, the last byte a delimiter.
    starts, stops : ndarray of int64, shape (n_packets,)
        Places as for `decode_cobs_packets`.

    Returns
    -------
    decoded, lengths, sound : ndarray
        Packets as `decode_cobs_packets` returns them.
    """
    kept, lengths, sound = octets != SLIP_DELIMITER[0], stops - starts, np.ones(len(starts), dtype=bool)
    escapes = np.flatnonzero(octets == _ESCAPE[0])
    if not escapes.size:
        return octets[kept], lengths, sound
    decoded, behind = octets.copy(), octets[escapes + 1]
    delimiters = behind == _ESCAPED_DELIMITER
    packets = np.searchsorted(starts, escapes, side="right") - 1
    sound[packets[~delimiters & (behind != _ESCAPED_ESCAPE)]] = False
    decoded[escapes + 1] = np.where(delimiters, SLIP_DELIMITER[0], _ESCAPE[0])
    kept[escapes] = False
    return decoded[kept], lengths - np.bincount(packets, minlength=len(starts)), sound


def longest_packet(kind: str, maximum: int) -> int:
    """Return the most bytes, without delimiters, that a frame of a given longest length can become."""
    return maximum + maximum // 254 + 1 if kind == "cobs" else 2 * maximum
