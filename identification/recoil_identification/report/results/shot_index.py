"""The index of shots: one row a shot or report, of what its report, its shot file and the shot log say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from statistics import fmean, stdev
from typing import Any

from recoil_acquisition.shot.usability import Usability
from recoil_identification.campaign.campaign_shot import numbered
from recoil_identification.estimate.conformity import Word
from recoil_identification.estimate.rounding import rounded
from recoil_identification.report.content.result_table import (
    ADDED,
    BARE,
    CONFIGURATION,
    E_N,
    MASS,
    MASS_KEYS,
    PEAKS,
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
    bare_kg,
    flat,
    half_width,
)
from recoil_identification.report.content.tables import PEAKS as ALL_PEAKS
from recoil_rigs.tables.calibration_day import calibrations_in_words

SCHEMA = "recoil-daq/index/1"
INDEX_TABLE = "index.csv"
PEAK_KEYS = tuple(name for name, *_ in ALL_PEAKS)
"""Peaks of a row, units in the names."""
LOGGED = ("configuration", "added_mass_kg", "u_added_mass_kg", "charge", "exclude")
"""Columns of the shot log that a row has."""


def row_of_report(report: Document) -> Row:
    """Return the row of a report, JSON types, with the keys of `INDEX`; of files beside it nothing is said.

    Raises
    ------
    ValueError, LookupError, TypeError, AttributeError, ArithmeticError
        If something else stands where a number or a text belongs.
    """
    mass, reasons = report["mass"], [str(one) for one in report["reasons"]]
    reasons += filter(None, [calibrations_in_words(report)])
    log, peaks, u = (report.get(key) or {} for key in ("shot_log", "peaks", "peaks_u"))
    state, warnings = _recording(report)
    return {
        **dict.fromkeys(INDEX.cells),
        "shot": str(report["shot"]),
        "rig": str(report["rig"]),
        "started": _text(report.get("started")),
        **logged(log),
        "state": state,
        "warnings": warnings,
        "valid": bool(report["valid"]),
        "reason": next(iter(reasons), None),
        "conformity": _text((report.get("conformity") or {}).get("word")),
        **{key: _number(value) for key, value in flat(mass).items()},
        "specification_kg": _number(mass["specification"]),
        "E_n": _number(report.get("E_n")),
        "rpe_percent": _number(report["rpe_percent"]["value"]),
        **{name: _number(peaks.get(name)) for name in PEAK_KEYS},
        **{f"u_{name}": _number(u.get(name)) for name in PEAK_KEYS},
    }


def row_of_summary(summary: Document) -> Row:
    """Return the row of a shot file without a report, by its summary, as `row_of_report`."""
    reasons = [str(one) for one in summary["reasons"]]
    return {
        **dict.fromkeys(INDEX.cells),
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


def sum_row(document: Document) -> Row | None:
    """Return the row below the shots: how many there are, and how many of them are valid."""
    rows, valid = document["shots"], document["counts"][VERDICTS[True]]
    if len(rows) < 2:
        return None
    return {
        "shot": f"{len(rows)} shots",
        "verdict": f"{valid} valid",
        "tone": TONES[True if valid == len(rows) else None],
    }


def together(document: Document) -> list[str]:
    """Say how far the valid masses scatter, without what was added; nothing of fewer than two, or of several rigs."""
    valid = [one for one in document["shots"] if one["valid"] and not one["exclude"]]
    masses = [mass for mass in map(bare_kg, valid) if mass is not None]
    if len(masses) < 2 or len({one["rig"] for one in valid}) > 1:
        return []
    less = " less what was added" if any(one["added_mass_kg"] for one in valid) else ""
    mean, scatter = rounded(fmean(masses), stdev(masses))
    return [f"The {len(masses)} valid masses{less}: mean {mean} kg, standard deviation {scatter} kg."]


def head(document: Document) -> ResultHead:
    """Return the head of the page."""
    bad = any(document["counts"][VERDICTS[one].replace(" ", "_")] for one in (False, None))
    return ResultHead(
        "Index of shots", ", ".join(document["rigs"]), (summary(document),), bad,
        faults=tuple(one["error"] for one in document["failed"]), series_file=INDEX_TABLE, series_name="the shots",
    )  # fmt: skip


def deviates(row: Mapping[str, Any]) -> bool:
    """Whether a mass is valid and does not agree with its specification."""
    return bool(row["valid"]) and row["E_n"] is not None and abs(row["E_n"]) > 1.0


def conformity(row: Mapping[str, Any]) -> str:
    """Return the one word of the conformity with the tolerance, in capitals; empty where there is nothing to state."""
    return (row["conformity"] or Word.NOT_STATED).upper().removeprefix(Word.NOT_STATED.upper())


def verdict(row: Mapping[str, Any]) -> str:
    """Word whether a mass is valid, agrees with its specification, and conforms with its tolerance."""
    return ", ".join(filter(None, (VERDICTS[row["valid"]], "deviates" if deviates(row) else "", conformity(row))))


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


def _rows(document: Document) -> list[Row]:
    """Return the rows; of one rig alone it is not said in each."""
    several = len({row["rig"] for row in document["shots"]}) > 1
    return [{**row, "of_rig": row["rig"] if several else ""} for row in document["shots"]]


INDEX = ResultTable(
    _rows,
    (
        ResultColumn("shot", "Shot", "link"),
        ResultColumn("rig", "Rig", text=lambda row: str(row["of_rig"])),
        # a date is not parted at its hyphens
        ResultColumn(
            "time", "Fired at",
            text=lambda row: (row["started"] or "")[:16].replace("T", " ").replace("-", "\N{NON-BREAKING HYPHEN}"),
        ),
        ResultColumn("state", "Recording", text=recording),
        MASS,
        U,
        ResultColumn("expanded", "U", "number", "kg", text=lambda row: rounded(None, half_width(row))[1]),
        E_N,
        RPE,
        replace(VERDICT, text=verdict),
        CONFIGURATION,
        ADDED,
        BARE,
        ResultColumn("charge", "Charge"),
        *PEAKS,
        replace(REASON, text=first_reason),
    ),
    (
        "shot", "rig", "started", *LOGGED, "state", "warnings", "valid", "conformity", "reason", *MASS_KEYS,
        "specification_kg", "E_n", "rpe_percent", *PEAK_KEYS, *(f"u_{name}" for name in PEAK_KEYS), "report", "file",
    ),
    lambda row: {
        "page": row["report"],
        "aside": row["exclude"] is not None,
        "tone": "warn" if deviates(row) else TONES[row["valid"]],
    },
)  # fmt: skip
"""Shots, one below the other in the order of firing."""
