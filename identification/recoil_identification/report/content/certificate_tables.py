"""Tables and sentences of a certificate: rows of text, rounded to their uncertainties.

Every number comes from ``certificate.json``. What is not known is a dash, or is said not to be stated: no row is left
out for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from recoil_identification.estimate.budget import MOST_DEGREES_OF_FREEDOM
from recoil_identification.estimate.rounding import NO_NUMBER, fixed, plain, rounded, signed, significant
from recoil_identification.report.content.chosen_units import ChosenUnits
from recoil_identification.report.content.section import Column, Section
from recoil_identification.report.content.tables import PEAKS, conformity, within
from recoil_identification.report.document.certificate_document import Behind

Document = Mapping[str, Any]
Row = dict[str, Any]

NOT_STATED = "not stated"
"""Words for what a header leaves open."""
INFINITE = "∞"
"""Degrees of freedom of what is known as the normal distribution has it, or nearly so."""
BEHIND = {
    Behind.ANSWER: "answer of a campaign",
    Behind.REPORT: "report of a shot",
    Behind.SHOT: "shot file",
    Behind.HEADER: "header file",
}
"""Kind of a file that a certificate rests on -> its words."""
_OF_PEAKS = {key: (label, scale, unit) for key, label, scale, _, unit in PEAKS}


def number_of(document: Document) -> str:
    """Return number and issue of the certificate."""
    issued = document["issued"]
    return f"{issued.get('number', NOT_STATED)}{', issue ' + issued['issue'] if issued.get('issue') else ''}"


def tested(document: Document) -> str:
    """Say in short what was tested."""
    names = [one["shot"] for one in document["shots"]]
    return f"shot {names[0]}" if document["certified"] == "shot" else f"campaign of {len(names)} shots"


def results(document: Document) -> list[Row]:
    """One row for the mass, and one for each quantity beside it: of a shot, or the mean of those fired alike."""
    of_shot = document["certified"] == "shot"
    return [_result(document, one) for one in document["results"] if one["shot"] is None or of_shot]


def _result(document: Document, one: Mapping[str, Any]) -> Row:
    label, by, unit = _label(document, one["key"])
    value, expanded = _rounded(one, by)
    return {
        "quantity": f"{label}, mean with {one['kind']}" if one.get("kind") else label,
        "value": value,
        "U": expanded,
        "k": NO_NUMBER if one["k"] is None else fixed(one["k"], 2),
        "nu": _freedom(one),
        "unit": unit,
        "strong": one["key"] == "mass",
    }


def _label(document: Document, key: str) -> tuple[str, float, str]:
    """Return label, factor from SI and unit of a quantity."""
    if key == "mass":
        return "recoiling mass", 1.0, "kg"
    label, scale, unit = _OF_PEAKS.get(key, (key, 1.0, ""))
    factor, name = ChosenUnits.of(document).factor(unit)
    return label, scale * factor, name


def _rounded(one: Mapping[str, Any], by: float) -> tuple[str, str]:
    value, expanded = rounded(by * one["value"], None if one["U"] is None else by * one["U"])
    return value, expanded if one["U"] is not None else NO_NUMBER


def _freedom(one: Mapping[str, Any]) -> str:
    if one["k"] is None:
        return NO_NUMBER
    return INFINITE if one["nu"] is None or one["nu"] > MOST_DEGREES_OF_FREEDOM else fixed(one["nu"], 0)


def peaks_section(document: Document) -> tuple[Section, ...]:
    """Return the section of the quantities of a campaign's shots, a row a shot; none of a single shot."""
    if document["certified"] == "shot":
        return ()
    keys = list(dict.fromkeys(one["key"] for one in document["results"] if one["shot"] is not None))
    if not keys:
        return ()
    heads = {key: _label(document, key) for key in keys}
    columns = (
        Column("shot", "Shot", "name"),
        *(Column(key, label, "number", unit) for key, (label, _, unit) in heads.items()),
    )

    def rows(stated: Document) -> list[Row]:
        cells: dict[str, Row] = {
            one["shot"]: {"shot": one["shot"], **dict.fromkeys(keys, NO_NUMBER)} for one in stated["shots"]
        }
        for one in stated["results"]:
            if one["shot"] is not None:
                value, expanded = _rounded(one, heads[one["key"]][1])
                cells[one["shot"]][one["key"]] = f"{value} ± {expanded}"
        return list(cells.values())

    factors = sorted(one["k"] for one in document["results"] if one["shot"] is not None and one["k"] is not None)
    by = " to ".join(dict.fromkeys(fixed(k, 2) for k in factors[:1] + factors[-1:]))
    known = f", k = {by} by Student's t for the ν of each" if factors else ""
    caption = f"Value and U of each shot{known}; a dash where no uncertainty is known."
    return (Section("peaks", "Peaks, time and impulse of each shot", caption, columns, rows, as_stated=True),)


