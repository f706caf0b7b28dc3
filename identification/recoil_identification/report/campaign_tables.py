"""Words and tables of a campaign's page: rows of text, rounded to their uncertainties.

Every number comes from ``campaign.json``; only its rounding, and its place on a bar, are made here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from recoil_acquisition.remark import Severity
from recoil_identification.campaign.signal_kind import SignalKind
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.estimate.rounding import MINUS, NO_NUMBER, fixed, plain, rounded, signed, significant
from recoil_identification.report.sentences import by_groups, specified
from recoil_rigs.assumptions import assumption_lines
from recoil_rigs.specification import mass_decimals

Document = Mapping[str, Any]
Row = dict[str, Any]

LEAST_SAID = 0.005
"""Probability of a size below which it is not said."""
BAR_REACH = 4.0
"""Standard uncertainties, as they were known before, from the middle of a bar to its ends."""
PEAKS = (
    ("breech_pressure_pa", "Breech /&nbsp;MPa", 1e-6, 1),
    ("recoil_velocity_m_s", "Velocity /&nbsp;m/s", 1.0, 2),
    ("recoil_travel_m", "Travel /&nbsp;mm", 1e3, 1),
    ("impulse_n_s", "Impulse /&nbsp;N&nbsp;s", 1.0, 0),
)
LOG_COLUMNS = (
    ("charge", "Charge"),
    ("charge_temperature_c", "Charge /&nbsp;°C"),
    ("elevation_deg", "Elevation /&nbsp;°"),
)


def verdict(document: Document) -> Row:
    """Word the page's first line."""
    mass = document["mass"]
    low, high = mass["U95"]
    value, half = rounded(mass["value"], (high - low) / 2)
    used = sum(shot["excluded"] is None for shot in document["shots"])
    of = "" if used == len(document["shots"]) else f" of {len(document['shots'])}"
    return {
        "valid": bool(document["valid"]),
        "measurand": document.get("measurand"),
        "mass": value,
        "spread": f"± {half}",
        "unit": mass.get("unit", "kg"),
        "interval": f"{rounded(low, (high - low) / 2)[0]} to {rounded(high, (high - low) / 2)[0]} kg",
        "u": rounded(mass["value"], mass["u"])[1],
        "between": significant(mass["u_between_shots"], 2),
        "shots": f"{used}{of}",
        **_against(document),
    }


def _against(document: Document) -> Row:
    """Word how the mass compares with the specification: texts, ``agrees`` is bool; None where there is none."""
    mass, e_n = document["mass"], document["mass"].get("E_n")
    if mass.get("specification") is None or e_n is None:
        return dict.fromkeys(("specification", "deviation", "e_n", "agrees"))
    kg, percent = (
        signed(fixed(mass["deviation_kg"], mass_decimals(mass["u"]))),
        signed(fixed(mass["deviation_percent"], 2)),
    )
    return {
        "specification": plain(mass["specification"]),
        "deviation": f"{kg} kg, {percent} %",
        "e_n": signed(fixed(e_n, 2)),
        "agrees": abs(e_n) <= 1.0,
    }


def changed(document: Document) -> list[str]:
    """Say what changed among the shots, as far as no reason says it."""
    told = {(one["code"], one["about"]) for one in document["findings"] if one["severity"] == Severity.FATAL}
    changes = (signal for signal in document["signals"] if signal["kind"] != SignalKind.CHART)
    # a reason has the code of the change that it is of
    return [change["detail"] for change in changes if (change["kind"], change["influence"]) not in told]


def unchanged(document: Document) -> str:
    """Say that nothing changed among the shots, or that no change explains them; empty where one is named."""
    if any(signal["kind"] != SignalKind.CHART for signal in document["signals"]):
        return ""
    return "Nothing changed among the shots." if document["valid"] else "No change among the shots is found."


def constancy(document: Document) -> str:
    """Say whether the mass changes within the shots; empty where a reason says it, or nothing tells."""
    test = document.get("constancy")
    return str(test["detail"]) if test is not None and test["constant"] else ""


