"""Measure how time and memory grow with samples, channels and shots, and write docs/growth.md with its plots.

``python -m tests.growth`` measures all of it (half an hour; the text of 100 million samples takes 1.5 GB of disk).
``--only NAME`` measures one series (repeatable), ``--most N`` leaves larger sizes out, ``--no-write`` leaves the page
alone. It needs Linux, which tells the peak of memory.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from recoil_identification.report.figure.figure import Figure, Panel, Trace
from recoil_identification.report.figure.svg import figure_svg
from tests.growth.measure import SERIES, Point
from tests.proof.row import significant

DOCS = Path(__file__).resolve().parents[2] / "docs"
POINTS = DOCS / "growth.json"


def slope(points: Sequence[Point], column: str) -> float:
    """Return the exponent of growth: the slope of a straight line through all points on logarithmic axes."""
    sizes, values = np.log([p.size for p in points]), np.log([getattr(p, column) for p in points])
    return float(np.polyfit(sizes, values, 1)[0])


def last_slope(points: Sequence[Point], column: str) -> float:
    """Return the exponent between the two largest sizes, where what is fixed counts least."""
    return slope(points[-2:], column)


def section(name: str, points: Sequence[Point]) -> str:
    """Write what was measured of one series."""
    series = SERIES[name]
    rows = [
        f"| {p.size:,.0f} | {significant(p.cpu_s)} | {significant(p.wall_s)} | {significant(p.peak_mb, 3)} |"
        for p in points
    ]
    what = (series.measure.__doc__ or "").strip()
    growth = (
        f"Time grows as {series.by} to the power of {slope(points, 'cpu_s'):.2f} over all sizes and of "
        f"{last_slope(points, 'cpu_s'):.2f} between the two largest; memory as {slope(points, 'peak_mb'):.2f} and "
        f"{last_slope(points, 'peak_mb'):.2f}. `python -m tests.growth --only {name}`"
    )
    return "\n".join(
        [
            f"## {series.title} against {series.by}",
            "",
            what,
            "",
            f"![Time and memory of {series.title} against {series.by}](growth-{name}.svg)",
            "",
            f"| {series.by} | processor time, s | clock, s | peak memory, MB |",
            "|---|---|---|---|",
            *rows,
            "",
            growth,
            "",
        ]
    )


def page(measured: dict[str, list[Point]]) -> str:
    """Write the page."""
    head = (
        "# Growth\n\n"
        "How much time and memory a step takes on more data. `python -m tests.growth` measures it, each point in a\n"
        "process of its own, after its libraries are loaded. Processor time counts all threads. A power of 1 is\n"
        f"proportional, 0 does not grow. Measured with Python {sys.version.split()[0]} on {os.cpu_count()} cores.\n\n"
    )
    return head + "\n".join(section(name, measured[name]) for name in SERIES if measured.get(name))


def plot(name: str, points: Sequence[Point]) -> str:
    """Draw a series on logarithmic axes."""
    series, sizes = SERIES[name], [p.size for p in points]
    return figure_svg(
        Figure(
            f"growth-{name}",
            f"Time and memory of {series.title} against {series.by}",
            (series.measure.__doc__ or "").strip(),
            series.by,
            (
                Panel(
                    "processor time, s",
                    (Trace("processor time", sizes, [p.cpu_s for p in points], "series"),),
                    y_scale="log",
                ),
                Panel(
                    "peak memory, MB",
                    (Trace("peak memory", sizes, [p.peak_mb for p in points], "series"),),
                    y_scale="log",
                ),
            ),
            x_scale="log",
        )
    )


def main(words: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.growth", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--only", action="append", choices=SERIES, metavar="NAME", help=", ".join(SERIES))
    parser.add_argument("--most", type=float, default=float("inf"), help="largest size")
    parser.add_argument("--no-write", action="store_true", help="leave the page as it is")
    given = parser.parse_args(words)
    kept = json.loads(POINTS.read_text(encoding="utf-8")) if POINTS.exists() else {}
    measured = {name: [Point(*point) for point in points] for name, points in kept.items()}
    for name in given.only or SERIES:
        points = []
        for size in SERIES[name].sizes:
            if size <= given.most:
                points.append(SERIES[name].measure(size))
                print(name, *(f"{value:,.6g}" for value in points[-1]), flush=True)
        measured[name] = points
        if not given.no_write:
            POINTS.write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")
            (DOCS / f"growth-{name}.svg").write_text(plot(name, points), encoding="utf-8")
            (DOCS / "growth.md").write_text(page(measured), encoding="utf-8")


if __name__ == "__main__":
    main()
