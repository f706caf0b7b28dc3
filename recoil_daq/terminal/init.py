"""Output of `init`: what the files told, what is proposed and why, and what only a person knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import typer

from recoil_acquisition.bounded_toml import typed_value
from recoil_acquisition.errors import KeyPath, quoted, spelled, visible
from recoil_daq.terminal.tables import print_table, say


def print_draft(document: Mapping[str, Any]) -> None:
    """Print what stands in the draft of a rig file.

    Parameters
    ----------
    document
        Document of ``init --json``.
    """
    rows = [(one["name"], one["kind"], one["file"], one["format"], str(one["signals"])) for one in document["sources"]]
    print_table("Sources", ("source", "kind", "file", "format", "signals"), rows, (4,))
    if document["roles"]:
        shown = [
            (one["signal"], one["role"] or "?", "taken" if one["certain"] else "asked", one["reason"])
            for one in document["roles"]
        ]
        print_table("Roles", ("signal", "role", "", "why"), shown)
    for one in document["left_out"]:
        say(f"left out: {one['file']}: {one['text']}")
    for note in document["notes"]:
        say(f"note: {note}")
    for difference in document["differences"]:
        say(f"differs: {difference}")
    open_values, stated = document["open"], document["stated"]
    say(f"{document['file']}: {stated} of {stated + len(open_values)} values stated")
    if open_values:
        say(f"write the others in place of TODO, then: recoil-daq check {quoted(document['file'])}")


class Asked(Protocol):
    """A question to a person: its meaning, and what is proposed."""

    @property
    def meaning(self) -> str:
        """Meaning of the value, with its unit."""
        ...

    @property
    def proposal(self) -> Any:
        """Value that the evidence speaks for; None if there is none."""
        ...


class OpenQuestion(Protocol):
    """A question, and the place of its key."""

    @property
    def parts(self) -> KeyPath:
        """Parts of the key."""
        ...

    @property
    def question(self) -> Asked:
        """The question itself."""
        ...


def ask(questions: Sequence[OpenQuestion]) -> dict[KeyPath, Any]:
    """Ask for each open value at the terminal; Enter takes what is proposed, or leaves it open.

    Returns
    -------
    dict
        Answers by their keys; questions without an answer have none.

    Raises
    ------
    KeyboardInterrupt
        If whoever is asked ends it.
    """
    answers: dict[KeyPath, Any] = {}
    typer.echo(
        "Enter takes what stands in brackets, or leaves the value open; a full stop leaves all that follow open",
        err=True,
    )
    for number, one in enumerate(questions, 1):
        offered = one.question.proposal
        typer.echo(visible(f"[{number} of {len(questions)}] {spelled(one.parts)}: {one.question.meaning}"), err=True)
        try:
            text = typer.prompt(
                "  ", default="" if offered is None else str(offered), show_default=offered is not None, err=True
            )
        except typer.Abort as ended:
            raise KeyboardInterrupt from ended
        if text.strip() == ".":
            break
        if text.strip():
            answers[one.parts] = typed_value(text)
    return answers
