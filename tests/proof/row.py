"""One line of the proof: a figure of this program beside its peer's, and the tables of such lines in the README."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

HEADINGS = {
    "peers": ("what was measured", "recoil-daq", "beside it", "ratio", "`--only`"),
    "truth": ("against the truth", "recoil-daq", "beside it", "ratio", "`--only`"),
    "cost": ("what it costs", "recoil-daq", "beside it", "ratio", "`--only`"),
}
"""Tables of the README, in their order, with the headings of their columns."""


SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


class Row(NamedTuple):
    """A figure beside its peer's, as people read them."""

    what: str
    ours: str
    peer: str
    ratio: str
    name: str
    """Of the measurement, which `--only` takes."""


def beside(what: str, ours: str, peers: Mapping[str, tuple[str, float]], name: str) -> Row:
    """Return the row of several peers, each by its figure and how many times as good ours is."""
    shown = "; ".join(f"{peer}: {figure}" for peer, (figure, _) in peers.items())
    return Row(what, ours, shown, ", ".join(times(ratio) for _, ratio in peers.values()), name)


def significant(value: float, digits: int = 2) -> str:
    """Write a number with so many digits that tell something."""
    text = f"{value:.{digits}g}"
    return f"{float(text):,.0f}" if "e+" in text else text


def times(ratio: float) -> str:
    """Write how many times as good ours is; of very many only the power of ten."""
    if ratio >= 1e5:
        return f"10{str(math.floor(math.log10(ratio))).translate(SUPERSCRIPTS)} ×"
    return f"{significant(ratio)} ×"


def table(name: str, rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table."""
    headings = HEADINGS[name]
    return [f"| {' | '.join(cells)} |" for cells in (headings, ("---",) * len(headings), *rows)]


def rewritten(page: str, name: str, rows: Sequence[Row], order: Sequence[str]) -> str:
    """Return a page with rows of one of its tables replaced; those of other measurements stay.

    Raises
    ------
    ValueError
        If the page has no place for the table.
    """
    begin, end = f"<!-- proof: {name} -->\n", "<!-- end of proof -->"
    found = re.search(re.escape(begin) + r"(.*?)" + re.escape(end), page, re.DOTALL)
    if found is None:
        raise ValueError(f"the page has no {begin.strip()} with {end} behind it")
    old = [line.strip("| ").split(" | ") for line in found[1].splitlines()[2:] if line.startswith("|")]
    measured = {row.name for row in rows}
    kept = [Row(*cells) for cells in old if len(cells) == len(Row._fields) and cells[-1] not in measured]
    both = sorted([*kept, *rows], key=lambda row: order.index(row.name) if row.name in order else len(order))
    return page[: found.start()] + begin + "\n".join(table(name, both)) + "\n" + end + page[found.end() :]
