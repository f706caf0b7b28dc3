"""Words and tables of a report's page: rows of text, rounded to their uncertainties.

Every number comes from the report; only its rounding, and a source's share of the variance, are made here.
Optional keys may be absent or null, and give no row or a dash.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from recoil_identification.estimate.conformity import UNSTATED
from recoil_identification.estimate.rounding import (
    MINUS,
    NO_NUMBER,
    fixed,
    percentage,
    plain,
    prefixed,
    rounded,
    signed,
    significant,
)
from recoil_identification.report.content.chosen_units import ChosenUnits
from recoil_identification.report.content.glossary import notation
from recoil_identification.report.content.sentences import by_groups, specified
from recoil_identification.shot.peaks import LABELS
from recoil_rigs.tables.issue import GUARD_BAND, SIMPLE

Report = Mapping[str, Any]
Row = dict[str, Any]

PEAKS = (
    ("breech_pressure_pa", LABELS["breech_pressure_pa"], 1e-6, 1, "MPa"),
    ("brake_pressure_pa", LABELS["brake_pressure_pa"], 1e-6, 2, "MPa"),
    ("recuperator_pressure_pa", LABELS["recuperator_pressure_pa"], 1e-6, 2, "MPa"),
    ("recoil_acceleration_m_s2", LABELS["recoil_acceleration_m_s2"], 1.0, 0, "m/s²"),
    ("recoil_velocity_m_s", LABELS["recoil_velocity_m_s"], 1.0, 2, "m/s"),
    ("recoil_travel_m", LABELS["recoil_travel_m"], 1e3, 1, "mm"),
    ("recoil_time_s", LABELS["recoil_time_s"], 1e3, 1, "ms"),
    ("impulse_n_s", LABELS["impulse_n_s"], 1e-3, 2, "kN s"),
)
"""Key, label, factor, decimals and unit."""
NAMED = {SIMPLE: "simple acceptance", GUARD_BAND: "guard band w = U"}
"""Decision rules that have a name -> the name."""
NO_UNCERTAINTY = "no uncertainty is known"
"""Why no conformity is stated of a mass that has no uncertainty."""
NO_TOLERANCE = (
    "No conformity is stated: [report] of the rig file, or a header file, states a tolerance of the mass of the "
    "recoiling part alone, or none."
)
"""Sentence of a target's page that has no conformity."""
SMALL_SHARE = 1.0
"""Share of the variance, %, below which a page folds a row of the budget."""
SEVERITY = {"fail": 0, "warn": 1, "ok": 2}


def expanded_kg(mass: Mapping[str, Any]) -> float:
    """Return half the width of a mass's 95 % interval: earlier documents state the interval alone."""
    stated = mass.get("U_kg")
    return float(0.5 * (mass["U95"][1] - mass["U95"][0]) if stated is None else stated)


def verdict(report: Report) -> Row:
    """Word the page's first line.

    Parameters
    ----------
    report
        Schema ``recoil-daq/report/1``.

    Returns
    -------
    dict
        ``valid``, ``number`` and ``agrees`` are bool, ``unit`` is a text, every other value a text or None.
    """
    mass, rpe = report["mass"], report["rpe_percent"] or {}
    value, u95, unit = mass.get("value"), _limits(mass.get("U95")), mass.get("unit", "kg")
    half, rpe_u95, e_n = _half(u95), _limits(rpe.get("U95")), report.get("E_n")
    mass_text, half_text = rounded(value, half)
    rpe_text, _ = rounded(rpe.get("value"), _half(rpe_u95))
    number = value is not None and math.isfinite(value)
    factor = (report.get("uncertainty") or {}).get("coverage_factor")
    return {
        "valid": bool(report["valid"]),
        "number": number,
        "mass": mass_text,
        "spread": _spread(value, u95, half_text) if number else None,
        "unit": unit,
        "interval": _interval(u95, unit),
        "expanded": None if half is None else f"{half_text} {unit}",
        "coverage_factor": None if factor is None else fixed(factor, 2),
        "measurand": report.get("measurand"),
        "specification": _known(mass.get("specification")),
        "off": _off(mass),
        "rpe": None if rpe_text == NO_NUMBER else percentage(rpe.get("value"), rpe_text),
        "rpe_interval": _interval(rpe_u95, "%"),
        "rpe_meaning": rpe.get("meaning"),
        "e_n": None if e_n is None else fixed(e_n, 2),
        "deviation": report.get("deviation"),
        "agrees": e_n is not None and abs(e_n) <= 1.0,
    }


