"""Output of `check`: a sound rig, and recorded files against it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from recoil_daq.terminal.tables import fixed, print_assumptions, print_table, say

if TYPE_CHECKING:
    from recoil_daq.recording.check import Checked


def rig_document(checked: Checked) -> dict[str, Any]:
    """Build the document of ``check --json``."""
    from recoil_acquisition.remark import Severity, findings_of
    from recoil_rigs.assumptions import assumption_notes, assumptions_of

    rig = checked.rig
    warned = [one.finding(Severity.WARN) for one in checked.warnings]
    return {
        "schema": "recoil-daq/check/1",
        "rig": rig.name,
        "file": str(rig.path),
        "faults": [],
        "warnings": [one.to_json() for one in checked.warnings],
        "findings": [*warned, *findings_of(checked.notes, assumption_notes(rig))],
        "notes": list(checked.notes),
        "assumptions": assumptions_of(rig),
        "sources": [{"name": s.name, "kind": s.kind} for s in rig.sources],
        "channels": [{"name": c.name, "source": c.source, "role": c.role} for c in rig.channels],
        "files": list(checked.files),
    }


def print_rig(checked: Checked, document: Mapping[str, Any]) -> None:
    """Print a sound rig's channels, as recorded files have them where some were given, and what is unusual.

    Parameters
    ----------
    document
        Its `rig_document`.
    """
    rig = checked.rig
    rows = [
        (
            c.name, c.source, c.unit or "file's", c.role,
            f"{100 * c.sensor.u_scale_rel:g}" if c.sensor.states_u_rel else "-",
            "" if c.sensor.due is None else str(c.sensor.due), c.signal,
        )
        for c in rig.channels
    ]  # fmt: skip
    columns = ("channel", "source", "unit", "role", "u, %", "due", "signal")
    print_table(f"Rig {rig.name}: no fault", columns, rows, numeric=(4,))
    for file in checked.files:
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
    for note in checked.notes:
        say(f"note: {note}")
    for one in checked.warnings:
        say(f"warning: {one}")
    print_assumptions(document)


def _number(value: float | None, unit: str | None) -> str:
    return "-" if value is None else f"{value:.4g} {unit}"
