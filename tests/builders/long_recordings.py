"""A recorder that was left running: one shot of the virtual rig somewhere in minutes of rest."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from recoil_rigs.rig import Rig, find_rig, parse_rig
from tests.builders.oxygen_dmd import Stored, oxygen_chunks

STEP_S = 2e-5
REST_ROWS = 2400
"""Rows of a shot's own rest before it, which are repeated before and after."""
ROWS_AT_ONCE = 200_000
FULL_SCALE = 2**23 - 1

TRIGGER = """
[trigger]
pre_s = 0.05
post_s = 0.45

[[trigger.any]]
channel = "p_breech"
kind = "edge"
level = 10e6
rearm = 5e6
"""


def triggered_rig(name: str = "field-2013") -> Rig:
    """Load a bundled rig with a trigger at the breech pressure."""
    path = find_rig(name)
    head, mark, tail = path.read_text(encoding="utf-8").partition("[twin]")
    return parse_rig(f"{head}{TRIGGER}\n{mark}{tail}", path)


def source_rows(numbers: range, at_rows: tuple[int, ...], shot_rows: int) -> np.ndarray:
    """Return which row of a shot's file each row of the long recording is, shape (n_rows,)."""
    rows = np.arange(numbers.start, numbers.stop)
    source = rows % REST_ROWS
    for at in at_rows:
        within = (rows >= at) & (rows < at + shot_rows)
        source[within] = rows[within] - at
    return source


def write_long_text(shot: Path, target: Path, at_rows: tuple[int, ...], row_count: int) -> None:
    """Write the text export of a recording in which a shot begins at some rows."""
    header, *lines = shot.read_text(encoding="utf-8").splitlines()
    bodies = [line.partition(",")[2] for line in lines]
    with target.open("w", encoding="utf-8", newline="") as file:
        file.write(header + "\n")
        for first in range(0, row_count, ROWS_AT_ONCE):
            numbers = range(first, min(first + ROWS_AT_ONCE, row_count))
            chosen = source_rows(numbers, at_rows, len(bodies)).tolist()
            rows = (f"{k * STEP_S:.6f},{bodies[i]}\n" for k, i in zip(numbers, chosen, strict=True))
            file.write("".join(rows))


def long_dmd(shot: Path, at_rows: tuple[int, ...], row_count: int, per_block: int = 10_000) -> Iterator[bytes]:
    """Yield the recording of OXYGEN in which a shot begins at some rows."""
    recording = recognise(shot).open(shot, Declarations("dewetron"))
    channels = []
    for header in recording.signals:
        samples = recording.read(header.name)
        gain = float(f"{max(np.abs(samples).max(), 1e-6) / FULL_SCALE * 1.01:.6g}")
        counts = np.round(samples / gain).astype(np.int32)

        def numbers(low: int, high: int, counts: np.ndarray = counts) -> np.ndarray:
            return counts[source_rows(range(low, high), at_rows, counts.size)]

        scaling = f'<Scaling><Linear k="{gain!r}" d="0"/></Scaling>'
        channels.append(Stored(header.name, numbers, header.unit, scaling=scaling))
    blocks = [(first, min(per_block, row_count - first)) for first in range(0, row_count, per_block)]
    return oxygen_chunks(channels, windows=((0, row_count),), blocks=blocks, frequency_hz=1 / STEP_S)
