"""Content of bytes that nothing explains: ready-made framings, frames with a checksum, marks that come back.

The ready-made framings are tried first (`fitting`). Where none fits, frames are sought whose layout nobody has
declared: bytes that come back at even distances, or at distances that a byte behind them states; packets of COBS and
SLIP; sentences of text with a checksum. Every checksum of `frames.checksum` is tried over them. Where none holds, the
marks are named, and nothing is claimed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.frames.byte_stuffing import COBS_DELIMITER, SLIP_DELIMITER, decode_cobs, decode_slip
from recoil_acquisition.frames.checksum import CHECKSUMS
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.scan import find_frames
from recoil_acquisition.readers.serial.fitting import (
    FEWEST_FRAMES,
    LEAST_SHARE,
    MOST_BYTES,
    FittingFraming,
    fitting_framings,
)

MARKED_BYTES = 1 << 18
"""Bytes in which marks are sought."""
_PAIRS, _MARKS = 24, 3
"""Pairs of bytes that are looked at, the most frequent first, and marks that are named, at most."""
_SHORTEST, _LONGEST = 4, 2048
"""Distances between marks that may be frames."""
_LEAST_REGULAR = 0.5
"""Share of the distances between marks that are one and the same, or what a byte behind the mark states."""
_CHECKED, _FIRST_CHECKED = 120, 12
"""Frames over which a checksum is computed, and those of them that decide whether the others are worth it."""
_LEAST_RIGHT = 0.8
"""Share of the frames whose checksum holds; a sum of eight bits holds for one in 256 by chance."""
_LEAST_TEXT = 0.97
"""Share of printed characters from which on bytes are text."""
_COVERED_FROM = range(5)
_LENGTH_PLACES = range(2, 8)
_LONGEST_SYNC = 4


@dataclass(frozen=True)
class SyncMark:
    """Bytes that come back in a stream, and may begin its frames.

    Attributes
    ----------
    content
        Bytes of the mark.
    count
        Number of its places.
    distance
        Distance from one to the next that is met most often, in bytes.
    share
        Share of the distances that are this one.
    """

    content: bytes
    count: int
    distance: int
    share: float

    def __str__(self) -> str:
        often = f"{self.count:,} times {self.content.hex(' ').upper()}"
        return f"{often}, {self.distance} bytes from one to the next in {100 * self.share:.0f} %"


@dataclass(frozen=True)
class RawBytes:
    """Content of the bytes of a port.

    Attributes
    ----------
    size
        Number of the bytes that were looked at.
    framings
        Framings whose sound frames hold enough of them, the most first: ready-made ones, else one without its
        ``fields``, whose checksum holds.
    marks
        Marks that come back, the most regular first; empty where a framing fits.
    """

    size: int
    framings: tuple[FittingFraming, ...]
    marks: tuple[SyncMark, ...]

    @property
    def found(self) -> str:
        """Say what was found, in a few words; empty if nothing was."""
        if self.framings:
            best = self.framings[0]
            return f"{best.found}, {100 * best.share:.0f} % of the bytes"
        return "no framing that fits, but " + "; ".join(map(str, self.marks)) if self.marks else ""


def look_into(stream: bytes) -> RawBytes:
    """Find framings in the bytes of a port, or else the marks in them."""
    looked_at = stream[:MOST_BYTES]
    framings = fitting_framings(stream)
    if framings:
        return RawBytes(len(looked_at), framings, ())
    found = [one for table in _own_tables(looked_at) if (one := _tried(looked_at, table)) is not None]
    if found:
        return RawBytes(len(looked_at), (max(found, key=lambda one: one.share),), ())
    return RawBytes(len(looked_at), (), tuple(islice(_marks(looked_at), _MARKS)))


def look_into_file(path: Path) -> RawBytes | None:
    """Find framings in a file's bytes, see `look_into`; None if it cannot be read."""
    try:
        with path.open("rb") as file:
            return look_into(file.read(MOST_BYTES + 1))
    except OSError:
        return None


