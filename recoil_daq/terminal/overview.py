"""The table at the end of every command over many shots: a row each, with how far it is to be trusted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from recoil_daq.terminal.console import output_console
from recoil_daq.terminal.tables import fixed, print_table, width_of
from recoil_rigs.tables.specification import mass_decimals

HEADINGS = {
    "shot": "shot", "fired": "fired at", "target": "target", "quantity": "first quantity", "value": "value", "u": "u",
    "files": "files", "check": "check", "state": "recording",
    "warnings": "warnings", "mass": "mass, kg", "U": "U, kg", "e_n": "E_n", "verdict": "verdict",
    "reason": "first reason",
}  # fmt: skip
"""Key of a row's cell -> heading, in the order of the columns."""
NUMERIC = ("value", "u", "files", "warnings", "mass", "U", "e_n")
SPARED = ("fired", "quantity", "check", "warnings", "files", "state", "e_n")
"""Columns that a terminal goes without which is too narrow for them, the first one first."""


def print_shots(title: str, rows: Sequence[Mapping[str, str]], reason: str = HEADINGS["reason"]) -> None:
    """Print a row a shot, of the columns in which anything stands.

    Parameters
    ----------
    rows
        Cells of each shot, with keys of `HEADINGS`.
    reason
        Heading of the last column.
    """
    columns = [key for key in HEADINGS if any(row.get(key) for row in rows)]
    heads = HEADINGS | {"reason": reason}
    texts = [[heads[key], *(row.get(key, "") for row in rows)] for key in columns]
    widths = {key: width_of(text) for key, text in zip(columns, texts, strict=True) if key != "reason"}
    for spared in SPARED:
        if sum(widths.values()) + 2 * (len(widths) - 1) <= output_console().width:
            break
        widths.pop(spared, None)
    shown = [key for key in columns if key in widths or key == "reason"]
    print_table(
        title,
        [heads[key] for key in shown],
        [[row.get(key, "") for key in shown] for row in rows],
        numeric=[place for place, key in enumerate(shown) if key in NUMERIC],
    )


def mass_cells(mass_kg: float | None, u95: Sequence[float | None], e_n: float | None) -> dict[str, str]:
    """Return the cells of a mass, with the digits that its 95 % interval justifies."""
    low, high = u95
    half = None if low is None or high is None else (high - low) / 2
    places = 2 if half is None else mass_decimals(half / 2)
    return {"mass": fixed(mass_kg, places), "U": fixed(half, places), "e_n": fixed(e_n, 2, sign=True)}


def verdict_cell(valid: bool | None, *, deviates: bool = False, conformity: str = "") -> str:
    """Return the words for how far a mass is to be trusted, and conforms; None is one that nobody identified."""
    if valid is None:
        return "no report"
    if not valid:
        return "NOT VALID"
    return ", ".join(filter(None, ("VALID", "deviates" if deviates else "", conformity)))
