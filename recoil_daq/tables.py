"""How the commands print: aligned tables, lines as they are, and the verdict on a result."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.visible_text import visible
from recoil_daq.console import output_console

if TYPE_CHECKING:
    from rich.console import Console

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

    On a terminal too narrow for it, cells but the last column's end in an ellipsis; with `fold`, those but the first
    column's go on below.
    """
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for i, column in enumerate(columns):
        table.add_column(
            column, justify="right" if i in numeric else "left", no_wrap=i == 0 if fold else i < len(columns) - 1,
            overflow="fold" if fold else "ellipsis",
        )  # fmt: skip
    for row in rows:
        cells = [escape(visible(cell)) for cell in row]
        table.add_row(*(f"[{STYLES[c]}]{c}[/]" if c in STYLES else c for c in cells))
    console = console or output_console()
    console.print(title, style="italic", markup=False, soft_wrap=True)
    console.print(table)


def say(text: str, console: Console | None = None) -> None:
    """Print one line as it is, on stdout if no console is given."""
    (console or output_console()).print(text, markup=False, soft_wrap=True)


def print_outcome(document: Mapping[str, Any], page: Path) -> None:
    """Print the notes of a result, whether it is valid, why not, and where its page is."""
    for note in document["notes"]:
        say(f"note: {note}")
    print_assumptions(document)
    console, told = output_console(), document["reasons"]
    if not document["valid"]:
        console.print("[bold red]NOT VALID[/]:", end=" ")
        say(told[0])
        for reason in told[1:]:
            say(f"and: {reason}")
    elif document.get("deviation"):
        console.print("[bold yellow]VALID[/],", end=" ")
        say(document["deviation"])
    else:
        console.print("[bold green]VALID[/]", end=" ")
    say(f"-> {page}")


def print_assumptions(document: Mapping[str, Any], console: Console | None = None) -> None:
    """Print what is taken for granted, a line for each kind of it."""
    from recoil_rigs.assumptions import assumption_lines

    for line in assumption_lines(document.get("assumptions", ())):
        say(line, console)


def fixed(value: float | None, decimals: int, *, scale: float = 1.0, sign: bool = False) -> str:
    """Write a number, times a scale, to so many decimals; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{scale * value:{'+' if sign else ''}.{decimals}f}"
