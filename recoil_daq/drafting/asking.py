"""Questions of a draft at a terminal: each is asked until it is answered or left open."""

from __future__ import annotations

from collections.abc import MutableMapping, Sequence
from typing import Any

import typer

from recoil_acquisition.errors import KeyPath, spelled, visible
from recoil_acquisition.files.bounded_toml import toml_value
from recoil_daq.drafting.answer import Answer
from recoil_daq.drafting.rig_draft import OpenEntry


def ask(questions: Sequence[OpenEntry], answers: MutableMapping[KeyPath, Answer]) -> bool:
    """Ask for each open value at the terminal; Enter takes what is proposed, or leaves it open.

    What is no value of its key is said with what would be one, and asked for again.

    Parameters
    ----------
    answers
        Mapping that gets each answer by its key as it is given; questions left open have none.

    Returns
    -------
    bool
        Whether more may be asked: False behind a full stop.

    Raises
    ------
    KeyboardInterrupt
        If whoever is asked ends it; the answers so far are in `answers`.
    """
    for number, one in enumerate(questions, 1):
        typer.echo(visible(f"[{number} of {len(questions)}] {spelled(one.parts)}: {one.question.meaning}"), err=True)
        while True:
            text = _typed(one.question.proposal)
            if not text:
                break
            if text == ".":
                return False
            try:
                answers[one.parts] = answer = one.question.read(text)
            except ValueError as error:
                typer.echo(visible(f"   {text[:60]!r} {error}; once more, or Enter"), err=True)
                continue
            if answer.typed:
                typer.echo(visible(f"   taken as {toml_value(answer.value)} {answer.unit}".rstrip()), err=True)
            if answer.doubt:
                typer.echo(visible(f"   {answer.doubt}"), err=True)
            break
    return True


def print_how_to_answer() -> None:
    """Say at the terminal how questions are answered."""
    typer.echo(
        "Enter takes what stands in brackets, or leaves the value open; a full stop leaves all that follow open.\n"
        "A number may have a decimal comma and a unit, such as 0,86 deg; Ctrl-C writes the answers so far",
        err=True,
    )


def _typed(offered: Any) -> str:
    """Return what is typed at the terminal, or what is offered where Enter alone was pressed."""
    default = "" if offered is None else offered if isinstance(offered, str) else toml_value(offered)
    try:
        text: str = typer.prompt("  ", default=default, show_default=offered is not None, err=True)
    except typer.Abort as ended:
        typer.echo(err=True)  # behind ^C
        raise KeyboardInterrupt from ended
    return text.strip()