def charted(document: Document) -> list[str]:
    """Say what the charts show."""
    return [signal["detail"] for signal in document["signals"] if signal["kind"] == SignalKind.CHART]


def facts(document: Document) -> list[tuple[str, str]]:
    """Label and text of what stands in small print under the verdict."""
    gain, friction = document["repeatability"]["gain_rel"], document["repeatability"]["friction_rel"]
    cutoff_hz = document["provenance"]["parameters"].get("cutoff_hz")
    expanded = fixed(document["mass"]["U_kg"], mass_decimals(document["mass"]["u"]))
    factors = [("coverage factors", f"{COVERAGE_FACTOR:.2f} of the interval, U = {expanded} kg; 2 of Eₙ")]
    of, parts = specified(document), by_groups(document)
    found = [
        *([("specification", f"{of}, nothing added")] if of else ()),
        *([("standard uncertainty by groups", parts)] if parts else ()),
        *(factors if document["mass"].get("E_n") is not None else ()),
        ("gains repeat to", _scatter(gain, 3)),
        ("friction repeats to", _scatter(friction, 1)),
        *unread_force(document),
    ]
    if cutoff_hz is not None:
        found.append(("low-pass of the mass, one for all shots", f"{significant(cutoff_hz, 3)} Hz"))
    return found


def unread_force(document: Document) -> list[tuple[str, str]]:
    """Label and text of how large the force is that no gauge reads; nothing where the shots do not tell."""
    sizes = next((one["sizes"] for one in document["common"] if one.get("sizes")), ())
    likely = [one for one in sizes if one["weight"] >= LEAST_SAID]
    if not likely:
        return []
    told = ", ".join(f"{fixed(100 * one['size'], 2)} % ({fixed(100 * one['weight'], 0)} %)" for one in likely)
    return [("force that no gauge reads, share of the peak resistance (probability)", told)]


def _scatter(scatter: Mapping[str, Any], decimals: int) -> str:
    value, low, high = (fixed(100 * share, decimals) for share in (scatter["value"], *scatter["U95"]))
    return f"{value} % (95 %: {low} to {high} %)"


def next_steps(document: Document) -> list[Row]:
    """Word what would make the mass surer."""
    mass = document["mass"]
    return [
        {
            "change": one["change"],
            "u": rounded(mass["value"], one["u_kg"])[1],
            "percent": fixed(100 * one["u_kg"] / mass["value"], 3),
        }
        for one in document["next"]
    ]


def mechanisms(document: Document) -> list[Row]:
    """One row for each mechanism, where there are several."""
    if len(document["configurations"]) < 2:
        return []
    rows = []
    for one in document["configurations"]:
        value, u = rounded(one["mass"]["value"], one["mass"]["u"])
        apart = one["difference"]
        difference, u_difference = (NO_NUMBER, NO_NUMBER) if apart is None else rounded(apart["value"], apart["u"])
        rows.append(
            {
                "name": one["name"],
                "shots": len(one["shots"]),
                "mass": value,
                "u": u,
                "difference": difference,
                "u_difference": u_difference,
            }
        )
    return rows


