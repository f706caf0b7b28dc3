"""Output of `check`: a sound rig, and recorded files against it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from recoil_daq.terminal.tables import fixed, print_assumptions, print_table, say


def print_rig(document: Mapping[str, Any]) -> None:
    """Print a sound rig's channels, as recorded files have them where some were given, and what is unusual.

    Parameters
    ----------
    document
        Document of ``check --json``.
    """
    rows = [
        (
            c["name"], c["source"], c["unit"] or "file's", c["role"],
            "-" if c["u_rel"] is None else f"{100 * c['u_rel']:g}", c["due"] or "", c["signal"],
        )
        for c in document["channels"]
    ]  # fmt: skip
    columns = ("channel", "source", "unit", "role", "u, %", "due", "signal")
    print_table(f"Rig {document['rig']}: no fault", columns, rows, numeric=(4,))
    for file in document["files"]:
        found = [
            (
                c["name"], c["unit"] or "", str(c["samples"]), fixed(c["rate_hz"], 0),
                _number(c["peak"], c["measured_in"]),
                "" if c["range"] is None else " .. ".join(f"{limit:.4g}" for limit in c["range"]),
            )
            for c in file["channels"]
        ]  # fmt: skip
        print_table(
            f"Recorded files, source {file['source']}: {file['file']}, {file['reader']}",
            ("channel", "unit", "samples", "rate, Hz", "peak", "range"),
            found,
            (2, 3, 4),
        )
    for note in document["notes"]:
        say(f"note: {note}")
    for one in document["warnings"]:
        say(f"warning: {one['key']}: {one['problem']}")
    print_assumptions(document)
    say(_verdict(document))


def _verdict(document: Mapping[str, Any]) -> str:
    """Say of what no fault was found, and what was not looked at: the last line."""
    channels, warnings = len(document["channels"]), len(document["warnings"])
    judged = sum(len(file["channels"]) for file in document["files"])
    files = list(dict.fromkeys(file["file"] for file in document["files"]))
    of = f"{_counted(channels, 'channel')} of the rig file"
    if files:
        of += f", and {judged} of them in {_counted(len(files), 'recorded file')}"
    rest = "" if files else "; no recorded file was given to hold against it"
    return f"no fault in {of}{rest}" + (f"; {_counted(warnings, 'warning')}" if warnings else "")


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _number(value: float | None, unit: str | None) -> str:
    return "-" if value is None else f"{value:.4g} {unit}"