def shots(document: Document) -> list[Row]:
    """One row a shot: when it was fired, what was added, its own mass, and what it counts for."""
    return [
        {
            "shot": one["shot"],
            "fired": str(one["started"] or NOT_STATED).replace("T", " "),
            "source": one["started_source"] or "",
            "configuration": one["configuration"],
            "added": _added(one),
            "mass": rounded(one["mass"]["value"], one["mass"]["u"])[0],
            "u": rounded(one["mass"]["value"], one["mass"]["u"])[1],
            "use": _use(one),
            "aside": one["set_aside"] is not None,
        }
        for one in document["shots"]
    ]


def _added(one: Mapping[str, Any]) -> str:
    u = f" (u {plain(one['u_added_mass_kg'])})" if one["u_added_mass_kg"] else ""
    return f"{plain(one['added_mass_kg'])}{u}" if one["added_mass_kg"] else "0"


def _use(one: Mapping[str, Any]) -> str:
    said = f"set aside: {one['set_aside']}" if one["set_aside"] else one["use"] or "counts"
    verdict = "" if one["valid"] else "; not valid by itself"
    return f"{said}{verdict}{'; concession: ' + one['concession'] if one['concession'] else ''}"


def calibrations(document: Document) -> list[Row]:
    """One row for each channel that the result rests on: its sensor's calibration on the day of firing."""
    several = len(document["shots"]) > 1
    return [
        {
            "channel": one["channel"],
            "sensor": " ".join(text for text in (one["model"], one["serial"]) if text) or NO_NUMBER,
            "certificate": one["certificate"] or NOT_STATED,
            "calibrated": one["calibrated"] or NO_NUMBER,
            "due": one["due"] or NO_NUMBER,
            **_calibrated(one),
            "nu": INFINITE if one["nu"] is None else plain(one["nu"]),
            "shots": ", ".join(one["shots"]) if several and len(one["shots"]) < len(document["shots"]) else "",
            "in_force": {
                True: "in force",
                False: "; ".join(one["said"]),
                None: "its dates, or the day of the shot, are not stated",
            }[one["in_force"]],
        }
        for one in document["calibrations"]
    ]


def _calibrated(one: Mapping[str, Any]) -> Row:
    """Word what a calibration states: an expanded uncertainty with its factor, or a standard one, whose factor is 1."""
    whole, k = (one["u_rel"], 1.0) if one["U_rel"] is None else (one["U_rel"], one["k"])
    if whole is None:
        return {"U": NO_NUMBER, "k": NO_NUMBER}
    return {"U": f"{significant(100 * whole, 2)} %", "k": plain(k)}


def conditions(document: Document) -> list[str]:
    """Say what the mass is, how it was found, what it is compared with and by what rule, and what it relates to."""
    stated, found = document["conformity"], conformity(document)
    tolerance = stated.get("tolerance_kg")
    about = "" if tolerance is None else f", with a tolerance {within(tolerance, sign=True)} about it"
    specification = document["specification"]
    against = (
        "No specification is stated"
        if specification["value"] is None
        else f"Specification: {plain(specification['value'])} kg{about}; deviation "
        f"{signed(fixed(specification['deviation_kg'], 2))} kg"
    )
    method, version = document["method"], document["provenance"]["version"]
    rests_on = found["words"].removeprefix(f"{found['word']}: ")
    return [
        f"Measurand: {document['measurand']}.",
        f"Method: {method['text']} Of the mass: {method['of_the_mass']}; software: recoil-daq {version}.",
        f"{against}.",
        f"Statement of conformity: {found['word']}; {rests_on}.",
        "U is the standard uncertainty times k, for a coverage of 95 %; ν are effective degrees of freedom.",
        document["statement"],
    ]


def deviations(document: Document) -> list[str]:
    """List what departed from the usual method, what was taken for granted, and what speaks against the result."""
    said = [*document["deviations"]] or ["No deviation, repair or doubt was recorded."]
    return [
        *document["reasons"],
        *said,
        *(f"Taken for granted: {one.replace('+-', '±')}." for one in document["assumed"]),
    ]


def chain(document: Document) -> list[Row]:
    """One row for each file that the certificate rests on, with its digest, and the seal that a shot file bears."""
    return [
        {"file": one["file"], "what": what, "sha256": digest}
        for one in document["provenance"]["inputs"]
        for what, digest in (
            (BEHIND[Behind(one["kind"])], one["sha256"]),
            *([("its seal", one["seal"])] if one.get("seal") else ()),
        )
    ]
