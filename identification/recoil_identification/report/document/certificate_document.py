"""The machine-readable certificate, the contents of ``certificate.json``: what is signed, filed and asked about later.

It is made of the report of a shot, or of a campaign's answer and the reports of its shots, and of a header; nothing in
it is computed anew but the conformity, by the tolerance and the rule of that header.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from enum import StrEnum
from itertools import chain
from typing import Any

from recoil_acquisition.remark import Severity
from recoil_identification.estimate.conformity import stated_conformity
from recoil_identification.report.document.report_files import DRAWN, computer, sealed, to_json
from recoil_rigs.shots.assumptions import assumption_lines
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from recoil_rigs.tables.issue import Issue
from recoil_rigs.tables.specification import Specification

Document = Mapping[str, Any]

CERTIFICATE_FILE = "certificate.json"
SCHEMA = "recoil-daq/certificate/1"
DCC = "dcc"
"""Key of the provenance: version of the schema of the DCC that was written with it; not there where none was."""
LARGEST_CERTIFICATE = 8_000_000
"""Bytes of a certificate.json, beyond which it is none."""


class Behind(StrEnum):
    """Kind of a file that a certificate rests on."""

    ANSWER = "answer"
    REPORT = "report"
    SHOT = "shot"
    HEADER = "header"


ASKED = ("laboratory", "place", "number", "customer", "item", "received", "date", "approval", "operator")
"""Keys of a header for which ISO/IEC 17025:2017, 7.8.2.1, asks."""
USUAL_K = 2.0
"""Coverage factor of a calibration that states an expanded uncertainty and no other one."""
RELATES = "The results relate only to the items tested, which are the shots listed here, as they were fired."
"""Statement of ISO/IEC 17025:2017, 7.8.2.1 l."""
METHOD = (
    "The mass is that of the equation of motion of the recoiling part, fitted to its measured acceleration or travel "
    "and the measured forces, every sensor known as its certificate says; its uncertainty is by JCGM 100 (GUM) and "
    "JCGM 101."
)


def certificate_document(
    source: Document,
    reports: Sequence[Document],
    issued: Issue,
    *,
    version: str,
    inputs: Sequence[Mapping[str, Any]],
    drawn: Mapping[str, Any],
    signatures: Sequence[str] = (),
    dcc: str | None = None,
) -> dict[str, Any]:
    """Build a certificate, JSON types only.

    Parameters
    ----------
    source
        Report of a shot, or answer of a campaign.
    reports
        Reports of its shots, as many as it has: of a shot itself.
    issued
        Identity of the certificate, and the tolerance of the mass.
    version
        Version of the package.
    inputs
        File, kind and digest of each document that it is made of, and of each shot file behind these, with its seal.
    drawn
        Forms in which it is drawn.
    signatures
        Names of the signatures that are made beside it.
    dcc
        Version of the schema of the DCC that is written with it; None where none is.

    Raises
    ------
    ValueError, LookupError, TypeError, AttributeError
        If something else stands where a number or a text belongs.
    """
    of_campaign, mass = "shots" in source, source["mass"]
    freedom = _freedom(source)
    specification = _specification(source)
    stated = issued.to_json()
    by_name = {str(one["shot"]): one for one in reports}
    document = {
        "schema": SCHEMA,
        "certified": "campaign" if of_campaign else "shot",
        "name": str(source["rig"] if of_campaign else source["shot"]),
        "rig": source["rig"],
        "first_fired": min((str(one["started"]) for one in reports if one.get("started")), default=None),
        "issued": stated,
        "not_stated": [key for key in ASKED if key not in stated],
        "measurand": source.get("measurand"),
        "method": {"text": METHOD, "of_the_mass": mass.get("method", "all shots together")},
        "results": [_mass(source, freedom), *_means(source), *(row for one in reports for row in _peaks(one))],
        "specification": {
            "value": None if specification is None else specification.mass_kg,
            "deviation_kg": None if specification is None else mass["value"] - specification.mass_kg,
            "E_n": mass.get("E_n") if of_campaign else source["E_n"],
        },
        "conformity": stated_conformity(
            issued,
            specification,
            mass["value"],
            mass["u"],
            freedom,
            valid=bool(source["valid"]),
            expanded_kg=mass["U_kg"],
        ),
        "shots": _shots(source, by_name) if of_campaign else [_shot(source)],
        "calibrations": _calibrations(source, by_name, issued),
        "deviations": [*_deviations(reports), *(str(one["detail"]) for one in source.get("set_aside") or ())],
        "assumed": list(assumption_lines(source.get("assumptions") or ())),
        "statement": RELATES,
        "valid": bool(source["valid"]),
        "reasons": [str(one) for one in source["reasons"]],
        "provenance": {
            "version": version,
            "computer": computer(),
            "inputs": [dict(one) for one in inputs],
            "signatures": list(signatures),
            **({} if dcc is None else {DCC: dcc}),
            "outputs": [],
            "parameters": {},
            DRAWN: dict(drawn),
        },
    }
    return sealed(to_json(document))


def _freedom(source: Document) -> float:
    """Return the effective degrees of freedom of the mass; null stands for infinite ones."""
    known = source["uncertainty"]["degrees_of_freedom"]
    return math.inf if known is None else float(known)


def _specification(source: Document) -> Specification | None:
    of = source["mass"].get("specification_of")
    if not of:
        return None
    return Specification(
        of["m3_kg"], of["u_m3_kg"], of["added_mass_kg"], of["u_added_mass_kg"], of["carried_mass_kg"],
        of["u_carried_mass_kg"],
    )  # fmt: skip


def _result(key: str, shot: str | None, value: float, u: float | None, **more: Any) -> dict[str, Any]:
    return {"key": key, "shot": shot, "value": value, "u": u, **more}


def _mass(source: Document, freedom: float) -> dict[str, Any]:
    mass = source["mass"]
    factor = source["uncertainty"]["coverage_factor"]
    return _result(
        "mass", None, mass["value"], mass["u"], U=mass["U_kg"], k=factor, nu=freedom, interval=list(mass["U95"]),
        unit="kg",
    )  # fmt: skip


def _means(source: Document) -> list[dict[str, Any]]:
    """State the quantities over the shots of a campaign, of those that were fired alike."""
    if "shots" not in source:
        return []
    return [
        _result(
            one["quantity"], None, one["value"], one["u"], kind=one["kind"],
            U=None if one["U95"] is None else 0.5 * (one["U95"][1] - one["U95"][0]), k=one["coverage_factor"],
            nu=one["degrees_of_freedom"], interval=one["U95"], unit=None,
        )
        for one in source.get("peaks") or ()
    ]  # fmt: skip


def _peaks(report: Document) -> list[dict[str, Any]]:
    """State the quantities of a shot beside its mass; one of unknown uncertainty has none."""
    u, intervals, shot = report.get("peaks_u") or {}, report.get("peaks_U95") or {}, str(report["shot"])
    found = []
    for key, value in (report.get("peaks") or {}).items():
        if value is None:
            continue
        interval = intervals.get(key)
        half = None if interval is None else 0.5 * (interval[1] - interval[0])
        factor = None if half is None or not u.get(key) else half / u[key]
        stated = (report.get("peaks_degrees_of_freedom") or {}).get(key)
        nu = None if factor is None else math.inf if stated is None else stated
        found.append(_result(key, shot, value, u.get(key), U=half, k=factor, nu=nu, interval=interval, unit=None))
    return found


def _shot(report: Document) -> dict[str, Any]:
    """State what a shot was, and that it is the one that counts."""
    log, day = report.get("shot_log") or {}, _day(report)
    return {
        "shot": str(report["shot"]),
        "started": report.get("started"),
        "started_source": report.get("started_source"),
        "fired_on": None if day is None else day.on.isoformat(),
        "configuration": str(log.get("configuration") or ""),
        "added_mass_kg": float(log.get("added_mass_kg") or 0.0),
        "u_added_mass_kg": float(log.get("u_added_mass_kg") or 0.0),
        "mass": {"value": report["mass"]["value"], "u": report["mass"]["u"]},
        "valid": bool(report["valid"]),
        "set_aside": log.get("exclude") or None,
        "use": None,
        "concession": (report.get("issued") or {}).get("concession"),
    }


def _shots(answer: Document, by_name: Mapping[str, Document]) -> list[dict[str, Any]]:
    """State of each shot of a campaign what it added, and whether and why it was set aside."""
    return [
        {
            **_shot(by_name[str(one["shot"])]),
            **{key: one[key] for key in ("configuration", "added_mass_kg", "u_added_mass_kg", "valid", "use")},
            "set_aside": one["excluded"],
        }
        for one in answer["shots"]
    ]


def _calibrations(source: Document, by_name: Mapping[str, Document], issued: Issue) -> list[dict[str, Any]]:
    """State the calibration of each channel's sensor, and whether it was in force on the day of each of its shots."""
    found = []
    for one in source.get("channels") or ():
        if not one["role"]:
            continue
        shots = [str(name) for name in one.get("shots", by_name)]
        days = [_days(by_name[name], issued) for name in shots]
        faults = [
            fault for day in chain.from_iterable(days)
            for fault in day.faults(_date(one["calibrated"]), _date(one["due"])) if fault
        ]  # fmt: skip
        told = one["calibrated"] is not None and one["due"] is not None and all(days)
        known = one.get("known_by") or {}
        found.append(
            {
                **{key: one[key] for key in ("channel", "role", "model", "serial", "certificate", "calibrated", "due")},
                "u_rel": one["u"],
                "U_rel": known.get("U_rel"),
                "k": known.get("k", USUAL_K) if "U_rel" in known else None,
                "nu": known.get("nu"),
                "shots": shots,
                "in_force": False if faults else True if told else None,
                "said": list(dict.fromkeys(faults)),
            }
        )
    return found


