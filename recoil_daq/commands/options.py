"""Arguments and options that several commands take."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any

import typer

from recoil_daq.commands.completion import complete_rig

RigArgument = Annotated[
    str,
    typer.Argument(
        help="A rig file (TOML) or the name of a bundled rig.", show_default=False, autocompletion=complete_rig
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout and nothing else there.")]
DebugOption = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
VerboseOption = Annotated[
    bool, typer.Option("--verbose", "-v", help="Print each method, note and assumption, as the report has them.")
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace what exists.")]
WorkersOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Processes that share the shots; 1: this one alone.",
        show_default="one for each core, from 4 shots on",
    ),
]


def quantity(unit: str, least: float = -math.inf, *, positive: bool = False) -> Callable[[str | float], float]:
    """Return the parser of an option's number: with a decimal point or a decimal comma, perhaps with its unit.

    Parameters
    ----------
    unit
        Unit of the number; empty for a share.
    least, positive
        Least number that the option takes, and whether it must be more than 0.
    """

    def number(value: str | float) -> float:
        if not isinstance(value, str):
            return value
        from recoil_acquisition.quantities.typed_quantity import TypedError, typed_quantity

        try:
            found = typed_quantity(value, unit)
        except TypedError as error:
            raise typer.BadParameter(f"{value!r} {error}") from None
        if found < least or (positive and found <= 0.0):
            wanted = "more than 0" if positive else f"at least {least:g}"
            raise typer.BadParameter(f"{value!r} must be {wanted} {unit}".rstrip())
        return found

    return number


def number(unit: str, metavar: str, text: str, shown: str | bool = True, *, least: float = -math.inf) -> Any:
    """Declare an option that takes a number.

    Parameters
    ----------
    unit, least
        Unit and least number, as of `quantity`.
    metavar, text, shown
        Placeholder, help and default in the help.
    """
    return typer.Option(parser=quantity(unit, least), metavar=metavar, help=text, show_default=shown)


def cells_of(words: list[str]) -> dict[str, str]:
    """Read KEY=VALUE words."""
    cells: dict[str, str] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key.strip():
            raise typer.BadParameter(f"{word!r} is not KEY=VALUE")
        if key.strip() in cells:
            raise typer.BadParameter(f"{key.strip()} is given twice")
        cells[key.strip()] = value
    return cells
