"""How the commands print: aligned tables, lines as they are, and the verdict on a result."""

from __future__ import annotations

import io
import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import visible
from recoil_daq.terminal.console import output_console

if TYPE_CHECKING:
    from rich.console import Console

_GAP, _ANY_WIDTH = 2, 10_000
LEAST_PROSE = 32
"""Columns that a sentence needs to be read."""
STYLES = {"ok": "green", "warn": "yellow", "fail": "bold red"}


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    numeric: Sequence[int] = (),
    console: Console | None = None,
    fold: bool = False,
) -> None:
    """Print a table on stdout; cells that are a verdict are coloured, columns of numbers stand to the right.

    On a terminal too narrow for it, what the last column says stands below its row, in whole words, and other cells
    end in an ellipsis; with `fold`, those but the first column's go on below.
    """
    from rich.markup import escape
    from rich.table import Table

    console = console or output_console()
    if not fold and len(columns) - 1 not in numeric and _leaves_too_little(columns, rows, console.width):
        _print_above_prose(title, columns, rows, numeric, console)
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for i, column in enumerate(columns):
        table.add_column(
            column, justify="right" if i in numeric else "left", no_wrap=i == 0 if fold else i < len(columns) - 1,
            overflow="fold" if fold else "ellipsis",
        )  # fmt: skip
    for row in rows:
        cells = [escape(visible(cell)) for cell in row]
        table.add_row(*(f"[{STYLES[c]}]{c}[/]" if c in STYLES else c for c in cells))
    console.print(title, style="italic", markup=False, soft_wrap=True)
    console.print(table)


def _leaves_too_little(columns: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> bool:
    """Return whether the last column would be so narrow that its sentences fall apart."""
    widths = [width_of(column) for column in zip(columns, *rows, strict=True)]
    room = width - sum(widths[:-1]) - _GAP * (len(columns) - 1)
    return len(columns) > 1 and 0 <= room < min(widths[-1], LEAST_PROSE)


def width_of(cells: Iterable[str]) -> int:
    """Return how many columns of a terminal the widest of some cells takes."""
    from rich.cells import cell_len

    return max(cell_len(visible(cell)) for cell in cells)


def _print_above_prose(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], numeric: Sequence[int], console: Console
) -> None:
    """Print a table whose last column stands beside each row where it has room, else below it across the terminal."""
    from rich.cells import cell_len
    from rich.text import Text

    table = io.StringIO()
    short = type(console)(file=table, width=_ANY_WIDTH, color_system=None)
    print_table("", columns[:-1], [row[:-1] for row in rows], numeric, short)
    _, *lines = table.getvalue().splitlines()
    console.print(title, style="italic", markup=False, soft_wrap=True)
    styles = ["bold", *("" for _ in rows)]
    for line, style, row in zip(lines, styles, [columns, *rows], strict=True):
        text = Text(line.rstrip(), style=style)
        for cell in row[:-1]:
            if cell in STYLES:
                text.highlight_words([f" {cell}"], style=STYLES[cell])
        beside = max(map(len, (one.rstrip() for one in lines))) + _GAP
        if beside + cell_len(prose := visible(row[-1])) <= console.width:
            text.append(" " * (beside - text.cell_len) + prose if prose else "", style=style)
            console.print(text, soft_wrap=True)
            continue
        console.print(text, soft_wrap=True)
        for part in textwrap.wrap(visible(row[-1]), max(console.width - 4, 20), break_long_words=False):
            console.print(f"    {part}", style=style, markup=False, soft_wrap=True)


def say(text: str, console: Console | None = None) -> None:
    """Print one line as it is, on stdout if no console is given."""
    (console or output_console()).print(text, markup=False, soft_wrap=True)


def print_outcome(document: Mapping[str, Any], page: Path | None, told: set[str] | None = None) -> None:
    """Print the notes of a result, whether it is valid, why not, and where its page is, if it has one.

    Parameters
    ----------
    told
        Lines on what is taken for granted that were printed for other shots; see `say_once`.
    """
    for note in document["notes"]:
        say(f"note: {note}")
    print_assumptions(document, told=told)
    print_verdict(document, page, document["reasons"][1:])


def print_verdict(document: Mapping[str, Any], page: Path | None, more: Sequence[str] = ()) -> None:
    """Print whether a result is valid, the first reason why not, more of them, and where its page is."""
    from recoil_rigs.tables.calibration_day import calibrations_in_words

    console, reasons, dated = output_console(), document["reasons"], calibrations_in_words(document)
    if not document["valid"]:
        console.print("[bold red]NOT VALID[/]:", end=" ")
        say(reasons[0])
        for reason in more:
            say(f"and: {reason}")
    elif document.get("deviation"):
        console.print("[bold yellow]VALID[/],", end=" ")
        say(document["deviation"])
    elif dated:
        console.print("[bold yellow]VALID[/],", end=" ")
    else:
        console.print("[bold green]VALID[/]", end=" ")
    if dated:
        say(f"{'but' if document['valid'] else 'and:'} {dated}")
    say("" if page is None else f"-> {page}")


def print_assumptions(
    document: Mapping[str, Any], console: Console | None = None, told: set[str] | None = None
) -> None:
    """Print what is taken for granted, a line for each kind of it, as `say_once` prints them."""
    from recoil_rigs.shots.assumptions import assumption_lines

    say_once(assumption_lines(document.get("assumptions", ())), told, console)


def say_once(lines: Sequence[str], told: set[str] | None, console: Console | None = None) -> None:
    """Print lines that were not printed for another shot.

    Parameters
    ----------
    told
        Lines that were, to which those printed now are added; None for one shot alone.
    """
    for line in lines:
        if told is None or line not in told:
            say(line, console)
    if told is not None:
        told.update(lines)


def fixed(value: float | None, decimals: int, *, scale: float = 1.0, sign: bool = False) -> str:
    """Write a number, times a scale, to so many decimals; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{scale * value:{'+' if sign else ''}.{decimals}f}"
