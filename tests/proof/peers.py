"""Programs that do a part of the work, on the same data in the same run."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.benchmarks import test_alignment_benchmark as aligning
from tests.benchmarks import test_can_benchmark as bus
from tests.benchmarks import test_limited_memory_benchmark as memory
from tests.benchmarks import test_text_benchmark as text
from tests.builders.beside import Beside
from tests.proof.row import Row, beside, significant, times


def speed(what: str, took: Beside, count: float, unit: str, peer: str, name: str) -> Row:
    """Return the row of two speeds in millions."""
    ours, theirs = (f"{significant(count / seconds / 1e6)} {unit}" for seconds in took)
    return Row(what, ours, f"{peer}: {theirs}", times(took.times), name)


def rolling(quick: bool, _: Path) -> list[Row]:
    """Limited-memory least squares beside statsmodels' rolling OLS."""
    count = 20_000 if quick else 1_000_000
    took = memory.beside_statsmodels(count, 5, memory.WINDOW, rounds=1 if quick else 5)
    errors = memory.errors_after_bursts(8_000 if quick else 300_000)
    ours, theirs = (float(np.nanmax(errors[name])) for name in ("ours", "statsmodels"))
    what = f"limited-memory least squares, 5 parameters, {memory.WINDOW} samples"
    return [
        speed(f"{what}, with standard errors", took, count, "million samples/s", "statsmodels RollingOLS", "rolling"),
        Row(
            "the same behind a shot: largest relative error",
            significant(ours),
            f"RollingOLS: {significant(theirs)}",
            times(theirs / ours),
            "rolling",
        ),
    ]


def table_of_text(quick: bool, folder: Path) -> list[Row]:
    """A long Dewesoft text export beside pandas."""
    path = folder / "long.csv"
    megabytes = text.write_export(path, 2.0 if quick else text.MEGABYTES)
    ours, pandas = text.beside_pandas(path, 1 if quick else text.ROUNDS)
    path.unlink()
    what = f"reading {significant(megabytes)} MB of text"
    return [
        Row(
            what,
            f"{significant(megabytes / ours.seconds)} MB/s",
            f"pandas read_csv: {significant(megabytes / pandas.seconds)} MB/s",
            times(pandas.seconds / ours.seconds),
            "text",
        ),
        Row(
            f"{what}: peak memory",
            f"{significant(ours.peak_mb)} MB",
            f"pandas: {significant(pandas.peak_mb)} MB",
            times(pandas.peak_mb / ours.peak_mb),
            "text",
        ),
    ]


def decoding(quick: bool, folder: Path) -> list[Row]:
    """Signals of CAN frames beside cantools, and of a bus log in MDF 4 beside asammdf."""
    frames, rounds = (2_000, 1) if quick else (bus.FRAMES, 5)
    cantools = bus.decoded_beside_cantools(frames, rounds=rounds)
    asammdf, _ = bus.extracted_beside_asammdf(folder, frames, rounds=rounds)
    unit = "million frames/s"
    return [
        speed("CAN frames to 4 signals each", cantools, frames, unit, "cantools", "can"),
        speed("MDF 4 bus log to signals", asammdf, frames, unit, "asammdf", "can"),
    ]


def logs(quick: bool, folder: Path) -> list[Row]:
    """Logs of CAN buses beside python-can."""
    frames, rounds = (2_000, 1) if quick else (bus.FRAMES, 5)
    names = {"asc": "Vector ASC", "log": "candump", "blf": "Vector BLF"}
    return [
        speed(
            f"reading a log, {name}",
            bus.read_beside_python_can(folder, suffix, frames, rounds=rounds),
            frames,
            "million frames/s",
            "python-can",
            "logs",
        )
        for suffix, name in names.items()
    ]


def filters(quick: bool, _: Path) -> list[Row]:
    """A zero-phase low-pass beside scipy's."""
    count = 20_000 if quick else 1_000_000
    took = aligning.filtered_beside_scipy(count, rounds=1 if quick else 5)
    speeds = {
        f"scipy {name}": (f"{significant(8.0 * count / one.theirs_s / 1e6)}", one.times) for name, one in took.items()
    }
    ours = f"{significant(8.0 * count / min(one.ours_s for one in took.values()) / 1e6)} million samples/s"
    return [beside("zero-phase low-pass, 8 channels, same result", ours, speeds, "filters")]
