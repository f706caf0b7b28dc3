"""Sentences of a report's page: the verdict, the assumptions, the interval, the conditioning of the signals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from recoil_acquisition.measured import joined, measured, worded
from recoil_identification.calibration.methods import AS_RECORDED
from recoil_identification.estimate.budget import MOST_DEGREES_OF_FREEDOM
from recoil_identification.estimate.monte_carlo import IntervalBy
from recoil_identification.estimate.rounding import fixed, plain, signed, significant
from recoil_processing.shot.error_source import SourceGroup
from recoil_rigs.shots.assumptions import assumption_lines
from recoil_rigs.tables.calibration_day import calibrations_in_short
from recoil_rigs.tables.specification import mass_decimals

Report = Mapping[str, Any]


HIDDEN = (
    "How far each of these may read high or low before its own test in this shot (normalised residual beyond 3.29) "
    "names it in four shots of five, and what that does to the mass; what sensors share stands first. Where any error "
    "passes, only other knowledge tells: a calibration against another standard, or shots with a weighed mass added."
)
"""Over the table of errors that a shot may not tell."""


GROUPS = {
    SourceGroup.SENSORS: "sensors",
    SourceGroup.UNREAD_FORCES: "forces that no gauge reads",
    SourceGroup.MOTION_NOISE: "noise of the motion",
    SourceGroup.GEOMETRY: "lengths, areas and masses as stated",
}
"""Group of sources -> its name for people."""


def by_groups(document: Report) -> str | None:
    """Say what the standard uncertainty of a shot's or a campaign's mass consists of; None where it has no groups.

    A group's part is the root sum of squares of its rows in the budget, in percent of the mass as u is.
    """
    mass, parts = document["mass"], dict[str, float]()
    for row in document.get("budget") or ():
        if row.get("group") is not None and row.get("u_kg") is not None:
            parts[row["group"]] = math.hypot(parts.get(row["group"], 0.0), row["u_kg"])
    if not mass.get("value") or mass.get("u") is None or not any(parts.values()):
        return None

    def percent(kg: float) -> str:
        return f"{fixed(100 * kg / mass['value'], 2)} %"

    listed = sorted(parts.items(), key=lambda part: -part[1])
    said = f"u {percent(mass['u'])}: " + ", ".join(f"{GROUPS[SourceGroup(name)]} {percent(kg)}" for name, kg in listed)
    all_read = mass.get("u_all_read")
    return (
        said if all_read is None else f"{said}; {percent(all_read)} if gauges and friction read all of the resistance"
    )


def specified(document: Report) -> str | None:
    """Say of which masses the specification of a shot's or a campaign's mass consists; None where nothing states it."""
    of = document["mass"].get("specification_of")
    if not of:
        return None
    parts = [f"m3 {_stated(of, 'm3_kg')}"]
    if of["added_mass_kg"]:
        parts.append(f"{_stated(of, 'added_mass_kg')} added")
    if of["carried_mass_kg"] or of["u_carried_mass_kg"]:
        parts.append(f"{_stated(of, 'carried_mass_kg')} of oil and rods that go along")
    return " + ".join(parts)


def _stated(of: Mapping[str, float], key: str) -> str:
    u = of[f"u_{key}"]
    return f"{plain(of[key])} kg" + (f" (u {significant(u, 2)} kg)" if u else "")


def in_words(report: Report) -> str:
    """Say the verdict in a sentence; the reasons and the deviation stand below it."""
    mass = report["mass"]
    reasons, outside = len(report.get("reasons") or ()), calibrations_in_short(report)
    if not report["valid"]:
        against = "one reason speaks" if reasons == 1 else f"{reasons} reasons speak" if reasons else "something speaks"
        return f"Not to be relied on: {against} against this mass."
    specification = mass.get("specification")
    e_n = report.get("E_n")
    so_far = "Nothing speaks against this mass" if not outside else f"Valid, but {outside}"
    if specification is None or e_n is None:
        return f"{so_far}."
    how = "agrees with" if abs(e_n) <= 1.0 else "deviates from"
    specified = f"{plain(specification)} {mass.get('unit', 'kg')}"
    return f"{so_far}; it {how} the specification of {specified}."


def assumed(report: Report) -> str | None:
    """Say in one line what is taken for granted; None if it is nothing."""
    return joined("; ", assumption_lines(report.get("assumptions") or ())) or None


_INTERVALS = {
    IntervalBy.GUM: "The interval is the mass and k standard uncertainties (GUM)",
    IntervalBy.LOGARITHM: "The interval is that of the logarithm of the mass, the unknown of the fit, and k standard "
    "uncertainties of it (GUM)",
    IntervalBy.MONTE_CARLO: "The interval is that of the draws below",
}
_VALIDATED = ", so that the GUM is validated (8.1)"
_INSTEAD = ": the draws' interval is reported in its place (8.2)"


def effective(freedom: float | None) -> str:
    """Word degrees of freedom that are put together: null in a document are infinitely many."""
    return "infinitely many" if freedom is None or freedom > MOST_DEGREES_OF_FREEDOM else fixed(freedom, 0)


def coverage(report: Report) -> list[str]:
    """Say in sentences how the interval comes about, and how a Monte Carlo method compares with it."""
    stated = report.get("uncertainty") or {}
    if not stated:
        return []
    known = effective(stated.get("degrees_of_freedom"))
    factor, expanded = fixed(stated["coverage_factor"], 3), significant(stated["U_kg"], 2)
    by, drawn = stated.get("interval_by", IntervalBy.GUM), stated.get("monte_carlo")
    interval = f"{_INTERVALS[by]}, U95 = {expanded} kg = {factor} u, half its width, for {known}"
    places = mass_decimals(report["mass"].get("u"))
    sentences = [f"{interval} effective degrees of freedom (Welch-Satterthwaite)."]
    if drawn:
        low, high = (fixed(limit, places) for limit in drawn["interval_kg"])
        below, above = (signed(fixed(d, places)) for d in drawn["difference_kg"])
        sentences.append(
            f"Monte Carlo method (JCGM 101), {drawn['draws']} draws, seed {drawn['seed']}: mean "
            f"{fixed(drawn['mean_kg'], places)} kg, u {significant(drawn['u_kg'], 3)} kg, 95 % interval {low} kg to "
            f"{high} kg; the ends of the GUM's interval differ from it by {below} kg and {above} kg, "
            f"{'within' if drawn['agrees'] else 'beyond'} the numerical tolerance of {plain(drawn['tolerance_kg'])} kg"
            f"{' and the scatter of the draws' if drawn['converged'] else ', which the draws have not reached'}"
            f"{_VALIDATED if drawn['agrees'] else _INSTEAD if by == IntervalBy.MONTE_CARLO else ''}."
        )
    if stated.get("frisch_bracket_kg"):
        low, high = (fixed(limit, places) for limit in stated["frisch_bracket_kg"])
        recorded = report["mass"].get("method") in AS_RECORDED
        sides = "both as recorded" if recorded else "both filtered and without what the method takes off them"
        sentences.append(
            f"Frisch's bracket, force on acceleration and acceleration on force, {sides}: {low} kg to {high} kg; its "
            "width is what noise in both can do to a regression of one on the other."
        )
    for key in ("endogeneity", "constancy", "breech_chain"):
        detail = (report.get(key) or {}).get("detail")
        if detail and (key != "breech_chain" or report[key]["suspected"]):
            sentences.append(f"{detail[:1].upper()}{detail[1:].rstrip('.')}.")
    return sentences


def conditioning(report: Report) -> list[str]:
    """Say in sentences what was done to the signals: the filter, a shift of the zero, what was repaired."""
    said, shift = report.get("filter") or {}, report.get("zero_shift") or {}
    sentences = []
    if said.get("cutoff_hz") is not None:
        basis = {"given": "as asked for", "shot": "chosen from this shot's spectra",
                 "campaign": "chosen from the spectra of all shots together", "default": "a fixed one"}  # fmt: skip
        kind, order = said.get("description", {}).get("kind", "Butterworth"), said.get("half_order", 4)
        of_order = "" if order is None else f" of order {2 * order}"
        if report["mass"].get("method") == "camera":
            sentences.append("The mass is that of displacement and forces as recorded; no filter is in it.")
        sentences.append(
            f"Both sides of the equation of motion pass one zero-phase {kind} low-pass{of_order}, "
            f"-3 dB at {plain(float(significant(said['cutoff_hz'], 3)))} Hz, {basis.get(str(said.get('basis')), '')}: "
            f"{said.get('reason', '')}."
        )
    narrow = said.get("mass_cutoff_hz")
    if narrow is not None and narrow < said.get("cutoff_hz", 0.0):
        sentences.append(
            f"The mass is fitted below {plain(float(significant(narrow, 3)))} Hz, where the force has 99 % of its "
            "energy; the mass over time and the figures have the whole band."
        )
    if shift.get("demanded"):
        witnesses = "force and camera" if shift.get("confirmed") else "the force alone"
        parts = list[str]()
        for key, how in (("step_m_s2", "that stays"), ("decaying_m_s2", "that decays")):
            if shift.get("u_" + key):
                size = measured(shift[key], "m/s²", lambda number: significant(number, 3))
                u = measured(shift["u_" + key], "m/s²", lambda number: significant(number, 2))
                parts.append(worded(size, " (u ", u, f") {how}"))
        zero = f"The accelerometer's zero shifted at the shot, as {witnesses} show: "
        sentences.append(worded(zero, joined(" and ", parts), "; taken off."))
    skew = report.get("skew") or {}
    if skew.get("corrected_s"):
        sentences.append(f"Among the recorder's channels {skew.get('reason', '')}.")
    return sentences
