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
from recoil_identification.report.content.chosen_units import ChosenUnits
from recoil_identification.report.content.result_table import (
    ADDED,
    CONFIGURATION,
    MASS,
    PEAKS,
    TONES,
    VERDICT,
    Document,
    ResultColumn,
    ResultTable,
    Row,
    U,
    flat,
)
from recoil_identification.report.content.sentences import by_groups, effective, specified
from recoil_identification.report.content.tables import PEAKS as QUANTITIES
from recoil_identification.report.content.tables import expanded_kg
from recoil_rigs.shots.assumptions import assumption_lines
from recoil_rigs.tables.specification import mass_decimals

LEAST_SAID = 0.005
"""Probability of a size below which it is not said."""
IN_U = "u"
"""Unit of what is counted in standard uncertainties as they were known before."""
BAR_REACH = 4.0
"""Standard uncertainties, as they were known before, from the middle of a bar to its ends."""
BUDGET = (
    "Standard uncertainty of the campaign's mass from each source, the largest first; their root sum of squares is u. "
    "What the shots share counts once, for as much as they leave open of it. A source's row is what the mass moves by "
    "if what is known of it moves by its u while all shots are fitted anew: correlations among the scales are in that. "
    "Under each scatter of gains and friction, and each size of the force that no gauge reads, the rows are others: "
    "their mean square by the probability of each is shown, and how far the masses under them lie apart is random."
)
"""Over the campaign's budget."""


def coverage(document: Document) -> list[str]:
    """Say in sentences how the interval comes about; nothing where an earlier answer does not tell."""
    stated = document.get("uncertainty")
    if not stated:
        return []
    factor, known = stated["coverage_factor"], effective(stated["degrees_of_freedom"])
    by = (
        f"k is Student's for {known} degrees of freedom (Welch-Satterthwaite), because what is known beforehand is in "
        "part a guess itself (JCGM 100, G.4.2)"
        if factor > COVERAGE_FACTOR
        else "What is known beforehand of the influences is taken as known"
    )
    text = (
        f"The interval is the mass and k = {fixed(factor, 2)} standard uncertainties. {by}. What is random has 2 (v / "
        "u(v))\N{SUPERSCRIPT TWO} degrees of freedom, v its variance, u(v) how far that spreads over the scatters "
        "which the shots allow (JCGM 100, G.3). They do not widen k: u is averaged over these scatters, so that what "
        "few shots leave open of them is in it already, and would count twice."
    )
    return [text]


def coverage_factor_of(document: Document) -> float:
    """Return the coverage factor of a campaign's interval."""
    return float((document.get("uncertainty") or {}).get("coverage_factor", COVERAGE_FACTOR))


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
        "coverage_factor": fixed(coverage_factor_of(document), 2),
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


def agreement(document: Document) -> str:
    """Say how likely it is that as much is left of the shots; empty in an answer that was made before it was asked."""
    return str((document.get("agreement") or {}).get("detail", ""))


def charted(document: Document) -> list[str]:
    """Say what the charts show."""
    return [signal["detail"] for signal in document["signals"] if signal["kind"] == SignalKind.CHART]


def looks_asked_for(count: int) -> str:
    """Head what so many charts show."""
    return f"Looks that the control charts ask for ({count}); they say nothing against the mass"


def facts(document: Document) -> list[tuple[str, str]]:
    """Label and text of what stands in small print under the verdict."""
    gain, friction = document["repeatability"]["gain_rel"], document["repeatability"]["friction_rel"]
    cutoff_hz = document["provenance"]["parameters"].get("cutoff_hz")
    expanded = fixed(expanded_kg(document["mass"]), mass_decimals(document["mass"]["u"]))
    factors = [("coverage factors", f"{coverage_factor_of(document):.2f} of the interval, U = {expanded} kg; 2 of Eₙ")]
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
        scale, unit = (100.0, "%") if percent else (1.0, IN_U if one["unit"] == "1" else one["unit"])
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
                "span": "",
            }
        )
    return rows


