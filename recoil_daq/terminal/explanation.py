"""Output of `explain`: trees for people."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import visible
from recoil_daq.terminal.console import output_console
from recoil_daq.terminal.tables import print_table, say
from recoil_identification.report.document.reproduction import Difference, NotCompared

if TYPE_CHECKING:
    from rich.tree import Tree

MOST_SHOWN = 20
"""Number of differences that are printed of a report."""
MAY_BE_INFINITE = ("degrees_of_freedom",)
"""Keys of a report whose null is a number without an end: JSON has none."""
TABLES = ("budget", "alignment")
"""Parts of a report whose rows have a line each, until one of them is asked for."""


@dataclass(frozen=True)
class Branch:
    """A line with lines below it."""

    text: str
    below: tuple[Branch, ...] = ()


def print_explained(document: Mapping[str, Any]) -> None:
    """Print what was explained and what came again: branches on a terminal, indented lines in a pipe.

    Parameters
    ----------
    document
        Document of ``explain --json``.
    """
    title = f"{document['report']}: shot {document['shot']} on rig {document['rig']}"
    root = Branch(title, tuple(_branches(document)))
    if sys.stdout.isatty():
        output_console().print(_tree(root), soft_wrap=False)
        return
    for line in _indented(root, 0):
        say(line)


def print_checked(document: Mapping[str, Any]) -> None:
    """Print a row a report, what differs, and why some could not be made again.

    Parameters
    ----------
    document
        Document of ``explain --check --json``.
    """
    reports = document["reports"]
    rows = []
    for one in reports:
        if one["numbers"] is None:
            shot = one["shot"] or Path(one["report"]).parent.name
            rows.append((shot, Path(one["report"]).name, "", "", "", "fail", "could not be made again"))
            continue
        verdict = f"{'does not come' if one['differing'] else 'comes'} again {_to(one)}"
        if not one["again"] and not one["differing"]:
            verdict = "not all of it was compared"
        worst = f"{one['largest_relative']:.1e}" if one["largest_relative"] else "0"
        counts = str(one["numbers"]), str(one["differing"])
        name = Path(one["report"]).name
        rows.append((one["shot"] or "", name, *counts, worst, "ok" if one["again"] else "fail", verdict))
    columns = ("shot or rig", "document", "numbers", "differing", "largest relative", "verdict", "again")
    print_table("Documents made again from what they rest on", columns, rows, numeric=(2, 3, 4))
    for one in reports:
        if one["differences"]:
            for line in _indented(_differences(one["report"], one), 0):
                say(line)
        if one["fault"]:
            say(f"FAILED {one['fault']}")
        for line in _not_compared(one):
            say(f"{Path(one['report']).parent / line}")
    count, drawings = sum(one["again"] for one in reports), sum(len(one["drawings"]) for one in reports)
    left = sum(len(one["not_compared"]) for one in reports)
    beside = f"; {left} files beside them were not compared" if left else ""
    say(f"{count} of {len(reports)} documents come again, {drawings} pages, copies and figures to the byte{beside}")


def _to(found: Mapping[str, Any]) -> str:
    """Say how closely numbers must come again."""
    return f"within {found['tolerance']:g}" if found["tolerance"] else "to the last bit"


def _branches(document: Mapping[str, Any]) -> Iterator[Branch]:
    for entry in document["explained"]:
        yield _rows(entry) if document["key"] is None and entry["key"] in TABLES else _entry(entry)
    yield Branch("steps", tuple(Branch(step) for step in document["steps"]))
    yield Branch("parameters", tuple(_parameter(name, value) for name, value in document["parameters"].items()))
    made, now = document["versions"]["made"], document["versions"]["now"]
    versions = [
        Branch(f"{name}: {value}{'' if now.get(name) == value else f', now {now.get(name)}'}")
        for name, value in made.items()
    ]
    yield Branch("versions" if made == now else "versions, which are not those of now", tuple(versions))
    files = [
        Branch(f"{one['file']}: {one['state']}", tuple(_digests(one["sha256"], one["sha256_now"], one["found"])))
        for one in document["files"]
    ]
    yield Branch("files", tuple(files))
    found = document["recomputed"]
    if found["not_compared"]:
        yield Branch("not compared", tuple(Branch(line) for line in _not_compared(found)))
    if found["drawings"]:
        yield Branch(f"drawn again to the byte: {', '.join(found['drawings'])}")
    to = _to(found) + (": other versions, or another kind of computer" if found["tolerance"] else "")
    if not found["differing"]:
        yield Branch(
            f"made again from what it rests on: all {found['numbers']} numbers of the document and of the tables "
            f"beside it come again {to}"
        )
        return
    yield _differences(
        f"made again from what it rests on: of {found['numbers']} numbers these do not come again {to}", found
    )


def _not_compared(found: Mapping[str, Any]) -> Iterator[str]:
    for one in found["not_compared"]:
        yield str(NotCompared(one["file"], one["why"], one["stated"]))


def _differences(title: str, found: Mapping[str, Any]) -> Branch:
    lines = [Branch(str(Difference.of_json(one))) for one in found["differences"][:MOST_SHOWN]]
    if found["differing"] > MOST_SHOWN:
        lines.append(Branch(f"and {found['differing'] - MOST_SHOWN} more"))
    return Branch(title, tuple(lines))


def _digests(stored: str, now: str | None, found: str | None) -> Iterator[Branch]:
    yield Branch(f"SHA-256 {stored}")
    if now is not None:
        yield Branch(f"found at {found}" + ("" if now == stored else f": SHA-256 {now}"))


def _parameter(name: str, value: Any) -> Branch:
    if isinstance(value, dict):
        return Branch(name, tuple(_parameter(key, one) for key, one in value.items()))
    return Branch(f"{name}: {_value(value)}")


def _entry(entry: Mapping[str, Any]) -> Branch:
    below = list(_formula(entry))
    if entry.get("inputs"):
        below.append(Branch("from", tuple(Branch(_given(one)) for one in entry["inputs"])))
    parts = entry.get("parts", ())
    below += [_entry(one) for one in parts]
    return Branch(entry["label"] if parts else _number(entry, ": "), tuple(below))


def _number(entry: Mapping[str, Any], sign: str) -> str:
    """Write what a value is, a sign, the value and its unit."""
    unit = f" {entry['unit']}" if entry.get("unit") else ""
    value = "infinite" if entry["label"] in MAY_BE_INFINITE and entry.get("value") is None else None
    return f"{entry['label']}{sign}{_value(entry.get('value')) if value is None else value}{unit}"


def _rows(entry: Mapping[str, Any]) -> Branch:
    """Put each row of a table on one line: its numbers, and the formula once."""
    rows, table = [], entry.get("parts", ())
    for row in table:
        said = [
            _number(one, " ")
            for one in row.get("parts", ())
            if one.get("value") not in (None, [], "") and one["label"] != "sensitivity_per"
        ]
        rows.append(Branch(f"{row['label']}: {', '.join(said)}", tuple(_formula(row))))
    shown = [part for row in table for part in row.get("parts", ()) if part["label"] in ("u_kg", "sensitivity_kg")]
    how = dict.fromkeys(line for part in shown for line in _formula(part))
    return Branch(entry["label"], (*how, *rows))


def _formula(entry: Mapping[str, Any]) -> Iterator[Branch]:
    if "formula" in entry:
        yield Branch(f"formula: {entry['formula']}", (Branch(f"source: {entry['source']}"),))


def _given(one: Mapping[str, Any]) -> str:
    words = [one["name"]]
    if one["value"] is not None:
        unit = "" if one["unit"] in ("", "1") else f" {one['unit']}"
        words = [f"{one['name']}: {_value(one['value'])}{unit}"]
    if one["detail"]:
        words.append(one["detail"])
    if one["u"] is not None:
        words.append(f"{'u_rel' if one['value'] is None else 'u'} {_value(one['u'])}")
    return ", ".join(words)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return value
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