def peaks(report: Report, *, only: Collection[str] = ()) -> list[tuple[str, str]]:
    """Label and text, with its expanded uncertainty and unit, of the quantities of the shot, as far as it has them.

    Parameters
    ----------
    only
        Names of the quantities that are wanted; all of them if there is none.
    """
    known, intervals, chosen = report.get("peaks") or {}, report.get("peaks_U95") or {}, ChosenUnits.of(report)
    written = []
    for name, label, scale, decimals, unit in PEAKS:
        if known.get(name) is None or (only and name not in only):
            continue
        factor, other = chosen.factor(unit)
        value = scale * known[name]
        if (interval := intervals.get(name)) is not None:
            half = 0.5 * scale * factor * (interval[1] - interval[0])
            text, spread = rounded(factor * value, half)
            written.append((label, f"{text} ± {spread} {other}"))
            continue
        # in another unit to as many digits as in its own
        digits = max(len(fixed(value, decimals).strip(f"{MINUS}0.").replace(".", "")), 1)
        text = fixed(value, decimals) if other == unit else significant(factor * value, digits)
        written.append((label, f"{text} {other}"))
    return written


def peak_rows(report: Report) -> list[Row]:
    """List the quantities that have an uncertainty, each with what contributes most to it."""
    u, intervals, ruled = (report.get(key) or {} for key in ("peaks_u", "peaks_U95", "peaks_ruled_by"))
    known, chosen, rows = report.get("peaks") or {}, ChosenUnits.of(report), list[Row]()
    for name, label, scale, _, unit in PEAKS:
        if u.get(name) is None or intervals.get(name) is None:
            continue
        factor, other = chosen.factor(unit)
        by = scale * factor
        value, spread = rounded(by * known[name], by * u[name])
        low, high = (rounded(by * end, by * u[name])[0] for end in intervals[name])
        rows.append(
            {
                "quantity": label,
                "value": value,
                "u": spread,
                "interval": f"{low} to {high}",
                "unit": other,
                "ruled_by": ruled.get(name) or "",
            }
        )
    return rows


def started(report: Report) -> str | None:
    """Say when the shot was and what tells it; None where nothing does."""
    when, source = report.get("started"), report.get("started_source")
    return f"{when} ({source})" if when and source else when


def logged(report: Report) -> list[tuple[str, str]]:
    """Label and text of what the shot log says of how the shot was fired; that it is excluded is a note.

    Returns
    -------
    list of (str, str)
    """
    row = report.get("shot_log") or {}
    found = [("configuration", str(row["configuration"]))] if row.get("configuration") else []
    added, u = row.get("added_mass_kg"), row.get("u_added_mass_kg")
    if added or u:
        stated = "taken as exact" if u is None else f"u {plain(u)} kg"
        found.append(("added mass, in the specification", f"{plain(added or 0.0)} kg ({stated})"))
    return found


def _in_the_log(report: Report) -> list[tuple[str, str]]:
    """Label and text of the other cells of the shot's row."""
    said = ("shot", "time", "configuration", "added_mass_kg", "u_added_mass_kg")
    cells = [(name, cell) for name, cell in (report.get("shot_log") or {}).items() if name not in said]
    return [(name.replace("_", " "), _cell(cell)) for name, cell in cells if cell not in (None, "")]


def _cell(value: Any) -> str:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return plain(value) if number else str(value)