def peaks(document: Document) -> list[Row]:
    """One row for each quantity of shots that were fired alike; none in an earlier answer."""
    rows, chosen = [], ChosenUnits.of(document)
    stated = document.get("peaks") or ()
    several = len({one["kind"] for one in stated}) > 1
    labels = {name: (label, scale, unit) for name, label, scale, _, unit in QUANTITIES}
    for one in stated:
        label, scale, unit = labels[one["quantity"]]
        factor, other = chosen.factor(unit)
        by, u, scatter = scale * factor, one["u"], one["scatter"]
        low, high = one["U95"] or (None, None)
        half = None if low is None else 0.5 * by * (high - low)
        known = half if half is not None else None if scatter is None else by * scatter
        value = significant(by * one["value"], 5) if known is None else rounded(by * one["value"], known)[0]
        rows.append(
            {
                "quantity": label,
                "kind": one["kind"] if several else "",
                "shots": str(len(one["shots"])),
                "value": value,
                "scatter": "" if scatter is None or not one["value"] else fixed(100 * scatter / one["value"], 2),
                "u": NO_NUMBER if u is None else rounded(by * one["value"], by * u)[1],
                "expanded": NO_NUMBER if half is None else rounded(by * one["value"], half)[1],
                "factor": NO_NUMBER if one["coverage_factor"] is None else fixed(one["coverage_factor"], 2),
                "unit": other,
            }
        )
    return rows


def gauges(document: Document) -> list[Row]:
    """One row for each gauge of a force: how it reads in the shots; none in an earlier answer."""
    rows = []
    for one in document.get("gauges") or ():
        value, u = rounded(100 * one["value"], 100 * one["u"])
        own, u_own = rounded(100 * one["gauge"]["value"], 100 * one["gauge"]["u"])
        rows.append(
            {
                "gauge": f"{one['force']}, sensor {one['sensors']}",
                "known": significant(100 * one["known_u"], 2),
                "value": signed(value),
                "u": u,
                "beside": ", ".join(one["beside"]),
                "own": signed(own),
                "u_own": u_own,
            }
        )
    return rows


def _place(in_u: float) -> float:
    """Percent of a bar's length."""
    return 50.0 + 50.0 * max(-BAR_REACH, min(BAR_REACH, in_u)) / BAR_REACH


def _shots(document: Document) -> list[Row]:
    """Return the shots in the order of firing, each with its peaks, its mass, and that without what was added."""
    return [
        {**one["peaks"], **one, **flat(one["mass"]),
         "own_kg": None if one["own_mass_kg"] is None else one["own_mass_kg"] - one["added_mass_kg"]}
        for one in document["shots"]
    ]  # fmt: skip


def _remarks(one: Mapping[str, Any]) -> str:
    remarks = [f"set aside: {one['excluded']}"] if one["excluded"] else []
    remarks += [str(one["shot_log"]["notes"])] if one["shot_log"].get("notes") else []
    remarks += [f"{one['use']}: {'; '.join(one['reasons'])}"] if one["use"] else []
    return "; ".join(remarks)


def _time(one: Mapping[str, Any]) -> str:
    """Date and time to the second."""
    return NO_NUMBER if not one["started"] else str(one["started"])[:19].replace("T", " ")


def _logged(name: str, head: str, unit: str) -> ResultColumn:
    """Return the column of a cell of the shot log."""
    return ResultColumn(
        name, head, "number" if unit else "text", unit, text=lambda row: _cell(row["shot_log"].get(name))
    )  # fmt: skip


SHOTS = ResultTable(
    _shots,
    (
        ResultColumn("shot", "Shot", "link"),
        ResultColumn("time", "Time", text=_time),
        CONFIGURATION,
        ADDED,
        _logged("charge", "Charge", ""),
        _logged("charge_temperature_c", "Charge", "°C"),
        _logged("elevation_deg", "Elevation", "°"),
        *PEAKS,
        MASS,
        U,
        ResultColumn("own", "Bare", "number", "kg", text=lambda row: rounded(row["own_kg"], row["own_u_kg"])[0]),
        ResultColumn("u_own", "Own u", "number", "kg", text=lambda row: rounded(row["own_kg"], row["own_u_kg"])[1]),
        ResultColumn("w", "w", "number", text=lambda row: fixed(row["normalised_residual"], 1)),
        ResultColumn("valid", "Own verdict", "chip", text=VERDICT.worded),
        ResultColumn("remarks", "Remarks", "long", text=_remarks),
    ),
    marks=lambda row: {"page": row.get("report"), "aside": row["excluded"] is not None, "tone": TONES[row["valid"]]},
)
"""Shots of a campaign, one below the other in the order of firing."""


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:g}" if isinstance(value, int | float) else str(value)


def assumed(document: Document) -> list[str]:
    """Say in a line for each kind what the shots' reports take for granted."""
    return list(assumption_lines(document.get("assumptions") or ()))


def notes(document: Document) -> list[str]:
    """List what a reader should know, and what was assumed."""
    return [*document["notes"], *assumed(document)]
