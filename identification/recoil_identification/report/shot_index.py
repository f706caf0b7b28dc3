"""The index of shots: one row a shot or report, of what its report, its shot file and the shot log say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from recoil_acquisition.usability import Usability
from recoil_identification.campaign.campaign_shot import numbered
from recoil_identification.estimate.rounding import NO_NUMBER, fixed, rounded, signed, significant
from recoil_identification.report.campaign_tables import PEAKS
from recoil_identification.report.section import Column
from recoil_identification.report.spreadsheet import csv_text
from recoil_identification.report.tables import PEAKS as ALL_PEAKS
from recoil_rigs.tables.calibration_day import calibrations_in_words

Document = Mapping[str, Any]
Row = dict[str, Any]

SCHEMA = "recoil-daq/index/1"
INDEX_TABLE = "index.csv"
PEAK_KEYS = tuple(name for name, *_ in ALL_PEAKS)
"""Peaks of a row, units in the names."""
LOGGED = ("configuration", "added_mass_kg", "u_added_mass_kg", "charge", "exclude")
"""Columns of the shot log that a row has."""
CELLS = (
    "shot", "rig", "started", *LOGGED, "state", "warnings", "valid", "reason", "mass_kg", "u_kg", "U95_low_kg",
    "U95_high_kg", "specification_kg", "E_n", "rpe_percent", *PEAK_KEYS, "report", "file",
)  # fmt: skip
"""Keys of a row, and columns of the table for spreadsheets, in their order."""
VERDICTS = {True: "valid", False: "not valid", None: "no report"}
"""Verdict on a shot's mass -> its word."""
COLUMNS = (
    Column("shot", "Shot", "link"),
    Column("rig", "Rig"),
    Column("time", "Fired at"),
    Column("state", "Recording"),
    Column("mass", "Mass", "number", "kg"),
    Column("u", "u", "number", "kg"),
    Column("expanded", "U", "number", "kg"),
    Column("e_n", "E_n", "number"),
    Column("rpe", "RPE", "number", "%"),
    Column("verdict", "Verdict", "text"),
    Column("configuration", "Configuration"),
    Column("added", "Added", "number", "kg"),
    Column("charge", "Charge"),
    *(Column(name, head, "number", unit) for name, head, unit, _, _ in PEAKS),
    Column("reason", "First reason", "long"),
)
"""Columns of the page's table."""


def row_of_report(report: Document) -> Row:
    """Return the row of a report, JSON types, with the keys of `CELLS`; of files beside it nothing is said.

    Raises
    ------
    ValueError, LookupError, TypeError, AttributeError, ArithmeticError
        If something else stands where a number or a text belongs.
    """
    mass, reasons = report["mass"], [str(one) for one in report["reasons"]]
    reasons += filter(None, [calibrations_in_words(report)])
    low, high = (_number(limit) for limit in mass["U95"])
    log, peaks = report.get("shot_log") or {}, report.get("peaks") or {}
    state, warnings = _recording(report)
    return {
        **dict.fromkeys(CELLS),
        "shot": str(report["shot"]),
        "rig": str(report["rig"]),
        "started": _text(report.get("started")),
        **logged(log),
        "state": state,
        "warnings": warnings,
        "valid": bool(report["valid"]),
        "reason": next(iter(reasons), None),
        "mass_kg": _number(mass["value"]),
        "u_kg": _number(mass["u"]),
        "U95_low_kg": low,
        "U95_high_kg": high,
        "specification_kg": _number(mass["specification"]),
        "E_n": _number(report.get("E_n")),
        "rpe_percent": _number(report["rpe_percent"]["value"]),
        **{name: _number(peaks.get(name)) for name in PEAK_KEYS},
    }


def row_of_summary(summary: Document) -> Row:
    """Return the row of a shot file without a report, by its summary, as `row_of_report`."""
    reasons = [str(one) for one in summary["reasons"]]
    return {
        **dict.fromkeys(CELLS),
        "shot": str(summary["shot"]),
        "rig": str(summary["rig"]),
        "started": _text(summary["started"]),
        "state": str(summary["state"]),
        "warnings": sum(one["verdict"] == "warn" for one in summary["quality"]),
        "reason": next(iter(reasons), None),
    }


def logged(log: Document) -> Row:
    """Return the cells of a row that a shot's row of the shot log states; a row that is not there states none."""
    return {
        name: _number(log.get(name)) if name.endswith("_kg") else _text(log.get(name)) for name in LOGGED
    }  # fmt: skip