def facts(report: Report) -> list[tuple[str, str]]:
    """Label and text of what stands in small print under the verdict.

    Returns
    -------
    list of (str, str)
    """
    found = [("rig", str(report["rig"]))]
    when = started(report)
    found.append(("date and time", when or "not recorded"))
    found += [*logged(report), *_in_the_log(report)]
    if of := specified(report):
        found.append(("specification", of))
    if parts := by_groups(report):
        found.append(("standard uncertainty by groups", parts))
    interval, window, share = (report.get(key) for key in ("interval_s", "window_s", "identified_share"))
    if report["mass"].get("method"):
        found.append(("method", str(report["mass"]["method"])))
    if interval:
        start, end = (fixed(_scaled(limit, 1e3), 1) for limit in interval)
        found.append(("identification interval", f"{start} ms to {end} ms"))
    if window is not None:
        chosen = "" if report.get("window_reason", "given") == "given" else ", by what its masses predict"
        found.append(("memory (window)", f"{plain(1e3 * window)} ms{chosen}"))
    if share is not None:
        found.append(("identified share of it", f"{fixed(100 * share, 1)} %"))
    found += [
        (
            f"{one['against']} beside the {one['about']}",
            (
                f"{signed(significant(one['off_percent'], 2))} % (u {significant(one['u_percent'], 2)} %), "
                f"{signed(fixed(one['normalised_residual'], 1))} standard deviations off all else "
                f"(limit {one['limit']:g})"
            ),
        )
        for one in report.get("force_checks") or ()
    ]
    truth = report.get("truth") or {}
    if truth.get("mass_kg") is not None:
        found.append(("true mass (virtual shot)", f"{plain(truth['mass_kg'])} kg"))
    if truth.get("error_percent") is not None:
        found.append(("error against the truth", f"{signed(significant(truth['error_percent'], 2))} %"))
    found += [(str(name).replace("_", " "), _cell(value)) for name, value in (report.get("summary") or {}).items()]
    return found


def methods(report: Report) -> list[Row]:
    """One row for each method that was tried; percentages have the digits that the mass has."""
    rows = []
    for method in report.get("methods") or ():
        mass, u = method.get("mass_kg"), method.get("u_kg")
        relative = 100 * u / abs(mass) if mass and u else None
        mass_text, u_text = rounded(mass, u)
        rows.append(
            {
                "name": method.get("name", NO_NUMBER),
                "mass": mass_text,
                "u": u_text,
                "deviation": signed(rounded(method.get("deviation_percent"), relative)[0]),
                "rpe": percentage(method.get("rpe_percent"), rounded(method.get("rpe_percent"), relative)[0]),
                "note": method.get("note") or "",
                "strong": method.get("name") == report["mass"].get("method"),
            }
        )
    return rows


def budget(report: Report) -> list[Row]:
    """Rows of the uncertainty budget, the largest first; a page folds those below one per cent.

    The share is that of the sum of squares (JCGM 100:2008, 5.1.3, with unit sensitivities: each row is in kg).
    """
    entries = sorted(report.get("budget") or (), key=lambda entry: -abs(entry.get("u_kg") or 0.0))
    total = math.fsum((e.get("u_kg") or 0.0) ** 2 for e in entries)
    rows = []
    for entry in entries:
        u = abs(entry.get("u_kg") or 0.0)
        share = 100 * u**2 / total if total > 0.0 else 0.0
        per = entry.get("sensitivity_per") or ""
        unit = "" if per in ("", "1") else f" {per}"
        per_unit = "" if not unit else f"/({per})" if "/" in per else f"/{per}"
        sensitivity, u_source = entry.get("sensitivity_kg"), entry.get("u_source")
        freedom = entry.get("degrees_of_freedom")
        rows.append(
            {
                "source": entry.get("source", NO_NUMBER),
                "group": entry.get("group") or "",
                "kind": ", ".join(text for text in (entry.get("type"), entry.get("distribution")) if text),
                "u_source": f"{significant(u_source, 2)}{unit}" if u_source else "",
                "estimate": _estimate(entry, unit),
                "sensitivity": f"{signed(significant(sensitivity, 3))} kg{per_unit}" if sensitivity else "",
                "freedom": "∞" if freedom is None or not math.isfinite(freedom) else fixed(freedom, 0),
                "u": significant(u, 2),
                "share": "< 1" if 0.0 < share < 1.0 else fixed(share, 0),
                "width": f"{share:.1f}",
                "scope": entry.get("scope") or "",
                "folded": share < SMALL_SHARE,
            }
        )
    return rows


def budget_rest(report: Report) -> Row | None:
    """Return the sum of what the budget folds as a row of it; None where it folds nothing."""
    squares = sorted((entry.get("u_kg") or 0.0) ** 2 for entry in report.get("budget") or ())
    total = math.fsum(squares)
    small = [one for one in squares if 100 * one < SMALL_SHARE * total]
    if not small:
        return None
    rest = math.fsum(small)
    return {
        "source": f"{len(small)} more, together", "u": significant(math.sqrt(rest), 2),
        "share": fixed(100 * rest / total, 1), "width": f"{100 * rest / total:.1f}",
    }  # fmt: skip


def _estimate(entry: Mapping[str, Any], unit: str) -> str:
    """Word by how much a source was found to be off, as deep as its uncertainty is known."""
    found, u = entry.get("estimate"), entry.get("u_source")
    return "" if found is None or not u else f"{signed(rounded(found, u)[0])}{unit}"


