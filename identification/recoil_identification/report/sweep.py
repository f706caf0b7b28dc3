"""The sensitivity of a shot's mass to one option: the shot identified at each of several values, and by its own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from recoil_identification.estimate.rounding import NO_NUMBER, fixed, in_kg, plain, rounded, signed, significant
from recoil_identification.report.figure import Figure, HorizontalLine, Panel, Trace
from recoil_identification.report.report_files import computer, sealed, to_json
from recoil_identification.report.section import Column
from recoil_identification.report.spreadsheet import csv_text
from recoil_identification.shot.identified import Identification

Document = Mapping[str, Any]
Row = dict[str, Any]

SCHEMA = "recoil-daq/sweep/1"
OPTIONS = {
    "cutoff_hz": ("cut-off of the low-pass", "Hz"),
    "mass_cutoff_hz": ("cut-off of the low-pass of the fit of the mass", "Hz"),
    "window_s": ("memory of the mass over time", "s"),
}
"""Options of an identification that are numbers -> name and unit."""
CELLS = (
    "value", "mass_kg", "u_kg", "U95_low_kg", "U95_high_kg", "difference_kg", "E_n", "rpe_percent", "cutoff_hz",
    "mass_cutoff_hz", "valid", "reason",
)  # fmt: skip
"""Keys of a row, and columns of its table for spreadsheets; the value is None in that of the shot's own options."""
COLUMNS = (
    Column("value", "Value", "name"),
    Column("mass", "Mass", "number", "kg"),
    Column("u", "u", "number", "kg"),
    Column("interval", "95 % interval", "number", "kg"),
    Column("difference", "Difference", "number", "kg"),
    Column("e_n", "E_n", "number"),
    Column("rpe", "RPE", "number", "%"),
    Column("verdict", "Verdict", "text"),
    Column("reason", "First reason", "long"),
)
"""Columns of the page's table."""


def found_row(found: Identification) -> Row:
    """Return what an identification found, with the keys of `CELLS` but for value and difference."""
    estimate, low_pass = found.chosen.estimate, found.route.filtered.low_pass
    low, high = estimate.interval_kg
    return {
        "mass_kg": estimate.mass_kg,
        "u_kg": estimate.u_kg,
        "U95_low_kg": low,
        "U95_high_kg": high,
        "E_n": found.normalised_error,
        "rpe_percent": found.chosen.rpe_percent,
        "cutoff_hz": low_pass.cutoff_hz if low_pass else None,
        "mass_cutoff_hz": None if found.route.method == "camera" else found.route.mass_low_pass.cutoff_hz,
        "valid": found.valid,
        "reason": next(iter(found.reasons), None),
    }


def sweep_document(
    key: str,
    found: Mapping[float | None, Row | str],
    *,
    shot: str,
    rig: str,
    specification_kg: float,
    version: str,
    inputs: Sequence[Mapping[str, Any]],
    options: Mapping[str, Any],
) -> dict[str, Any]:
    """Build the document of a sweep, JSON types only.

    Parameters
    ----------
    key
        Option that was swept, one of `OPTIONS`.
    found
        Rows of `found_row` by value, None for the shot's own options; a sentence where a value allows no mass.
    version
        Version of the package.
    inputs
        Files that the shot was made of and read with, as in a report.
    options
        Options of the row of the shot's own.

    Raises
    ------
    ValueError
        If the shot's own options allow no mass.
    """
    own = found[None]
    if isinstance(own, str):
        raise ValueError(f"no mass to compare with: {own}")
    rows = [_row(value, row, own) for value, row in found.items()]
    swept = [row for row in rows if row["value"] is not None]
    numbers = [row for row in swept if row["difference_kg"] is not None]
    furthest = max(numbers, key=lambda row: abs(row["difference_kg"]), default=None)
    document = {
        "schema": SCHEMA,
        "shot": shot,
        "rig": rig,
        "key": key,
        "option": OPTIONS[key][0],
        "unit": OPTIONS[key][1],
        "specification_kg": specification_kg,
        "own": rows[0],
        "rows": swept,
        "largest_difference_kg": None if furthest is None else furthest["difference_kg"],
        "at": None if furthest is None else furthest["value"],
        "moves": None if furthest is None else bool(abs(furthest["difference_kg"]) > own["u_kg"]),
        "provenance": {
            "version": version,
            "computer": computer(),
            "inputs": [dict(one) for one in inputs],
            "parameters": {"options": dict(options), "key": key, "values": [row["value"] for row in swept]},
        },
    }
    return sealed(to_json({**document, "detail": _detail(document)}))


