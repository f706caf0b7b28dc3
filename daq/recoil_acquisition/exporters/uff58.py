"""Universal file, dataset 58 in its binary form: one dataset per channel, float64.

Layout: University of Cincinnati, Structural Dynamics Research Laboratory, "Universal File Formats for Modal Analysis
Testing", dataset 58 (function at nodal DOF) and 58b (its binary form): eleven records of text, then little-endian
float64. Start and step stand in fields of 13 characters with 6 digits, which is what other programs read; the exact
ones stand in the fourth identification line. Of an uneven spacing each sample has its instant before it, float64 too:
writers differ in its type, and that is the one which most programs read.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.exporters.content import Content, TimeBaseGroup
from recoil_acquisition.exporters.exporter import ExportedTable, Representation

IDENTIFICATION = 80
"""Characters of an identification line."""

LABEL = 20
"""Characters of the name of an axis, and of its unit."""

SPECIFIC_TYPES = {
    "displacement": 8, "velocity": 11, "acceleration": 12, "force": 13, "pressure": 15, "mass": 16, "time": 17,
    "frequency": 18, "temperature": 5, "strain": 3,
}  # fmt: skip
"""Quantity -> specific data type of record 9; 1 (general) for others."""

_LITTLE_ENDIAN, _IEEE_754, _HEADER_LINES = 1, 2, 11
_TIME_RESPONSE, _REAL_DOUBLE, _UNEVEN, _EVEN = 1, 4, 0, 1


class Uff58Exporter:
    """Exporter of universal files."""

    name = "uff58"
    suffix = ".uff"
    extra = ""
    single_file = True

    def carried(self, content: Content) -> Representation:
        """Return all channels, instants of an even spacing as start and step of 6 digits give them."""
        tables, losses = [], []
        for group in content.groups:
            base = group.time_base
            names = [c.name for c in group.channels]
            rounded = base if base.step_s is None else _rounded(base)
            off_s = float(np.abs(rounded.times_s - base.times_s).max()) if base.count else 0.0
            if off_s > 0:
                losses.append(
                    f"{', '.join(names)}: time is off by up to {off_s:.2g} s, because start and step have 6 digits; "
                    "the fourth identification line has them exactly"
                )
            cut = {name: _line(name, IDENTIFICATION) for name in names}
            losses += [f"{name}: its name is {line!r} here" for name, line in cut.items() if line != name]
            samples = {c.name: c.samples.astype(np.float64) for c in group.channels}
            tables.append(ExportedTable(group.name, rounded.times_s, samples))
        losses.append("what is known beside name, unit, quantity and clock: absolute start, sensors, provenance")
        return Representation(tuple(tables), tuple(losses))

    def write(self, content: Content, path: Path) -> None:
        """Write the file."""
        with path.open("xb") as file:
            number = 0
            for group in content.groups:
                base = group.time_base
                for channel in group.channels:
                    number += 1
                    file.write(_head(content, group, channel, number).encode("ascii"))
                    values = channel.samples.astype("<f8")
                    if base.step_s is None:
                        values = np.column_stack([base.times_s.astype("<f8"), values])
                    file.write(values.tobytes())
                    file.write(b"\n    -1\n")

    def read_back(self, content: Content, path: Path) -> tuple[ExportedTable, ...]:
        """Read the datasets in order, by the counts in their own records."""
        data = path.read_bytes()
        at = 0
        tables = []
        for group in content.groups:
            even = group.time_base.step_s is not None
            samples: dict[str, NDArray[np.float64]] = {}
            times_s: NDArray[np.float64] = np.empty(0)
            for channel in group.channels:
                lines = data[at : at + 4096].split(b"\n")[: 2 + _HEADER_LINES]
                at += sum(len(line) + 1 for line in lines)
                size, form = int(lines[1][31:43]), lines[8]
                count, start_s, step_s = int(form[10:20]), float(form[30:43]), float(form[43:56])
                if int(form[20:30]) != (_EVEN if even else _UNEVEN) or size != (8 if even else 16) * count:
                    raise ValueError("the spacing of a dataset is not that of its channel")
                values = np.frombuffer(data, "<f8", size // 8, at).astype(np.float64)
                if even:
                    times_s, samples[channel.name] = start_s + step_s * np.arange(count, dtype=np.float64), values
                else:
                    times_s, samples[channel.name] = values[::2], values[1::2]
                at += size
                if data[at : at + 8] != b"\n    -1\n":
                    raise ValueError("a dataset does not end where its header says")
                at += 8
            tables.append(ExportedTable(group.name, times_s, samples))
        if at != len(data):
            raise ValueError("there is more in the file than was written")
        return tuple(tables)


def _rounded(base: TimeBase) -> TimeBase:
    return TimeBase.uniform(base.clock, float(f"{base.start_s:.5e}"), float(f"{base.step_s:.5e}"), base.count)


def _line(text: str, width: int) -> str:
    """Return text as one line of printable ASCII, cut to a width; what is not becomes ``?``."""
    plain = "".join(c if " " <= c <= "~" else "?" for c in text)
    return plain[:width].rstrip()


def _head(content: Content, group: TimeBaseGroup, channel: Channel, number: int) -> str:
    """Return all of a dataset before its samples."""
    base = group.time_base
    shot, rig = content.document["shot"], content.document["rig"]
    axis = "{:10d}{:5d}{:5d}{:5d} {:<20s} {:<20s}"
    unused = axis.format(0, 0, 0, 0, "NONE", "NONE")
    kind = SPECIFIC_TYPES.get(channel.quantity, 1)
    even = base.step_s is not None
    size = (8 if even else 16) * base.count
    binary = f"    58b{_LITTLE_ENDIAN:6d}{_IEEE_754:6d}{_HEADER_LINES:12d}{size:12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    spacing = _EVEN if even else _UNEVEN
    start_s, step_s = (base.start_s, base.step_s) if even else (0.0, 0.0)
    records = [
        "    -1",
        binary,
        _line(channel.name, IDENTIFICATION) or "NONE",
        _line(f"{channel.quantity} {channel.role}".strip(), IDENTIFICATION),
        _line(f"shot {shot} rig {rig}", IDENTIFICATION),
        f"start_s={base.start_s!r} step_s={base.step_s!r}" if even else "NONE",
        _line(f"clock {base.clock}", IDENTIFICATION),
        f"{_TIME_RESPONSE:5d}{number:10d}{0:5d}{0:10d} {'NONE':>10s}{number:10d}{0:4d} {'NONE':>10s}{0:10d}{0:4d}",
        f"{_REAL_DOUBLE:10d}{base.count:10d}{spacing:10d}{start_s:13.5e}{step_s:13.5e}{0.0:13.5e}",
        axis.format(17, 0, 0, 0, "Time", "s"),
        axis.format(kind, 0, 0, 0, _line(channel.name, LABEL) or "NONE", channel.unit),
        unused,
        unused,
    ]
    return "".join(f"{record:<80s}\n" if i > 1 else f"{record}\n" for i, record in enumerate(records))