def budget_total(report: Report) -> Row | None:
    """Return the combined standard uncertainty as a row of the budget; None where the report has none."""
    u_mass = report["mass"].get("u")
    return None if u_mass is None else {"source": "Combined standard uncertainty", "u": significant(u_mass, 2)}


def hidden(report: Report) -> list[Row]:
    """One row for each error that the shot may not tell: how large it may be, and what it does to the mass."""
    rows = []
    for entry in report.get("could_hide") or ():
        largest, mass_kg, unit = entry.get("largest_error"), entry.get("mass_kg"), entry.get("unit") or "1"
        shown, one = ("%", "1 %") if unit == "1" else (unit, f"1 {unit}")
        scale = 100.0 if unit == "1" else 1.0
        rows.append(
            {
                "source": entry.get("source", NO_NUMBER),
                "largest": "any" if largest is None else f"{significant(scale * largest, 2)} {shown}",
                "mass": NO_NUMBER if mass_kg is None else signed(significant(mass_kg, 2)),
                "per": f"{signed(significant(entry['sensitivity_kg'] / scale, 2))} kg for {one}",
            }
        )
    return rows


def alignment(report: Report) -> list[Row]:
    """One row for each clock: offset in ms, its u in µs, drift and its u in ppm."""
    rows = []
    for clock in report.get("alignment") or ():
        offset_ms, u_offset_ms = (_scaled(clock.get(key), 1e3) for key in ("offset_s", "u_offset_s"))
        drift, u_drift = rounded(_scaled(clock.get("drift"), 1e6), _scaled(clock.get("u_drift"), 1e6))
        rows.append(
            {
                "clock": clock.get("clock", NO_NUMBER),
                "offset": rounded(offset_ms, u_offset_ms)[0],
                "u_offset": significant(_scaled(u_offset_ms, 1e3), 2),
                "drift": drift,
                "u_drift": u_drift,
                "status": clock.get("status", NO_NUMBER),
                "method": ": ".join(str(clock[key]) for key in ("method", "detail") if clock.get(key)),
            }
        )
    return rows


def quality(report: Report) -> list[Row]:
    """One row for each check, what needs attention first and what passed folded; an unknown verdict is a failure."""
    rows = [
        {key: row.get(key, NO_NUMBER) for key in ("channel", "check", "verdict", "detail")}
        | {"folded": row.get("verdict") == "ok"}
        for row in report.get("quality") or ()
    ]
    return sorted(rows, key=lambda row: SEVERITY.get(row["verdict"], 0))


def quality_in_words(report: Report) -> str:
    """Say how many checks passed."""
    rows = quality(report)
    attention = sum(not row["folded"] for row in rows)
    if not attention:
        return f"All {len(rows)} checks passed."
    ask = "asks" if attention == 1 else "ask"
    passed = len(rows) - attention
    return f"{attention} of {len(rows)} checks {ask} for attention; {passed} check{'s' if passed != 1 else ''} passed."


def ringing(report: Report) -> list[Row]:
    """One row for each mode that rings on a channel, the strongest of each channel first."""
    rows = []
    for channel in report.get("ringing") or ():
        share = fixed(100 * channel["energy_share"], 1)
        modes = channel.get("modes") or ()
        if not modes:
            rows.append({"channel": channel["channel"], "share": share, "frequency": NO_NUMBER,
                         "damping": NO_NUMBER, "mode": NO_NUMBER, "amplitude": NO_NUMBER})  # fmt: skip
        for i, mode in enumerate(modes):
            rows.append(
                {
                    "channel": channel["channel"] if i == 0 else "",
                    "share": share if i == 0 else "",
                    "frequency": fixed(mode["frequency_hz"], 0),
                    "damping": significant(100 * mode["damping_ratio"], 2),
                    "mode": fixed(100 * mode["energy_share"], 1),
                    "amplitude": f"{significant(mode['amplitude'], 2)} {mode['unit']}",
                }
            )
    return rows


