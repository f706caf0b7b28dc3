"""Print every figure of the README beside its peer's, measured in one run, and write the README's tables.

``python -m tests.proof`` measures all of it (half an hour; it needs the extras `test` and `bench`), ``--only NAME`` one
part (repeatable), ``--quick`` little of each, to see that it works, and writes nothing. RECOIL_DAQ_COVERAGE_SHOTS (40
of each rig) and RECOIL_DAQ_CAMPAIGNS (40) say how many shots and campaigns are fired, RECOIL_DAQ_REPLAYS (60) how often
they are put together anew, RECOIL_DAQ_DAYS (60) how many documented days are lived, RECOIL_DAQ_TEXT_MB (1000) how long
the text is. Every comparison checks first that both sides give the same. Speeds are those of processor time, the best
of some repetitions; of text and of starting, of the clock on the wall.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

# read when the libraries are loaded
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("RECOIL_DAQ_CAMPAIGNS", "40")
os.environ.setdefault("RECOIL_DAQ_DAYS", "60")

from tests.proof import cost, peers, truth
from tests.proof.row import HEADINGS, Row, rewritten, table

README = Path(__file__).resolve().parents[2] / "README.md"

MEASURED: dict[str, tuple[str, Callable[[bool, Path], list[Row]]]] = {
    "rolling": ("peers", peers.rolling),
    "text": ("peers", peers.table_of_text),
    "can": ("peers", peers.decoding),
    "logs": ("peers", peers.logs),
    "filters": ("peers", peers.filters),
    "alignment": ("truth", truth.alignment),
    "shots": ("truth", truth.shots),
    "campaign": ("truth", truth.many_shots),
    "days": ("truth", truth.days),
    "windows": ("truth", truth.windows),
    "start": ("cost", cost.start),
    "size": ("cost", cost.size),
}
"""Table of the README and measurement, by what `--only` takes."""


def main(words: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.proof", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--only", action="append", choices=MEASURED, metavar="NAME", help=", ".join(MEASURED))
    parser.add_argument("--quick", action="store_true", help="little of each, to see that it works; writes nothing")
    parser.add_argument("--no-write", action="store_true", help="leave the README as it is")
    given = parser.parse_args(words)
    for name in given.only or MEASURED:
        kind, measure = MEASURED[name]
        began_s = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            rows = measure(given.quick, Path(folder))
        print(f"{name}, {time.perf_counter() - began_s:.0f} s", *table(kind, rows), "", sep="\n", flush=True)
        if not (given.quick or given.no_write):
            page = rewritten(README.read_text(encoding="utf-8"), kind, rows, list(MEASURED))
            README.write_text(page, encoding="utf-8")
    if not given.quick:
        print(f"Python {sys.version.split()[0]}, {os.cpu_count()} cores; tables: {', '.join(HEADINGS)}")


if __name__ == "__main__":
    main()
