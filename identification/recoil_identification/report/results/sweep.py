"""The sensitivity of a shot's mass to one option: the shot identified at each of several values, and by its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from recoil_identification.estimate.rounding import in_kg, plain, signed, significant
from recoil_identification.report.content.head import Head, identity_of
from recoil_identification.report.content.result_table import (
    E_N,
    INTERVAL,
    MASS,
    MASS_KEYS,
    REASON,
    RPE,
    TONES,
    VERDICT,
    VERDICTS,
    Document,
    ResultColumn,
    ResultHead,
    ResultTable,
    Row,
    U,
    mass_panel,
)
from recoil_identification.report.document.report_files import computer, sealed, to_json
from recoil_identification.report.figure.figure import Figure
from recoil_identification.shot.identified import Identification

SCHEMA = "recoil-daq/sweep/1"
OPTIONS = {
    "cutoff_hz": ("cut-off of the low-pass", "Hz"),
    "mass_cutoff_hz": ("cut-off of the low-pass of the fit of the mass", "Hz"),
    "window_s": ("memory of the mass over time", "s"),
}
"""Options of an identification that are numbers -> name and unit."""


JUMP = 0.3
"""Share of u by which the mass of one value may differ from that of the next before it is said."""


def found_row(found: Identification) -> Row:
    """Return what an identification found, with the keys of `SWEEP` but for value and difference."""
    estimate, low_pass = found.chosen.estimate, found.route.filtered.low_pass
    low, high = found.interval_kg
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
    issued: Mapping[str, Any] | None = None,
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
    issued
        Identity of the document; None where none is stated.

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
        **({"issued": dict(issued)} if issued else {}),
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
        return {**dict.fromkeys(SWEEP.cells), "value": value, "valid": False, "reason": found}
    return {**dict.fromkeys(SWEEP.cells), **found, "value": value, "difference_kg": found["mass_kg"] - own["mass_kg"]}


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
    found = (row for row in rows if row["mass_kg"] is not None)
    steps = [(b["mass_kg"] - a["mass_kg"], a, b) for a, b in pairwise(found)]
    step_kg, before, behind = max(steps, key=lambda one: abs(one[0]), default=(0.0, own, own))
    jump = ""
    if abs(step_kg) > JUMP * own["u_kg"]:
        jump = (
            f"; it jumps by {signed(significant(step_kg, 2))} kg, {significant(abs(step_kg) / own['u_kg'], 2)} of u, "
            f"between {plain(before['value'])} and {plain(behind['value'])} {unit}"
        )
    without = f"; {lost} of {len(rows)} values allow none" if lost else ""
    verdict = "by more than u" if document["moves"] else "by no more than u"
    return (
        f"With a {document['option']} of {span} the mass moves {verdict}: by at most {moved} (at "
        f"{plain(document['at'])} {unit}) from the {of}{jump}{without}."
    )


def stem(key: str) -> str:
    """Return the name of the files of an option's sweep, without their endings."""
    return f"sweep_{key}"


def stands(document: Document) -> bool:
    """Return whether the mass stands, valid, whatever the option is."""
    return document["moves"] is False and all(row["valid"] for row in (document["own"], *document["rows"]))


def head(document: Document) -> ResultHead:
    """Return the head of the page; green says that the mass stands."""
    return ResultHead(
        f"Shot {document['shot']}: sweep of the {document['option']}", f"rig {document['rig']}", (document["detail"],),
        doubtful=not stands(document), series_file=f"{stem(document['key'])}.csv", series_name="the values",
        embedded={"shot": f"{document['shot']}-sweep"},
    )  # fmt: skip


def paper_head(document: Document) -> Head:
    """Return the head of the paper copy, which says what that of the page does."""
    steady = stands(document)
    return Head(
        of=f"Shot {document['shot']}", rig=str(document["rig"]), when="", tone="ok" if steady else "doubt",
        stamp="THE MASS STANDS" if steady else "LOOK", result=f"sweep of the {document['option']}",
        words=(document["detail"],), identity=identity_of(document.get("issued") or {}),
        logo=str((document.get("issued") or {}).get("logo") or ""),
    )  # fmt: skip


def _rows(document: Document) -> list[Row]:
    """Return the rows, that of the shot's own options first, each with its value in words."""
    own = [{**document["own"], "label": _own(document), "own": True}]
    return own + [
        {**row, "label": f"{plain(row['value'])} {document['unit']}", "own": False} for row in document["rows"]
    ]


def _own(document: Document) -> str:
    """Name the shot's own options, with the value that it has by them."""
    stated = document["own"].get(document["key"]) or document["provenance"]["parameters"]["options"][document["key"]]
    return "its own" if stated is None else f"its own, {significant(stated, 4)} {document['unit']}"


SWEEP = ResultTable(
    _rows,
    (
        ResultColumn("value", "Value", "name", text=lambda row: str(row["label"])),
        MASS,
        U,
        INTERVAL,
        ResultColumn(
            "difference", "Difference", "number", "kg",
            text=lambda row: "" if row["own"] else signed(significant(row["difference_kg"], 2)),
        ),
        E_N,
        RPE,
        VERDICT,
        REASON,
    ),
    ("value", *MASS_KEYS, "difference_kg", "E_n", "rpe_percent", "cutoff_hz", "mass_cutoff_hz", "valid", "reason"),
    lambda row: {"strong": row["own"], "tone": TONES[row["valid"]]},
)  # fmt: skip
"""Values of an option, one below the other; the value is None in the row of the shot's own options."""


def sweep_figures(document: Document) -> list[Figure]:
    """Draw the mass with its 95 % interval over the values, beside that of the shot's own options."""
    rows = [row for row in document["rows"] if row["mass_kg"] is not None]
    if not rows:
        return []
    own, name, unit = document["own"], document["option"], document["unit"]
    x = [row["value"] for row in rows]
    edge = 0.03 * (max(x) - min(x)) or 0.1 * x[0]
    ends = (min(x) - edge, max(x) + edge)
    panel = mass_panel(
        x,
        rows,
        [
            (f"{VERDICTS[valid]}, 95 % interval", [row["valid"] is valid for row in rows], hue)
            for valid, hue in ((True, 0), (False, 5))
        ],
        band=("by its own options, 95 % interval", ends, [own[key] for key in MASS_KEYS if key != "u_kg"]),
        specification_kg=document["specification_kg"],
    )
    return [
        Figure(
            "mass", f"Mass over the {name}", "Each point is the whole identification at that value.",
            f"{name}, {unit}", (panel,), shown=ends,
        )
    ]  # fmt: skip