def quantities(document: Report) -> list[Row]:
    """One row for each identified quantity, with the digits that its uncertainty justifies."""
    rows, chosen = [], ChosenUnits.of(document)
    for one in document["quantities"]:
        factor, unit = chosen.factor(one["unit"])
        if unit == one["unit"]:
            factor, unit = prefixed(one["value"] if one["value"] is not None else one["declared"], one["unit"])
        value, u = rounded(_scaled(one["value"], factor), _scaled(one["u"], factor))
        low, high = (rounded(_scaled(limit, factor), _scaled(one["u"], factor))[0] for limit in one["U95"])
        rows.append(
            {
                "name": one["name"],
                "symbol": one["symbol"],
                "value": value,
                "u": u if one["value"] is not None else NO_NUMBER,
                "interval": f"{low} … {high}" if one["value"] is not None else NO_NUMBER,
                # cubic metres are spelled as the recoiling mass's symbol is: of a text it could be either
                "unit": {"1": "", "m3": "m³"}.get(unit, notation(unit)),
                "expected": plain(_scaled(one["declared"], factor)),
                "e_n": NO_NUMBER if one["E_n"] is None else signed(fixed(one["E_n"], 2)),
                "conforms": _conforms(one.get("conformity")),
                "basis": one["basis"],
            }
        )
    return rows


def _conforms(found: Mapping[str, Any] | None) -> str:
    """Word the conformity of one of several quantities; empty where no tolerance is stated of it."""
    if not found:
        return ""
    said = "" if found["probability"] is None else f"{percent_of(found['probability'])} %, "
    return f"{said}{found['word'].upper()}"


def tolerances(document: Report) -> list[str]:
    """Say of which identified quantities a tolerance is stated, and by what rule it is judged."""
    stated = [one for one in document["quantities"] if one.get("conformity")]
    if not stated:
        return [NO_TOLERANCE]
    found = stated[0]["conformity"]
    names = ", ".join(one["name"] for one in stated)
    sentence = (
        f"Conformity of {names} with {within(found['tolerance_kg'], sign=True)} about the specification, by the rule: "
        f"{rule_in_words(found)}. Of other quantities no tolerance is stated."
    )
    return [sentence]


def repairs(report: Report) -> list[Row]:
    """One row for each repair: channel, what was done, to how many samples, and the figures."""
    return [
        {key: row.get(key, NO_NUMBER) for key in ("channel", "what", "samples", "detail")}
        for row in report.get("repairs") or ()
    ]


def inputs(document: Report) -> list[Row]:
    """One row for each file that a document rests on, and one for the rig file's text, with their whole digests."""
    provenance = document["provenance"]
    rig = provenance.get("rig")
    sealed = [
        {"file": f"seal of {one['file']}", "source": "what the file says of itself", "sha256": one["seal"]}
        for one in provenance.get("inputs") or ()
        if one.get("seal")
    ]
    texts = (
        [] if rig is None else [{"file": f"rig {rig['name']}", "source": "rig file's text", "sha256": rig["sha256"]}]
    )
    return [
        {
            "file": entry.get("file", NO_NUMBER),
            "source": entry.get("source") or "",
            "size": str(entry["size"]) if entry.get("size") else "",
            "sha256": str(entry.get("sha256") or NO_NUMBER),
        }
        for entry in (*(provenance.get("inputs") or ()), *sealed, *texts)
    ]


def channels(document: Report) -> list[Row]:
    """One row for each channel: its sensor with its certificate, its chain and its clock."""
    return [
        {
            "channel": one["channel"],
            "role": one["role"] or "",
            "sensor": " ".join(text for text in (one["model"], one["serial"]) if text) or NO_NUMBER,
            "certificate": one["certificate"] or "",
            "calibrated": one["calibrated"] or NO_NUMBER,
            "due": one["due"] or NO_NUMBER,
            "range": "" if one["range"] is None else _range(one["range"], one["unit"]),
            "u": NO_NUMBER if one["u"] is None else f"{significant(100 * one['u'], 2)} %",
            "chain": "; ".join(_part(key, value) for key, value in (one["chain"] | one["known_by"]).items()),
            "clock": one["clock"],
        }
        for one in document.get("channels") or ()
    ]


def _range(ends: Sequence[float], unit: str) -> str:
    return f"{plain(ends[0])} to {plain(ends[1])} {unit}"


def _part(key: str, value: Any) -> str:
    """Word a key of a sensor's chain as the rig file has it."""
    if isinstance(value, Mapping):
        return f"{key} ({', '.join(_part(name, one) for name, one in value.items())})"
    return f"{key} {_cell(value)}"