def _row(value: float | None, found: Row | str, own: Row) -> Row:
    if isinstance(found, str):
        return {**dict.fromkeys(CELLS), "value": value, "valid": False, "reason": found}
    return {**dict.fromkeys(CELLS), **found, "value": value, "difference_kg": found["mass_kg"] - own["mass_kg"]}


def _detail(document: Document) -> str:
    """Say in a sentence whether the mass moves by more than its u."""
    own, rows = document["own"], document["rows"]
    unit, difference_kg = document["unit"], document["largest_difference_kg"]
    span = f"{plain(rows[0]['value'])} to {plain(rows[-1]['value'])} {unit}"
    of = f"{in_kg(own['mass_kg'], own['u_kg'])} of the shot's own options"
    if difference_kg is None:
        return f"With a {document['option']} of {span} the shot allows no mass; it is {of}."
    moved = f"{significant(abs(difference_kg), 2)} kg, {significant(abs(difference_kg) / own['u_kg'], 2)} of u"
    lost = sum(row["mass_kg"] is None for row in rows)
    without = f"; {lost} of {len(rows)} values allow none" if lost else ""
    verdict = "by more than u" if document["moves"] else "by no more than u"
    return (
        f"With a {document['option']} of {span} the mass moves {verdict}: by at most {moved} (at "
        f"{plain(document['at'])} {unit}) from the {of}{without}."
    )


def sweep_table(document: Document) -> str:
    """Return the sweep as CSV text, the row of the shot's own options first."""
    return csv_text(CELLS, ([row[name] for name in CELLS] for row in (document["own"], *document["rows"])))


def sweep_rows(document: Document) -> list[Row]:
    """Word the rows for the page, the shot's own options first and in bold."""
    return [{**_worded(document["own"], document), "strong": True}, *(_worded(r, document) for r in document["rows"])]


def _worded(row: Mapping[str, Any], document: Document) -> Row:
    mass, u = rounded(row["mass_kg"], row["u_kg"])
    low, high = row["U95_low_kg"], row["U95_high_kg"]
    interval = NO_NUMBER
    if low is not None and high is not None:
        interval = " … ".join(rounded(limit, (high - low) / 2)[0] for limit in (low, high))
    value, own = row["value"], row["value"] is None
    return {
        "value": _own(document) if own else f"{plain(value)} {document['unit']}",
        "mass": mass,
        "u": u,
        "interval": interval,
        "difference": "" if own else signed(significant(row["difference_kg"], 2)),
        "e_n": signed(fixed(row["E_n"], 2)),
        "rpe": significant(row["rpe_percent"], 2),
        "verdict": "valid" if row["valid"] else "not valid",
        "reason": row["reason"] or "",
    }


def _own(document: Document) -> str:
    """Name the shot's own options, with the value that it has by them."""
    stated = document["own"].get(document["key"]) or document["provenance"]["parameters"]["options"][document["key"]]
    return "its own" if stated is None else f"its own, {significant(stated, 4)} {document['unit']}"


def sweep_figures(document: Document) -> list[Figure]:
    """Draw the mass with its 95 % interval over the values, beside that of the shot's own options."""
    rows = [row for row in document["rows"] if row["mass_kg"] is not None]
    if not rows:
        return []
    own, name, unit = document["own"], document["option"], document["unit"]
    x = np.array([row["value"] for row in rows])
    edge = 0.03 * float(np.ptp(x)) or 0.1 * float(x[0])
    ends = [float(x.min()) - edge, float(x.max()) + edge]
    band = [[own[key]] * 2 for key in ("mass_kg", "U95_low_kg", "U95_high_kg")]
    traces = [Trace("by its own options, 95 % interval", ends, band[0], "band", "kg", band[1], band[2], hue=2)]
    for label, valid, hue in (("valid, 95 % interval", True, 0), ("not valid, 95 % interval", False, 5)):
        at = [row["valid"] is valid for row in rows]
        if any(at):
            y, low, high = (
                np.array([math.nan if row[key] is None else row[key] for row in rows])[at]
                for key in ("mass_kg", "U95_low_kg", "U95_high_kg")
            )
            traces.append(Trace(label, x[at], y, "whiskers", "kg", low, high, hue=hue))
    lines = (HorizontalLine("specification", document["specification_kg"], "specification"),)
    return [
        Figure(
            "mass", f"Mass over the {name}", "Each point is the whole identification at that value.",
            f"{name}, {unit}", (Panel("mass, kg", tuple(traces), lines),), shown=(ends[0], ends[1]),
        )
    ]  # fmt: skip
