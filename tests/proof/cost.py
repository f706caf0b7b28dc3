"""What it costs to have it and to start it, beside programs of the same field."""

from __future__ import annotations

import subprocess
import sys
import time
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

from tests.proof.row import Row, beside, significant

ROOT = Path(__file__).resolve().parents[2]
SOURCES = (
    "recoil_daq",
    *(
        f"{folder}/recoil_{name}"
        for folder, name in (
            ("identification", "identification"),
            ("processing", "processing"),
            ("rigs", "rigs"),
            ("daq", "acquisition"),
        )
    ),
)


def seconds_of(*words: str, rounds: int) -> float:
    """Return the least time of a process of its own, s."""
    took = []
    for _ in range(rounds):
        begin_s = time.perf_counter()
        subprocess.run([sys.executable, *words], check=True, capture_output=True)
        took.append(time.perf_counter() - begin_s)
    return min(took)


def start(quick: bool, _: Path) -> list[Row]:
    """How long a command takes to answer."""
    rounds = 1 if quick else 10
    ours_s = seconds_of("-c", "from recoil_daq.cli import main; main()", "--help", rounds=rounds)
    commands = {
        "cantools --help": ("-m", "cantools", "--help"),
        "asammdf, imported": ("-c", "import asammdf"),
        "Python itself": ("-c", "pass"),
    }
    took = {name: seconds_of(*words, rounds=rounds) for name, words in commands.items()}
    peers = {name: (f"{significant(theirs_s)} s", theirs_s / ours_s) for name, theirs_s in took.items()}
    return [beside("`recoil-daq --help`", f"{significant(ours_s)} s", peers, "start")]


def needed(name: str) -> set[str]:
    """Return the names of a distribution and of all that it needs here, extras left out."""
    found: set[str] = set()
    open_names = [name]
    while open_names:
        one = open_names.pop().lower().replace("_", "-")
        if one in found:
            continue
        try:
            requirements = distribution(one).requires or []
        except PackageNotFoundError:
            continue
        found.add(one)
        parsed = [Requirement(text) for text in requirements]
        open_names += [r.name for r in parsed if r.marker is None or r.marker.evaluate({"extra": ""})]
    return found


def megabytes(names: set[str]) -> float:
    """Return how much the files of distributions take on the disk, bytecode left out."""
    files = {
        Path(str(file.locate())) for name in names for file in distribution(name).files or [] if file.suffix != ".pyc"
    }
    return sum(file.stat().st_size for file in files if file.is_file()) / 1e6


def size(_quick: bool, _: Path) -> list[Row]:
    """How much an installation takes, with all that it needs."""
    own = sum(
        f.stat().st_size for source in SOURCES for f in (ROOT / source).rglob("*") if f.suffix != ".pyc" and f.is_file()
    )
    names = needed("recoil-daq") - {"recoil-daq"}
    whole = own / 1e6 + megabytes(names)
    peers = {}
    for peer in ("asammdf", "obspy"):
        its = needed(peer)
        if its:
            peers[peer] = (f"{significant(megabytes(its), 3)} MB, {len(its)} packages", megabytes(its) / whole)
    ours = f"{significant(whole, 3)} MB, {len(names) + 1} packages, of which its own {significant(own / 1e6)} MB"
    return [beside("installed, with all that it needs", ours, peers, "size")]
