"""Output of `init`: what the files told, what is proposed and why, and what only a person knows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

import typer

from recoil_acquisition.errors import KeyPath, quoted, spelled, visible
from recoil_acquisition.files.bounded_toml import toml_value
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
    first = [one["key"] for one in open_values if one["first"]]
    if first:
        say(f"write first, in place of TODO, {', '.join(first)}: by them the files tell more of the others")
        say(f"then the same command with --from {quoted(document['file'])} --overwrite")
    elif open_values:
        say(f"write the others in place of TODO, then: recoil-daq check {quoted(document['file'])}")
    for sentence in document["lacks"]:
        say(f"lacks: {sentence}")


def print_interrupted(path: Path, answers: int) -> None:
    """Print where the answers are that were given before the questions were broken off, and how to go on."""
    given = f"{answers} answer{'s' * (answers != 1)}"
    say(f"interrupted: {path} has the {given} so far; go on by the same command with --from {path} --overwrite")


class Answered(Protocol):
    """An answer that was understood."""

    @property
    def value(self) -> Any:
        """Value of the rig file; None where the key is left out."""
        ...

    @property
    def typed(self) -> str:
        """Text that was typed, where the value is another number than its digits."""
        ...

    @property
    def unit(self) -> str:
        """Unit of the value; empty if it has none."""
        ...

    @property
    def doubt(self) -> str:
        """Sentence on what is unusual of it; empty if nothing is."""
        ...


AnAnswer = TypeVar("AnAnswer", bound=Answered)
Answer_co = TypeVar("Answer_co", bound=Answered, covariant=True)


class Asked(Protocol[Answer_co]):
    """A question to a person: its meaning, and what is proposed."""

    @property
    def meaning(self) -> str:
        """Meaning of the value, with its unit."""
        ...

    @property
    def proposal(self) -> Any:
        """Value that the evidence speaks for; None if there is none."""
        ...

    @property
    def read(self) -> Callable[[str], Answer_co]:
        """Reads what is typed; ValueError says what is wrong with it."""
        ...


class OpenQuestion(Protocol[Answer_co]):
    """A question, and the place of its key."""

    @property
    def parts(self) -> KeyPath:
        """Parts of the key."""
        ...

    @property
    def question(self) -> Asked[Answer_co]:
        """The question itself."""
        ...


def ask(questions: Sequence[OpenQuestion[AnAnswer]], answers: MutableMapping[KeyPath, AnAnswer]) -> bool:
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
