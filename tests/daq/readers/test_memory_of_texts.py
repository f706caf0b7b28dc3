"""What a text takes to read, beside its size: opened, every signal read once, its tracks and instants kept."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest

from recoil_acquisition.readers.table import READERS, TableReader
from tests.builders.long_texts import LONG_TEXTS

MOST_RATIO = 10
SIZE = 1_500_000

LINE_BY_LINE = {"trc", "can-csv", "canedge-csv", "declared-tracks"}
"""Texts that take long, and are taken in smaller parts."""
IN_LONG_PIECES = {"tracker-spaces"}
"""Texts whose pieces are long, so that only a longer text shows what grows with it."""


def test_there_is_a_long_text_of_every_reader_of_texts() -> None:
    texts = {r.name for r in READERS if isinstance(r, TableReader) and any(isinstance(sign, str) for sign in r.signs)}
    assert texts <= {text.reader.name for text in LONG_TEXTS.values()}
    assert len(texts) > 10


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", LONG_TEXTS)
def test_a_text_takes_at_most_ten_times_its_size(name: str, tmp_path: Path) -> None:
    text = LONG_TEXTS[name]
    size = SIZE // 4 if name in LINE_BY_LINE else 2 * SIZE if name in IN_LONG_PIECES else SIZE
    small, path = tmp_path / "small", tmp_path / "long"
    small.write_bytes(text.content(20_000))
    path.write_bytes(text.content(size))
    read_all(name, small)  # what is imported at the first reading is none of a file's
    tracemalloc.start()
    try:
        samples = read_all(name, path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert samples > size // 100
    assert peak / path.stat().st_size <= MOST_RATIO


def read_all(name: str, path: Path) -> int:
    """Open a file and read all of it; return the number of its samples."""
    text = LONG_TEXTS[name]
    recording = text.reader.open(path, text.declared)
    tracks = recording.tracks()
    bases = {}
    for signal in recording.signals:
        assert recording.read(signal.name).size == signal.sample_count
        bases[signal.name] = recording.time_base(signal.name)
    assert bases
    assert bool(tracks) == (text.reader.kind == "camera")
    return sum(signal.sample_count for signal in recording.signals)