def _tried(stream: bytes, table: Mapping[str, Any]) -> FittingFraming | None:
    """Count the frames of a framing without fields."""
    lines = table["kind"] == "delimiter"
    place = {"name": "any", "at": 0} if lines else {"name": "any", "at": 0, "type": "u8"}
    if lines:
        place["at"] = 1
    frames = find_frames(framing_from_table({**table, "fields": [place]}), stream)
    share = float(frames.lengths.sum()) / max(len(stream), 1)
    if frames.begins.size < FEWEST_FRAMES or share < LEAST_SHARE:
        return None
    return FittingFraming(table, int(frames.begins.size), share, bad=frames.counters.bad_checksum)


def _own_tables(stream: bytes) -> Iterator[dict[str, Any]]:
    """Yield framings without fields whose checksum holds over what looks like frames."""
    if _is_text(stream):
        if stream.count(b"\n$") >= FEWEST_FRAMES:
            yield {"kind": "delimiter", "start": "$", "checksum": {"algo": "xor8", "from": 1}}
        return
    for kind, delimiter, decode in (("cobs", COBS_DELIMITER, decode_cobs), ("slip", SLIP_DELIMITER, decode_slip)):
        packets = [one for one in stream[:MARKED_BYTES].split(delimiter)[1:-1] if len(one) >= _SHORTEST]
        decoded = [whole for one in packets[:_CHECKED] if len(one) <= _LONGEST and (whole := decode(one)) is not None]
        if len(decoded) >= max(FEWEST_FRAMES, _LEAST_RIGHT * min(len(packets), _CHECKED)):
            for checksum in _checksums(decoded):
                yield {"kind": kind, "checksum": checksum}
    for mark, length, frames in _framed(stream[:MARKED_BYTES]):
        for checksum in _checksums(frames):
            yield {"kind": "sync", "sync": mark.hex(" ").upper(), "length": length, "checksum": checksum}


def _is_text(stream: bytes) -> bool:
    """Return whether the bytes are printed characters, in which every word comes back."""
    octets = np.frombuffer(stream[:MARKED_BYTES], dtype=np.uint8)
    printed = (octets >= 0x20) & (octets < 0x7F) | (octets == 0x0A) | (octets == 0x0D) | (octets == 0x09)
    return bool(octets.size) and float(printed.mean()) > _LEAST_TEXT


def _checksums(frames: Sequence[bytes]) -> Iterator[dict[str, Any]]:
    """Yield the checksum that holds at the end of most frames; one that covers more of them first."""
    frames = [one for one in frames[:_CHECKED] if len(one) > max(_COVERED_FROM) + 4]
    if len(frames) < FEWEST_FRAMES or len(set(frames)) < FEWEST_FRAMES:
        return
    for checksum in sorted(CHECKSUMS.values(), key=lambda one: -one.size):
        for order in ("big", "little") if checksum.size > 1 else ("big",):
            for start in _COVERED_FROM:

                def right(one: bytes) -> bool:
                    stated = int.from_bytes(one[-checksum.size :], order)  # noqa: B023 - called in this turn
                    return checksum.of(one[start : -checksum.size]) == stated  # noqa: B023 - as above

                first = sum(map(right, frames[:_FIRST_CHECKED]))
                if 2 * first < min(len(frames), _FIRST_CHECKED):
                    continue
                if sum(map(right, frames)) >= _LEAST_RIGHT * len(frames):
                    table = {"algo": checksum.name, "from": start, "order": order}
                    kept = {"algo"} | ({"from"} if start else set()) | ({"order"} if checksum.size > 1 else set())
                    yield {key: value for key, value in table.items() if key in kept}
                    return