def learnt(document: Document) -> list[Row]:
    """One row for each influence that the shots share: known before, found, and both as bars.

    The bars are in standard uncertainties of what was known, 95 % each; what lies beyond their end is cut there.
    """
    rows = []
    for one in document["common"]:
        prior = one["prior_u"]
        percent = one["unit"] == "1" and prior < 1.0
        scale, unit = (100.0, "%") if percent else (1.0, "" if one["unit"] == "1" else one["unit"])
        value, u = rounded(None if one["value"] is None else scale * one["value"], scale * one["u"])
        at, half = (one["value"] or 0.0) / prior, COVERAGE_FACTOR * one["u"] / prior
        low, high = _place(at - half), _place(at + half)
        rows.append(
            {
                "influence": one["influence"],
                "prior": f"{significant(scale * prior, 2)} {unit}".strip(),
                "value": f"{'' if value.startswith(MINUS) else '+'}{value} {unit}".strip()
                if one["value"] is not None
                else NO_NUMBER,
                "u": f"{u} {unit}".strip(),
                "w": fixed(one["normalised_residual"], 1),
                "gained": fixed(prior / one["u"], 1),
                "prior_from": f"{_place(-COVERAGE_FACTOR):.1f}",
                "prior_width": f"{_place(COVERAGE_FACTOR) - _place(-COVERAGE_FACTOR):.1f}",
                "from": f"{low:.1f}",
                "width": f"{max(high - low, 0.8):.1f}",
                "at": f"{_place(at):.1f}",
                "beyond": abs(at) > BAR_REACH,
            }
        )
    return rows


def _place(in_u: float) -> float:
    """Percent of a bar's length."""
    return 50.0 + 50.0 * max(-BAR_REACH, min(BAR_REACH, in_u)) / BAR_REACH


def shots(document: Document) -> tuple[list[tuple[str, bool]], list[Row]]:
    """Return the table of shots, without columns in which nothing stands.

    Returns
    -------
    columns : list of (str, bool)
        Heading, as HTML, and whether it holds numbers.
    rows : list of dict
        ``page``, ``excluded``, and ``cells``: text, and whether it is a number.
    """
    columns = [
        ("Shot", False),
        ("Time", False),
        ("Configuration", False),
        ("Added /&nbsp;kg", True),
        *((label, name != "charge") for name, label in LOG_COLUMNS),
        *((label, True) for _, label, _, _ in PEAKS),
        *((f"{name} /&nbsp;kg", True) for name in ("Mass", "u", "Bare", "Own u")),
        ("w", True),
        ("Own verdict", False),
        ("Remarks", False),
    ]
    table = [_shot(one) for one in document["shots"]]
    filled = [k for k in range(len(columns)) if any(cells[k] not in ("", NO_NUMBER) for cells in table)]
    rows = [
        {
            "page": one.get("report"),
            "excluded": one["excluded"] is not None,
            "cells": [(cells[k], columns[k][1]) for k in filled],
        }
        for one, cells in zip(document["shots"], table, strict=True)
    ]
    return [columns[k] for k in filled], rows


def _shot(one: Mapping[str, Any]) -> list[str]:
    """Return a shot's cells, in the order of all columns."""
    added, cells = one["added_mass_kg"], one["shot_log"]
    mass, u = rounded(one["mass"]["value"], one["mass"]["u"])
    own, u_own = rounded(None if one["own_mass_kg"] is None else one["own_mass_kg"] - added, one["own_u_kg"])
    remarks = [f"set aside: {one['excluded']}"] if one["excluded"] else []
    remarks += [str(cells["notes"])] if cells.get("notes") else []
    remarks += [f"{one['use']}: {'; '.join(one['reasons'])}"] if one["use"] else []
    return [
        one["shot"],
        _time(one["started"]),
        one["configuration"],
        f"{added:g}" if added else "",
        *(_cell(cells.get(name)) for name, _ in LOG_COLUMNS),
        *(_peak(one["peaks"].get(name), scale, decimals) for name, _, scale, decimals in PEAKS),
        *(mass, u, own, u_own),
        fixed(one["normalised_residual"], 1),
        "valid" if one["valid"] else "not valid",
        "; ".join(remarks),
    ]


def _time(started: str | None) -> str:
    """Date and time to the second."""
    return NO_NUMBER if not started else started[:19].replace("T", " ")


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:g}" if isinstance(value, int | float) else str(value)


def _peak(value: float | None, scale: float, decimals: int) -> str:
    return fixed(None if value is None else scale * value, decimals)


def assumed(document: Document) -> list[str]:
    """Say in a line for each kind what the shots' reports take for granted."""
    return assumption_lines(document.get("assumptions") or ())