def constants(document: Report) -> list[Row]:
    """One row for each constant of the mechanism with its uncertainty."""
    return [
        {
            "symbol": one["symbol"],
            "value": plain(one["value"]),
            "u": "exact" if not one["u"] else significant(one["u"], 2),
            "meaning": one["meaning"],
        }
        for one in document.get("constants") or ()
    ]


def correlations(document: Report) -> list[Row]:
    """One row for each pair of estimated quantities that hang together."""
    return [
        {"one": one["one"], "other": one["other"], "r": signed(fixed(one["r"], 2))}
        for one in document.get("correlations") or ()
    ]


def conformity(document: Report) -> Row:
    """Word the conformity with the tolerance: its one word, that with its rule, and what both rest on."""
    found = document.get("conformity") or UNSTATED
    word = found["word"].upper()
    if found["probability"] is None:
        why = found.get("why") or NO_UNCERTAINTY
        said = f"Conformity {word}: {why}." if found["rule"] is not None else ""
        return {"word": word, "said": said, "words": f"{word}: {why}"}
    percent = percent_of(found["probability"])
    said = f"{word} {within(found['limits_kg'])} by {NAMED.get(found['rule'], 'probability')}: {percent} % probable."
    words = (
        f"probability of {percent} % that the true mass lies {within(found['limits_kg'])} (JCGM 106, u "
        f"{significant(found['u_kg'], 2)} kg); decision rule: {rule_in_words(found)}"
    )
    return {"word": word, "said": f"Conformity {said}", "words": words}


def within(limits: Sequence[float | None], *, sign: bool = False) -> str:
    """Word limits in kg, one of which may be none."""
    low, high = (None if one is None else signed(plain(one)) if sign else plain(one) for one in limits)
    if low is None or high is None:
        return f"above {low} kg" if high is None else f"below {high} kg"
    return f"within {low} kg to {high} kg"


def rule_in_words(found: Mapping[str, Any]) -> str:
    """Word the decision rule of a conformity, with its source."""
    rule = found["rule"]
    if rule == SIMPLE:
        return "simple acceptance (ILAC-G8): the measured value alone lies within the limits, or does not"
    if rule == GUARD_BAND:
        width = significant(found["guard_band_kg"], 2) if found.get("guard_band_kg") else ""
        band = f"w = U = {width} kg" if width else "w = U"
        return (
            f"guard band (ILAC-G8, {band}): it conforms where the value keeps w from each limit, does not where it "
            "lies further than w beyond one, and neither is shown between"
        )
    enough, other = (plain(round(100.0 * share, 9)) for share in (rule, 1.0 - rule))
    return f"a probability of {enough} % or more shows that it conforms, {other} % or less that it does not"


def percent_of(share: float) -> str:
    """Write a probability in percent: none is ever 0 or 100."""
    percent = 100.0 * share
    if 0.05 <= percent < 99.95:
        return fixed(percent, 1)
    return "less than 0.1" if percent < 50.0 else "more than 99.9"


def _limits(interval: Sequence[float | None] | None) -> tuple[float, float] | None:
    """Take an interval if both its limits are numbers."""
    if interval is None:
        return None
    low, high = interval
    return None if low is None or high is None or not math.isfinite(high - low) else (low, high)


def _half(interval: tuple[float, float] | None) -> float | None:
    return None if interval is None else (interval[1] - interval[0]) / 2


def _spread(value: float, interval: tuple[float, float] | None, half_text: str) -> str | None:
    """± and half the interval, or both distances where the value does not stand in its middle."""
    if interval is None:
        return None
    half = (interval[1] - interval[0]) / 2
    up, down = interval[1] - value, value - interval[0]
    if abs(up - down) <= 0.2 * half:
        return f"± {half_text}"
    return f"+{rounded(up, half)[0]} {MINUS}{rounded(down, half)[0]}"


def _interval(interval: tuple[float, float] | None, unit: str) -> str | None:
    if interval is None:
        return None
    low, high = (rounded(limit, _half(interval))[0] for limit in interval)
    return f"{low} {unit} to {high} {unit}"


def _off(mass: Mapping[str, Any]) -> str | None:
    """Word the deviation from the specification, as deep as the mass is known; None where one of them is missing."""
    value, specification = mass.get("value"), mass.get("specification")
    if value is None or specification is None or not math.isfinite(value):
        return None
    return f"{signed(rounded(value - specification, mass.get('u'))[0])} {mass.get('unit', 'kg')}"


def _known(value: float | None) -> str | None:
    return None if value is None else plain(value)


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value
