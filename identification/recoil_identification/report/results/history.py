"""Earlier campaigns of a rig beside a new one: their masses over time, and whether they differ.

What two campaigns share is read off their budgets: a row is what a mass moves by if what is known of its source moves
by its u, so that a source which is the same error in both gives the covariance of the product of both rows, with the
signs of their sensitivities. It is the same error where source, scope and u of the source are the same; of a sensor its
certificate and day of calibration, too. What is random from shot to shot is each campaign's own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from recoil_identification.campaign.season import season
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.estimate.rounding import NO_NUMBER, fixed, rounded, signed, significant
from recoil_identification.report.content.result_table import (
    E_N,
    INTERVAL,
    MASS,
    Document,
    ResultColumn,
    ResultTable,
    Row,
    U,
    flat,
    mass_panel,
)
from recoil_identification.report.figure.figure import Figure
from recoil_identification.shot.shared_identity import OF_DYNAMIC

THIS = "this campaign"
"""Name of the new one among the others."""
OWN_SCOPE = "shot"
"""Scope of what is random from shot to shot."""
EQUAL = 1e-9
"""Share by which the u of a source may differ and still be the same."""


def row_of(document: Document, name: str) -> Row:
    """Return the row of a campaign's answer, JSON types.

    Parameters
    ----------
    name
        Name of the campaign among the others.

    Raises
    ------
    LookupError, TypeError, ValueError
        If something else stands where a number or a text belongs.
    """
    mass, used = document["mass"], [one for one in document["shots"] if one["excluded"] is None]
    low, high = (float(limit) for limit in mass["U95"])
    value, u = float(mass["value"]), float(mass["u"])
    if not u > 0.0:
        raise ValueError(f"u {u:g} kg")
    days = sorted(str(one["started"]) for one in used if one["started"])
    return {
        "campaign": name,
        "first": days[0] if days else None,
        "last": days[-1] if days else None,
        "shots": len(used),
        "configuration": str(mass.get("configuration", "")),
        "mass": {"value": value, "u": u, "U95": [low, high]},
        "remark": None,
        "page": None,
    }


def shared_kg2(one: Document, other: Document) -> float:
    """Return the covariance of the masses of two campaigns of one rig, kg^2: of what is the same error in both.

    Raises
    ------
    LookupError, TypeError, ValueError
        As `row_of`.
    """
    theirs = {(row["source"], row["scope"]): row for row in other["budget"]}
    certificates = _calibrations(one), _calibrations(other)
    of_no_certificate = {of["influence"] for of in one["common"] if str(of["identity"]).startswith(OF_DYNAMIC)}
    found = 0.0
    for row in one["budget"]:
        same = theirs.get((row["source"], row["scope"]))
        if same is None or row["scope"] == OWN_SCOPE or not _equal(row["u_source"], same["u_source"]):
            continue
        renewed = certificates[0].get(row["scope"]) != certificates[1].get(row["scope"])
        if renewed and row["source"] not in of_no_certificate:
            continue
        sign = 1.0
        if row["sensitivity_kg"] is not None and same["sensitivity_kg"] is not None:
            sign = math.copysign(1.0, float(row["sensitivity_kg"]) * float(same["sensitivity_kg"]))
        found += sign * float(row["u_kg"]) * float(same["u_kg"])
    return found


def _equal(one: float | None, other: float | None) -> bool:
    if one is None or other is None:
        return one is other
    return math.isclose(one, other, rel_tol=EQUAL)


def _calibrations(document: Document) -> dict[str, set[tuple[Any, Any]]]:
    """Return certificates and days of calibration of each sensor, by the scope that its budget row has."""
    found: dict[str, set[tuple[Any, Any]]] = {}
    for channel in document["channels"]:
        found.setdefault(f"sensor {channel['serial']}", set()).add((channel["certificate"], channel["calibrated"]))
    return found


def history_document(rows: Sequence[Row], covariance_kg2: Sequence[Sequence[float]]) -> dict[str, Any]:
    """Return the history of a campaign, JSON types.

    Parameters
    ----------
    rows
        Rows of `row_of`, that of this campaign last; those with a remark are shown, and not compared.
    covariance_kg2
        Covariance of the masses of the rows that are compared, in their order.

    Raises
    ------
    ValueError
        If the matrix is no covariance of these masses.
    """
    compared = [row for row in rows if row["remark"] is None]
    document: dict[str, Any] = {
        "campaigns": [{**row, "difference_kg": None, "u_difference_kg": None, "E_n": None} for row in rows],
        "covariance_kg2": [list(line) for line in covariance_kg2],
        **dict.fromkeys(("mean", "chi_square", "degrees_of_freedom", "p", "agrees")),
    }
    if len(compared) >= 2:
        masses = np.array([row["mass"]["value"] for row in compared])
        found = season(masses, np.array(covariance_kg2))
        document |= {
            "mean": {"value": found.mean_kg, "u": found.u_kg},
            "chi_square": found.chi_square,
            "degrees_of_freedom": found.degrees_of_freedom,
            "p": found.p,
            "agrees": found.agrees,
        }
        differences = iter(zip(found.differences_kg.tolist(), found.u_differences_kg.tolist(), strict=True))
        for row in document["campaigns"][:-1]:
            if row["remark"] is None:
                difference, u = next(differences)
                e_n = difference / (2.0 * u) if u > 0.0 else None
                row |= {"difference_kg": difference, "u_difference_kg": u, "E_n": e_n}
    return {**document, "detail": _detail(document)}


def history_again(history: Document, document: Document) -> dict[str, Any]:
    """Compare the campaigns of a history again: the earlier ones as it has them, the new one as its answer has it.

    Raises
    ------
    LookupError, TypeError, ValueError
        If it is no history.
    """
    rows = [
        {**{key: row[key] for key in row_of(document, THIS)}, "mass": dict(row["mass"])}
        for row in history["campaigns"][:-1]
    ]
    covariance = [[float(one) for one in line] for line in history["covariance_kg2"]]
    covariance[-1][-1] = float(document["mass"]["u"]) ** 2
    return history_document([*rows, row_of(document, THIS)], covariance)


def _detail(document: Document) -> str:
    """Say in a sentence whether the campaigns differ by more than their uncertainties allow."""
    others = [row for row in document["campaigns"] if row["E_n"] is not None]
    if document["p"] is None:
        return "No earlier campaign can be compared with this one."
    furthest = max(others, key=lambda row: abs(row["E_n"]))
    value, u = rounded(furthest["difference_kg"], furthest["u_difference_kg"])
    number = "an earlier campaign" if len(others) == 1 else f"{len(others)} earlier campaigns"
    agrees = "differ by no more than" if document["agrees"] else "differ by more than"
    return (
        f"This campaign and {number} {agrees} their uncertainties and what they share allow: chi square "
        f"{significant(document['chi_square'], 2)} with {document['degrees_of_freedom']} degrees of freedom, p "
        f"{significant(document['p'], 2)}; furthest off is {furthest['campaign']}, {signed(value)} kg (u {u} kg, E_n "
        f"{signed(fixed(furthest['E_n'], 2))})."
    )


def _rows(document: Document) -> list[Row]:
    """Return the earlier campaigns of a campaign's answer and itself; nothing where none was asked for."""
    history = document.get("history")
    if history is None:
        return []
    lines, this = iter(history["covariance_kg2"]), history["campaigns"][-1]
    rows = [{**one, **flat(one["mass"]), "shared": None, "this": one is this} for one in history["campaigns"]]
    for row in rows:
        row["sound"] = row["remark"] is None and (document["valid"] or not row["this"])
        if row["remark"] is None:
            covariance_kg2 = next(lines)[-1]
            row["shared"] = None if row["this"] else covariance_kg2 / (this["mass"]["u"] * row["u_kg"])
    return rows


