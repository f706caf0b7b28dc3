"""Output of `init`: what the files told, what is proposed and why, and what only a person knows."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import quoted
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