def index_document(rows: Sequence[Row], *, version: str, failed: Sequence[Mapping[str, str]] = ()) -> dict[str, Any]:
    """Return the index of rows, in the order of firing, JSON types.

    Parameters
    ----------
    version
        Version of the package.
    failed
        Files that cannot be listed, each with ``file`` and ``error``.
    """
    timed = all(row["started"] for row in rows)
    ordered = sorted(rows, key=lambda row: (row["started"] if timed else "", numbered(row["shot"])))
    count = {word: sum(row["valid"] is valid for row in rows) for valid, word in VERDICTS.items()}
    return {
        "schema": SCHEMA,
        "rigs": list(dict.fromkeys(row["rig"] for row in ordered)),
        "counts": {**{word.replace(" ", "_"): number for word, number in count.items()}, "failed": len(failed)},
        "shots": ordered,
        "failed": [dict(one) for one in failed],
        "provenance": {"version": version, "parameters": {}},
    }


def index_table(document: Document) -> str:
    """Return the index as CSV text, a row each."""
    return csv_text(CELLS, ([row[name] for name in CELLS] for row in document["shots"]))


def index_rows(document: Document) -> list[Row]:
    """Word the rows for the page, rounded to their uncertainties."""
    several = len({row["rig"] for row in document["shots"]}) > 1
    return [_worded(row) | ({} if several else {"rig": ""}) for row in document["shots"]]


def summary(document: Document) -> str:
    """Say in a sentence what is listed."""
    counts = document["counts"]
    words = {VERDICTS[None]: "without a report"}
    said = [f"{counts[word.replace(' ', '_')]} {words.get(word, word)}" for word in VERDICTS.values()]
    rigs = document["rigs"]
    of = "" if not rigs else f" of rig {rigs[0]}" if len(rigs) == 1 else f" of the rigs {', '.join(rigs)}"
    files = "1 file" if counts["failed"] == 1 else f"{counts['failed']} files"
    lost = f"; {files} could not be listed" if counts["failed"] else ""
    return f"{len(document['shots'])} rows{of}: {', '.join(said)}{lost}."


def _worded(row: Mapping[str, Any]) -> Row:
    mass, u = rounded(row["mass_kg"], row["u_kg"])
    low, high = row["U95_low_kg"], row["U95_high_kg"]
    return {
        "page": row["report"],
        "aside": row["exclude"] is not None,
        "shot": row["shot"],
        "rig": row["rig"],
        # a date is not parted at its hyphens
        "time": (row["started"] or "")[:16].replace("T", " ").replace("-", "\N{NON-BREAKING HYPHEN}"),
        "state": recording(row),
        "mass": mass,
        "u": u,
        "expanded": NO_NUMBER if low is None or high is None else rounded(None, (high - low) / 2)[1],
        "e_n": signed(fixed(row["E_n"], 2)),
        "rpe": significant(row["rpe_percent"], 2),
        "verdict": f"{VERDICTS[row['valid']]}{', deviates' if deviates(row) else ''}",
        "configuration": row["configuration"] or "",
        "added": "" if not row["added_mass_kg"] else f"{row['added_mass_kg']:g}",
        "charge": row["charge"] or "",
        **{
            name: fixed(None if row[name] is None else scale * row[name], decimals)
            for name, _, _, scale, decimals in PEAKS
        },
        "reason": first_reason(row),
    }


def deviates(row: Mapping[str, Any]) -> bool:
    """Whether a mass is valid and does not agree with its specification."""
    return bool(row["valid"]) and row["E_n"] is not None and abs(row["E_n"]) > 1.0


def recording(row: Mapping[str, Any]) -> str:
    """Say what the recording of a row is good for, and how many warnings there are."""
    count = row["warnings"] or 0
    return f"{row['state']}, {count} warning{'' if count == 1 else 's'}" if count else str(row["state"])


def first_reason(row: Mapping[str, Any]) -> str:
    """Say why a shot is excluded, and the first reason against it; empty where nothing speaks against it."""
    excluded = [f"excluded: {row['exclude']}"] if row["exclude"] else []
    return "; ".join([*excluded, *([row["reason"]] if row["reason"] else [])])


def _recording(report: Document) -> tuple[str, int]:
    """Return what the recording of a report is good for, as a shot file states it, and how many warnings there are."""
    verdicts = [one["verdict"] for one in report["quality"]]
    if "fail" in verdicts:
        state = Usability.NOT_USABLE
    else:
        state = Usability.USABLE if report["valid"] else Usability.RECORD_ONLY
    return state.value, verdicts.count("warn")


def _number(value: Any) -> float | None:
    """Return a number of a document; TypeError if something else stands there."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{str(value)[:40]!r} where a number belongs")
    return float(value)


def _text(value: Any) -> str | None:
    return None if value in (None, "") else str(value)