def _day(fired: Document) -> CalibrationDay | None:
    """Return the day on which a shot was fired, by its files or by a person; None where nothing states it."""
    day = CalibrationDay.of_report(fired)
    return None if day is None or day.of is DayOf.INGEST else day


def _days(fired: Document, issued: Issue) -> list[CalibrationDay]:
    """Return the day on which a shot was fired; where it states none, the first and the last one of the header."""
    if (day := _day(fired)) is not None:
        return [day]
    stated = dict.fromkeys(on for on in (issued.fired_from, issued.fired_until) if on is not None)
    return [CalibrationDay(on, DayOf.GIVEN) for on in stated]


def _date(text: str | None) -> dt.date | None:
    with suppress(ValueError):
        return None if not text else dt.date.fromisoformat(text)
    return None


def _deviations(reports: Sequence[Document]) -> list[str]:
    """Say what was corrected, repaired or doubted, each sentence once with the shots that it is of."""
    of: dict[str, list[str]] = {}
    for one in reports:
        said = [f"corrected: {it['key']} {it['was']} -> {it['is']}" for it in one.get("corrections") or ()]
        said += [str(note["text"]) for note in one.get("findings") or () if note["severity"] == Severity.WARN]
        for text in dict.fromkeys(said):
            of.setdefault(text, []).append(str(one["shot"]))
    several = len(reports) > 1
    return [f"shot {', '.join(shots)}: {text}" if several else text for text, shots in of.items()]
