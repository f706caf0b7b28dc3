"""Output of `explain`: trees for people."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import visible
from recoil_daq.terminal.console import output_console
from recoil_daq.terminal.tables import print_table, say
from recoil_identification.report.explanation import Entry, Given
from recoil_identification.report.reproduction import ELSEWHERE, Difference

if TYPE_CHECKING:
    from rich.tree import Tree

    from recoil_daq.reports.explanation import CheckedReports, Explained

MOST_SHOWN = 20
"""Differences that are printed of a report."""
TABLES = ("budget", "alignment")
"""Parts of a report whose rows have a line each, until one of them is asked for."""


@dataclass(frozen=True)
class Branch:
    """A line with lines below it."""

    text: str
    below: tuple[Branch, ...] = ()


def print_explained(done: Explained) -> None:
    """Print what was explained and what came again: branches on a terminal, indented lines in a pipe."""
    root = Branch(f"{done.report}: shot {done.shot} on rig {done.rig}", tuple(_branches(done)))
    if sys.stdout.isatty():
        output_console().print(_tree(root), soft_wrap=False)
        return
    for line in _indented(root, 0):
        say(line)


def print_checked(done: CheckedReports) -> None:
    """Print a row a report, what differs, and why some could not be made again."""
    rows = []
    for one in done.reports:
        found = one.comparison
        if found is None:
            rows.append((one.shot or one.report.parent.name, "", "", "", "fail", "could not be made again"))
            continue
        to = "to the last bit" if one.exact else f"within {ELSEWHERE:g}"
        verdict = f"comes again {to}" if one.again else f"does not come again {to}"
        worst = f"{found.largest:.1e}" if found.largest else "0"
        counts = str(found.numbers), str(len(found.differences))
        rows.append((one.shot, *counts, worst, "ok" if one.again else "fail", verdict))
    columns = ("shot", "numbers", "differing", "largest relative", "verdict", "again")
    print_table("Reports made again from their shot files", columns, rows, numeric=(1, 2, 3))
    for one in done.reports:
        if one.comparison is not None and one.comparison.differences:
            for line in _indented(_differences(str(one.report), one.comparison.differences), 0):
                say(line)
        if one.fault:
            say(f"FAILED {one.fault}")
    count = sum(one.again for one in done.reports)
    say(f"{count} of {len(done.reports)} reports come again")


def _branches(done: Explained) -> Iterator[Branch]:
    for entry in done.entries:
        yield _rows(entry) if done.key is None and entry.key in TABLES else _entry(entry)
    yield Branch("steps", tuple(Branch(step) for step in done.steps))
    yield Branch("parameters", tuple(_parameter(name, value) for name, value in done.parameters.items()))
    differ = [name for name in done.made.keys() | done.now.keys() if done.made.get(name) != done.now.get(name)]
    versions = [Branch(f"{name}: {value}{_now(done, name)}") for name, value in done.made.items()]
    yield Branch("versions" if not differ else "versions, which are not those of now", tuple(versions))
    files = [
        Branch(f"{one['file']}: {one['state']}", tuple(_digests(one["sha256"], one["sha256_now"], one["found"])))
        for one in done.files
    ]
    yield Branch("files", tuple(files))
    to = "to the last bit" if done.exact else f"within {ELSEWHERE:g}: other versions, or another kind of computer"
    if done.again:
        yield Branch(
            f"made again from the shot file: all {done.comparison.numbers} numbers of the report, mass.csv and "
            f"curves.csv come again {to}"
        )
        return
    yield _differences(
        f"made again from the shot file: of {done.comparison.numbers} numbers these do not come again {to}",
        done.differences,
    )


def _differences(title: str, found: Sequence[Difference]) -> Branch:
    lines = [Branch(str(one)) for one in found[:MOST_SHOWN]]
    if len(found) > MOST_SHOWN:
        lines.append(Branch(f"and {len(found) - MOST_SHOWN} more"))
    return Branch(title, tuple(lines))


def _now(done: Explained, name: str) -> str:
    now = done.now.get(name)
    return "" if now == done.made.get(name) else f", now {now}"


def _digests(stored: str, now: str | None, found: str | None) -> Iterator[Branch]:
    yield Branch(f"SHA-256 {stored}")
    if now is not None:
        yield Branch(f"found at {found}" + ("" if now == stored else f": SHA-256 {now}"))


def _parameter(name: str, value: Any) -> Branch:
    if isinstance(value, dict):
        return Branch(name, tuple(_parameter(key, one) for key, one in value.items()))
    return Branch(f"{name}: {_value(value)}")


def _entry(entry: Entry) -> Branch:
    below = list(_formula(entry))
    if entry.given:
        below.append(Branch("from", tuple(Branch(_given(one)) for one in entry.given)))
    below += [_entry(one) for one in entry.parts]
    if entry.parts:
        return Branch(entry.label, tuple(below))
    return Branch(f"{entry.label}: {_value(entry.value)}{f' {entry.unit}' if entry.unit else ''}", tuple(below))


def _rows(entry: Entry) -> Branch:
    """Put each row of a table on one line: its numbers, and the formula once."""
    rows = []
    for row in entry.parts:
        said = [
            f"{one.label} {_value(one.value)}{f' {one.unit}' if one.unit else ''}"
            for one in row.parts
            if one.value not in (None, [], "") and one.label != "sensitivity_per"
        ]
        rows.append(Branch(f"{row.label}: {', '.join(said)}", tuple(_formula(row))))
    shown = [part for row in entry.parts for part in row.parts if part.label in ("u_kg", "sensitivity_kg")]
    how = dict.fromkeys(line for part in shown for line in _formula(part))
    return Branch(entry.label, (*how, *rows))


def _formula(entry: Entry) -> Iterator[Branch]:
    if entry.formula is not None:
        yield Branch(f"formula: {entry.formula.text}", (Branch(f"source: {entry.formula.source}"),))


def _given(one: Given) -> str:
    words = [one.name]
    if one.value is not None:
        words = [f"{one.name}: {_value(one.value)}{f' {one.unit}' if one.unit not in ('', '1') else ''}"]
    if one.detail:
        words.append(one.detail)
    if one.u is not None:
        words.append(f"u_rel {_value(one.u)}" if one.value is None else f"u {_value(one.u)}")
    return ", ".join(words)


def _value(value: Any) -> str:
    if isinstance(value, str | Path):
        return str(value)
    return "none" if value is None else json.dumps(value)


def _indented(branch: Branch, depth: int) -> Iterator[str]:
    yield f"{'  ' * depth}{branch.text}"
    for one in branch.below:
        yield from _indented(one, depth + 1)


def _tree(branch: Branch) -> Tree:
    from rich.text import Text
    from rich.tree import Tree

    tree = Tree(Text(visible(branch.text)))
    for one in branch.below:
        tree.children.append(_tree(one))
    return tree
