"""Which ready-made framings fit bytes that nothing explains: tried, and the sound frames counted."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from recoil_acquisition.errors import FramingError
from recoil_acquisition.files.bounded_toml import toml_value
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.ready_made import READY_MADE
from recoil_acquisition.frames.scan import find_frames
from recoil_acquisition.frames.values import decode_fields
from recoil_acquisition.frames.vectornav_groups import SYNC

MOST_BYTES = 4 << 20
"""Bytes of a file that are looked at."""
FEWEST_FRAMES = 8
LEAST_SHARE = 0.2
"""Share of the bytes that sound frames hold at least, of a device whose framing fits."""
_CANDIDATES = 6
"""Parameters that are tried at most, in the order of how often the bytes suggest them."""
_LINE = re.compile(rb"[ \t]*[-+.\d][-+.\deE]*[ \t]*(,[ \t]*[-+.\d][-+.\deE]*[ \t]*)+\r?")
_PIECE = re.compile(rb"[-+.\deE, \t\r]*")
"""Pattern of the first line where the port was opened within a line; a row of names makes it a table of text."""
_PRECISIONS = ("f32", "fp16.32", "fp12.20", "f64")
_KELLER_VALUE = 0x49


@dataclass(frozen=True)
class FittingFraming:
    """A framing that fits some bytes.

    Attributes
    ----------
    table
        Framing as a rig file has it; one that is not ready-made lacks its ``fields``, which only a manual tells.
    frames
        Number of sound frames.
    share
        Share of the bytes that the sound frames hold.
    where
        Part of the bytes that was looked at, in words; empty if all were.
    bad
        Number of places that looked like a frame and had a wrong checksum.
    """

    table: Mapping[str, Any]
    frames: int
    share: float
    where: str = ""
    bad: int = 0

    def __str__(self) -> str:
        return f"framing = {toml_value(self.table)}"

    @property
    def is_ready_made(self) -> bool:
        """Whether it decodes the frames as it stands."""
        return "ready_made" in self.table

    @property
    def advice(self) -> str:
        """Declaration of a rig, as a part of a sentence."""
        return f"`{self}`" + ("" if self.is_ready_made else " with the `fields` that the device's manual tells")

    @property
    def found(self) -> str:
        """Say what was found, in a few words."""
        bad = f", {self.bad:,} with a wrong checksum" if self.bad else ""
        return f"{self.frames:,} good frames of {self._kind}{bad}{self.where}"

    @property
    def _kind(self) -> str:
        """Kind of the frames in words."""
        if self.is_ready_made:
            return str(self.table["ready_made"])
        checksum = self.table["checksum"]["algo"]
        if self.table["kind"] == "delimiter":
            return f"lines behind {self.table['start']} with the checksum {checksum}"
        if self.table["kind"] != "sync":
            return f"kind {self.table['kind']} with the checksum {checksum}"
        fixed = self.table["length"].get("fixed")
        size = "a length that they state" if fixed is None else f"{fixed} bytes"
        return f"{size} behind {self.table['sync']} with the checksum {checksum}"


def fitting_framings(stream: bytes) -> tuple[FittingFraming, ...]:
    """Return the ready-made framings whose sound frames hold enough of some bytes, those that hold most first."""
    where = f" in the first {MOST_BYTES / 2**20:g} MB" if len(stream) > MOST_BYTES else ""
    stream = stream[:MOST_BYTES]
    tried = [replace(found, where=where) for table in _tables(stream) if (found := _tried(stream, table)) is not None]
    return tuple(sorted(tried, key=lambda one: -one.share))


def _tried(stream: bytes, table: Mapping[str, Any]) -> FittingFraming | None:
    try:
        framing = framing_from_table(table)
    except FramingError:
        return None
    frames = find_frames(framing, stream)
    share = float(frames.lengths.sum()) / max(len(stream), 1)
    if frames.begins.size < FEWEST_FRAMES or share < LEAST_SHARE or not _holds_something(framing, stream):
        return None
    return FittingFraming(table, int(frames.begins.size), share, bad=frames.counters.bad_checksum)


def _holds_something(framing: Framing, stream: bytes) -> bool:
    """Return whether a frame holds a field with a unit: of several precisions only one does."""
    series = decode_fields(framing, find_frames(framing, stream[: 1 << 16]))
    return any(one.frames.size and (one.field.unit or framing.kind == "delimiter") for one in series.values())


def _tables(stream: bytes) -> Iterator[dict[str, Any]]:
    """Yield every ready-made framing, with the parameters that the bytes suggest."""
    for name in READY_MADE:
        given: list[dict[str, Any]] = [{}]
        if name == "xsens-mti":
            given = [{"precision": one} for one in _PRECISIONS]
        elif name == "vectornav-vn100-binary":
            given = [{"header": one} for one in _headers(stream)]
        elif name == "keller":
            given = [{"address": one} for one in _addresses(stream)]
        elif name == "csv-lines":
            given = [{"columns": [f"column_{i + 1}" for i in range(count)]} for count in _columns(stream)]
        yield from ({"ready_made": name, **one} for one in given)


def _headers(stream: bytes) -> list[str]:
    """Return the headers of VectorNav's messages that the bytes hold, the most frequent first.

    A bit of the byte behind the sync byte announces a group of the message, and each group has a word of its fields.
    """
    counts: Counter[bytes] = Counter()
    at = stream.find(SYNC)
    while at >= 0:
        groups = stream[at + 1 : at + 2]
        if groups and groups[0]:
            header = stream[at : at + 2 + 2 * groups[0].bit_count()]
            counts[header] += len(header) == 2 + 2 * groups[0].bit_count()
        at = stream.find(SYNC, at + 1)
    return [header.hex(" ").upper() for header, count in counts.most_common(_CANDIDATES) if count >= FEWEST_FRAMES]


def _addresses(stream: bytes) -> list[int]:
    """Return the addresses of Keller's transmitters that the bytes hold replies of, the most frequent first."""
    counts = Counter(before for before, at in pairwise(stream) if at == _KELLER_VALUE)
    return [
        address for address, count in counts.most_common(_CANDIDATES) if count >= FEWEST_FRAMES and 1 <= address <= 249
    ]


def _columns(stream: bytes) -> list[int]:
    """Return the number of columns where all bytes but the first and last line are lines of as many numbers.

    A line that is no row of numbers makes it a table of text, which is no stream of a port.
    """
    all_lines = [line for line in stream.split(b"\n")[:-1] if line.strip() and not line.startswith(b"#")]
    first, lines = b"".join(all_lines[:1]), all_lines[1:]
    rows = len(lines) >= FEWEST_FRAMES and all(_LINE.fullmatch(line) for line in lines)
    if not rows or not _PIECE.fullmatch(first):
        return []
    counts = Counter(line.count(b",") + 1 for line in lines)
    return [counts.most_common(1)[0][0]]
