"""What the fuzzer calls: bytes are given to the reader that claims them, and may be read or refused, nothing else.

Run by `test_fuzz_benchmark.py` in a process of its own: ``python -m tests.benchmarks.fuzz_readers CORPUS [options]``.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["daq"]):
    from recoil_acquisition.errors import ReadError
    from recoil_acquisition.readers.head import HEAD_BYTES, Head
    from recoil_acquisition.readers.table import READERS

from tests.contracts.test_reader_rules import CASES, WITHOUT_CASE

FOLDER = Path(tempfile.mkdtemp(prefix="recoil-daq-fuzz-"))
LARGEST_GROWTH, LEAST_BYTES = 10, 1 << 22
"""Numbers that a recording may hold for each byte of its file, and how many are always allowed."""


def read_or_refuse(content: bytes) -> None:
    """Open and read a file by every reader that claims it; anything but a `ReadError` is a finding."""
    path = FOLDER / "fuzzed"
    path.write_bytes(content)
    for reader in READERS:
        if reader.name in WITHOUT_CASE or not reader.claims(Head(content[:HEAD_BYTES], path)):
            continue
        declared = next(case.declared for case in CASES if case.reader.name == reader.name)
        try:
            recording = reader.open(path, declared)
            total = 0
            for signal in recording.signals:
                total += recording.read(signal.name).nbytes + recording.time_base(signal.name).count
            _ = recording.notes, recording.tracks()
        except ReadError:
            continue
        if total > max(LARGEST_GROWTH * 8 * len(content), LEAST_BYTES):
            raise MemoryError(f"{reader.name}: {total} bytes of samples from {len(content)} bytes of file")


def main() -> None:
    """Write the corpus of the readers' own cases, and fuzz."""
    corpus = Path(sys.argv[1])
    corpus.mkdir(parents=True, exist_ok=True)
    for case in CASES:
        (corpus / case.name).write_bytes(case.content)
    atheris.Setup(sys.argv, read_or_refuse)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