def _framed(stream: bytes) -> Iterator[tuple[bytes, dict[str, Any], list[bytes]]]:
    """Yield marks, the lengths of the frames that they may begin, and some of these frames."""
    octets = np.frombuffer(stream, dtype=np.uint8)
    seen: set[tuple[bytes, str]] = set()
    for places, distances in _frequent_pairs(octets):
        lengths: list[tuple[dict[str, Any], NDArray[np.int64]]] = []
        usual, share = _most_frequent(distances)
        if share >= _LEAST_REGULAR and _SHORTEST <= usual <= _LONGEST:
            for shift in range(_LONGEST_SYNC):
                # bytes before the pair may belong to the mark too
                begins = places[places >= shift] - shift
                columns = octets[np.add.outer(begins[begins + usual <= octets.size], np.arange(shift + 1))]
                if shift and not (columns == columns[:1]).mean(axis=0).min() > _LEAST_RIGHT:
                    break
                lengths.append(({"fixed": usual}, begins))
        for at in _LENGTH_PLACES:
            inside = places[:-1] + at + 1 < octets.size
            first = octets[places[:-1][inside] + at].astype(np.int64)
            second = octets[places[:-1][inside] + at + 1].astype(np.int64)
            stated = {"u8": first, "little": first | second << 8, "big": first << 8 | second}
            for name, values in stated.items():
                more, held = _most_frequent(distances[inside] - values)
                if held >= _LEAST_REGULAR and 0 <= more <= 16 and np.unique(values).size > 1:
                    table: dict[str, Any] = {"at": at, "type": "u8" if name == "u8" else "u16", "add": more}
                    lengths.append((table if name == "u8" else {**table, "endian": name}, places))
        for table, begins in lengths:
            mark = _constant_from(octets, begins)
            if (mark, str(table)) in seen:
                continue
            seen.add((mark, str(table)))
            yield mark, table, list(_frames(stream, begins, table))


def _frames(stream: bytes, begins: NDArray[np.int64], table: Mapping[str, Any]) -> Iterator[bytes]:
    ends = np.r_[begins[1:], len(stream)]
    for begin, end in zip(begins[:_CHECKED].tolist(), ends[:_CHECKED].tolist(), strict=False):
        if "fixed" not in table:
            yield stream[begin:end]
        elif begin + table["fixed"] <= len(stream):
            yield stream[begin : begin + table["fixed"]]


def _constant_from(octets: NDArray[np.uint8], begins: NDArray[np.int64]) -> bytes:
    """Return the bytes that are the same at most places, up to the first that is not."""
    inside = begins[begins + _LONGEST_SYNC <= octets.size]
    columns = octets[np.add.outer(inside, np.arange(_LONGEST_SYNC))]
    middle = np.array([np.bincount(column).argmax() for column in columns.T], dtype=np.uint8)
    same = (columns == middle).mean(axis=0) > _LEAST_RIGHT
    length = _LONGEST_SYNC if same.all() else int(same.argmin())
    return middle[: max(length, 1)].tobytes()


def _frequent_pairs(octets: NDArray[np.uint8]) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Yield the places of frequent pairs of bytes, and the distances between them."""
    if octets.size < 2:
        return
    pairs = octets[:-1].astype(np.int64) << 8 | octets[1:]
    counts = np.bincount(pairs, minlength=1 << 16)
    for pair in np.argsort(-counts, kind="stable")[:_PAIRS]:
        if counts[pair] < FEWEST_FRAMES:
            return
        places = np.flatnonzero(pairs == pair)
        yield places, np.diff(places)


def _most_frequent(numbers: NDArray[np.int64]) -> tuple[int, float]:
    if not numbers.size:
        return 0, 0.0
    values, counts = np.unique(numbers, return_counts=True)
    return int(values[counts.argmax()]), float(counts.max() / numbers.size)


def _marks(stream: bytes) -> Iterator[SyncMark]:
    """Yield marks that come back at one distance, those first whose frames would hold the most bytes."""
    octets = np.frombuffer(stream[:MARKED_BYTES], dtype=np.uint8)
    if _is_text(stream):
        return
    found: dict[bytes, SyncMark] = {}
    for places, distances in _frequent_pairs(octets):
        usual, share = _most_frequent(distances)
        if not _SHORTEST <= usual <= _LONGEST or share < LEAST_SHARE:
            continue
        mark = _constant_from(octets, places[:-1][distances == usual])
        known = found.get(mark)
        if known is None or known.count * known.share < places.size * share:
            found[mark] = SyncMark(mark, int(places.size), usual, share)
    held = [one for one in found.values() if one.count * one.share * one.distance >= LEAST_SHARE * octets.size]
    held.sort(key=lambda one: (-round(one.count * one.share * one.distance / octets.size, 2), -len(set(one.content))))
    told: list[SyncMark] = []
    for one in held:
        # a part of a mark, or a mark with a byte before it that is often the same, is no other mark
        if not any(one.content in other.content or other.content in one.content for other in told):
            told.append(one)
    yield from told