def _compared(key: str, head: str, unit: str, text: Callable[[Mapping[str, Any]], str]) -> ResultColumn:
    """Return a column that says nothing of a campaign which is not compared with this one."""
    return ResultColumn(key, head, "number", unit, text=lambda row: "" if row["E_n"] is None else text(row))


def _names(rows: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the day on which each campaign began; their names where these days do not tell them apart."""
    days = [(row["first"] or "")[:10] for row in rows]
    return tuple(days if len({*days, ""}) == len(rows) + 1 else [row["campaign"] for row in rows])


def _when(row: Mapping[str, Any]) -> str:
    days = [day[:10] for day in (row["first"], row["last"]) if day]
    return " to ".join(dict.fromkeys(days)) or NO_NUMBER


def caption(document: Document) -> str:
    """Say what the table shows."""
    return (
        f"{document['history']['detail']} The difference is from this campaign. What is the same error in both, a "
        "sensor's certificate or what the rig file states, does not make them differ: its covariance is taken off the "
        "variance of the difference. Shared is the correlation of the two masses by it. A source is the same where its "
        "name and u are, of a sensor the certificate and the day of calibration, too."
    )  # fmt: skip


HISTORY = ResultTable(
    _rows,
    (
        ResultColumn("campaign", "Campaign", "link"),
        ResultColumn("when", "Fired", text=_when),
        ResultColumn("shots", "Shots", "number"),
        MASS,
        U,
        INTERVAL,
        _compared("difference", "Difference", "kg",
                  lambda row: signed(rounded(row["difference_kg"], row["u_difference_kg"])[0])),
        _compared("u_difference", "u of it", "kg",
                  lambda row: rounded(row["difference_kg"], row["u_difference_kg"])[1]),
        ResultColumn("shared", "Shared", "number", "%", printed=None,
                     text=lambda row: "" if row["shared"] is None else fixed(100.0 * row["shared"], 0)),
        _compared("e_n", "E_n", "", E_N.worded),
        ResultColumn("remark", "Remark", "long", printed="not compared"),
    ),
    marks=lambda row: {"page": row["page"], "strong": row["this"], "aside": not row["sound"]},
)  # fmt: skip
"""Campaigns of a season, one below the other in the order of firing, the new one last."""


def history_figure(document: Document) -> Figure | None:
    """Draw the mass of each campaign with its 95 % interval, in the order of firing; None where there is no history."""
    rows = _rows(document)
    if not rows:
        return None
    mean = document["history"]["mean"]
    half = 0.0 if mean is None else COVERAGE_FACTOR * mean["u"]
    panel = mass_panel(
        range(len(rows)),
        rows,
        [
            (label, [row["sound"] is sound for row in rows], hue)
            for label, sound, hue in (("mass, 95 % interval", True, 0), ("not valid, or not compared", False, 7))
        ],
        band=None if mean is None else (
            "mean of the season, 95 %", (-0.5, len(rows) - 0.5),
            (mean["value"], mean["value"] - half, mean["value"] + half),
        ),
        specification_kg=document["mass"].get("specification"),
    )  # fmt: skip
    return Figure(
        "season", "The season: mass by campaign",
        "Each campaign's mass by itself, without what was added; this one last.",
        "campaign", (panel,), names=_names(rows), shown=(-0.6, len(rows) - 0.4),
    )  # fmt: skip
