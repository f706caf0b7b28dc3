"""Output of the commands that identify: masses, targets, reports beside one another, and a mass beside the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_daq.terminal.console import output_console
from recoil_daq.terminal.overview import mass_cells, print_shots, verdict_cell
from recoil_daq.terminal.tables import fixed, print_outcome, print_table, print_verdict, say, say_once
from recoil_rigs.tables.specification import mass_decimals

if TYPE_CHECKING:
    from recoil_identification.report.content.result_table import ResultTable


def print_masses(reports: Sequence[Mapping[str, Any]]) -> None:
    """Print the masses of several shots, a row each, with how far each is to be trusted; nothing for one shot.

    Parameters
    ----------
    reports
        Contents of the shots' ``report.json``.
    """
    from recoil_rigs.tables.calibration_day import calibrations_in_words

    if len(reports) < 2:
        return
    rows = [
        {
            "shot": d["shot"],
            **mass_cells(d["mass"]["value"], d["mass"]["U95"], d["E_n"]),
            "verdict": verdict_cell(d["valid"], deviates=bool(d.get("deviation"))),
            "reason": calibrations_in_words(d) if d["valid"] else d["reasons"][0],
        }
        for d in reports
    ]
    print_shots(f"Masses of {len(reports)} shots", rows)


def print_targets(targets: Sequence[Mapping[str, Any]]) -> None:
    """Print the first quantity of each target of several shots, a row each; nothing for one shot.

    Parameters
    ----------
    targets
        Contents of the documents of the targets.
    """
    from recoil_identification.report.content.tables import quantities

    if len({one["shot"] for one in targets}) < 2:
        return
    rows = []
    for one in targets:
        first = next(iter(quantities(one)), {})
        rows.append(
            {
                "shot": one["shot"],
                "target": one["target"],
                "quantity": first.get("name", ""),
                "value": f"{first['value']} {first['unit']}" if first else "",
                "u": first.get("u", ""),
                "verdict": verdict_cell(one["valid"]),
                "reason": next(iter(one["reasons"]), ""),
            }
        )
    print_shots(f"Targets of {len({one['shot'] for one in targets})} shots", rows)


def print_together(document: Mapping[str, Any]) -> None:
    """Print what several shots say together: their masses, whether they repeat, and which files were set aside.

    Parameters
    ----------
    document
        Document of ``identify --json``.
    """
    print_masses(document["reports"])
    print_targets(document["targets"])
    for one in document["repeatability"]:
        say(f"repeatability on rig {one['rig']}: {one['verdict']}, {one['detail']}")
    for one in document["set_aside"]:
        say(f"set aside: {one['file']}: {one['detail']}; name the file itself to identify it all the same")


SHORT = ("breech_pressure_pa", "recoil_velocity_m_s", "recoil_travel_m", "impulse_n_s")
"""Quantities that a terminal says unasked."""


def print_mass(document: Mapping[str, Any], folder: Path) -> None:
    """Print the six lines of a shot: its mass, what its uncertainty consists of, its peaks, and its verdict.

    Parameters
    ----------
    document
        Contents of ``report.json``.
    folder
        Folder that holds the report's page.
    """
    from recoil_identification.report.content.sentences import by_groups
    from recoil_identification.report.content.tables import expanded_kg, peaks

    d, places = document, mass_decimals(document["mass"]["u"])
    added_kg = (d.get("shot_log") or {}).get("added_mass_kg") or 0.0
    added = f", {abs(added_kg):g} kg {'added' if added_kg > 0 else 'taken off'}" if added_kg else ""
    mass, e_n = d["mass"], d["E_n"]
    off_kg = None if mass["value"] is None else mass["value"] - mass["specification"]
    agrees = "" if e_n is None else ": they agree" if abs(e_n) <= 1.0 else ": they do not agree"
    far = "" if off_kg is None else f"{fixed(abs(off_kg), places)} kg {'below' if off_kg < 0.0 else 'above'} "
    say(
        f"Shot {d['shot']} on rig {d['rig']}: {fixed(mass['value'], places)} ± {fixed(expanded_kg(mass), places)} kg "
        f"(95 %), {far}the specification of {mass['specification']:g} kg{added}{agrees}"
    )
    if parts := by_groups(d):
        say(parts.partition(";")[0])
    if said := [f"{label} {text}" for label, text in peaks(d, only=SHORT)]:
        say(", ".join(said))
    taken = sum(len(one) > 0 for one in d.get("assumptions") or ())
    found = (len(d["reasons"]) - 1, "more reason"), (len(d["notes"]), "note"), (taken, "assumption")
    more = [f"{number} {what}{'' if number == 1 else 's'}" for number, what in found if number > 0]
    if more:
        say(f"{', '.join(more)}: in the report, and here with --verbose")
    print_conformity(d)
    print_verdict(d, folder / "report.html")


def print_report(document: Mapping[str, Any], folder: Path | None, told: set[str] | None = None) -> None:
    """Print one shot's mass, its methods, and what speaks against it.

    Parameters
    ----------
    document
        Contents of ``report.json``.
    folder
        Folder that holds the report's page; None where nothing was written.
    told
        Notes on methods, and what is alike in all reports, that were printed for other shots: they are not printed
        again, and those printed now are added.
    """
    from recoil_identification.estimate.rounding import percentage
    from recoil_identification.report.content.sentences import by_groups
    from recoil_identification.report.content.tables import expanded_kg, logged, peaks

    d = document
    notes = {m["name"]: m["note"] for m in d["methods"] if told is None or m["note"] not in told}
    if told is not None:
        told |= set(notes.values())
    how = any(notes.values())
    columns = ("method", "mass, kg", "u, kg", "deviation, %", "RPE, %", "identified, %", "how")
    print_table(
        f"Shot {d['shot']} on rig {d['rig']}: specification {_specification(d)}",
        columns if how else columns[:-1],
        [
            (
                f"{m['name']} *" if m["name"] == d["mass"]["method"] else m["name"],
                fixed(m["mass_kg"], mass_decimals(m["u_kg"])),
                fixed(m["u_kg"], mass_decimals(m["u_kg"])),
                fixed(m["deviation_percent"], 2, sign=True),
                percentage(m["rpe_percent"], fixed(m["rpe_percent"], 2)),
                fixed(m["identified_share"], 0, scale=100.0),
                *([notes.get(m["name"], "")] if how else []),
            )
            for m in d["methods"]
        ],
        numeric=(1, 2, 3, 4, 5),
    )
    if in_the_log := logged(d):
        say("; ".join(f"{label}: {text}" for label, text in in_the_log))
    rpe, places = d["rpe_percent"], mass_decimals(d["mass"]["u"])
    low, high = (fixed(limit, places) for limit in d["mass"]["U95"])
    error, *limits = (percentage(one, fixed(one, 2)) for one in (rpe["value"], *(rpe["U95"] or ())))
    say(
        f"mass {fixed(d['mass']['value'], places)} kg, U {fixed(expanded_kg(d['mass']), places)} kg (k = "
        f"{fixed(d['uncertainty']['coverage_factor'], 2)}), 95 % interval [{low}, {high}] kg, "
        f"E_n {fixed(d['E_n'], 2, sign=True)}"
        + (
            ", no RPE: there is no mass over time by this method"
            if rpe["value"] is None
            else f", RPE {error} % [{', '.join(limits)}]"
        )
    )
    print_conformity(d)
    if "measurand" in d:
        say_once((f"it is {d['measurand']}",), told)
    if parts := by_groups(d):
        say(parts)
    say("; ".join(f"{label}: {text}" for label, text in peaks(d)))
    if d["constancy"] is not None:
        say(d["constancy"]["detail"])
    if rpe["value"] is not None:
        say_once((rpe["meaning"],), told)
    say(low_passes(d))
    print_outcome(d, None if folder is None else folder / "report.html", told)


def print_conformity(document: Mapping[str, Any]) -> None:
    """Print the one word of the conformity and its rule, where a tolerance is stated."""
    from recoil_identification.report.content.tables import conformity

    if said := conformity(document)["said"]:
        say(said)


def _specification(document: Mapping[str, Any]) -> str:
    """Say the specification, and of what it consists where that is more than one mass."""
    from recoil_identification.report.content.sentences import specified

    of, whole = specified(document), f"{document['mass']['specification']:g} kg"
    return f"{whole}, {of}" if of is not None and " + " in of else whole


def low_passes(document: Mapping[str, Any]) -> str:
    """Say which low-pass the mass of a report has passed, and which its mass over time, RPE and peaks."""
    from recoil_identification.calibration.methods import AS_RECORDED

    said, method = document["filter"], document["mass"]["method"]
    basis = {"given": "as asked for", "shot": "by this shot's spectra", "campaign": "by the spectra of all shots"}
    why, allowed_hz = basis.get(said["basis"], said["reason"]), said.get("spectra_hz")
    if said["basis"] in ("shot", "campaign") and allowed_hz is not None and said["cutoff_hz"] < allowed_hz:
        why = f"a fifth of the rate of its slowest force ({allowed_hz:.4g} Hz {why})"
    kind = said.get("description", {}).get("kind")
    low_pass = "low-pass" if kind is None else f"{kind} low-pass"
    whole, mass_hz = f"{said['cutoff_hz']:.4g} Hz, {why}", said["mass_cutoff_hz"]
    if method in AS_RECORDED or mass_hz is None:
        return f"{low_pass}: the mass is of what was recorded, without one; what is shown over time, peaks: {whole}"
    if mass_hz == said["cutoff_hz"]:
        return f"{low_pass} of the mass, of what is shown over time, RPE and peaks: {whole}"
    shared = document["provenance"]["parameters"]["options"].get("mass_cutoff_hz") is not None
    band = "the force's band, one for all shots" if shared else "this force's own band"
    return f"{low_pass} of the mass: {mass_hz:.4g} Hz, {band}; of the mass over time, RPE and peaks: {whole}"


def print_results(title: str, table: ResultTable, document: Mapping[str, Any], *said: str, **headings: str) -> None:
    """Print results in a row, and what is said of them; without the last column where nothing stands in it.

    Parameters
    ----------
    said
        Lines below the table.
    headings
        Headings of columns by their keys, where the document has others than the table.
    """
    rows = table.worded(document)
    *columns, last = (one for one in table.columns if one.printed is not None)
    columns += [last] if any(row[last.key] for row in rows) else []
    print_table(
        title,
        [headings.get(one.key, one.printed_heading) for one in columns],
        [[row[one.key] for one in columns] for row in rows],
        numeric=[place for place, one in enumerate(columns) if one.kind == "number"],
    )
    for line in said:
        say(line)


def print_target(document: Mapping[str, Any], folder: Path) -> None:
    """Print a target's quantities with their intervals, and what speaks against them.

    Parameters
    ----------
    document
        Contents of ``<target>.json``.
    folder
        Folder that holds the target's page.
    """
    from recoil_identification.report.content.tables import quantities

    d = document
    print_table(
        f"Shot {d['shot']} on rig {d['rig']}: {d['title']}",
        ("quantity", "value", "u", "95 % interval", "unit", "declared", "how"),
        [
            (row["name"], row["value"], row["u"], row["interval"], row["unit"], row["expected"], row["basis"])
            for row in quantities(d)
        ],
        numeric=(1, 2, 3, 5),
    )
    print_outcome(d, folder / f"{d['target']}.html")


def print_beside(document: Mapping[str, Any]) -> None:
    """Print what differs between reports that are laid beside one another, and where their page is.

    Parameters
    ----------
    document
        One of the list ``beside`` that ``identify --beside --json`` prints.
    """
    names = [one["name"] for one in document["reports"]]
    listed = [row for key in ("results", "parameters") for row in document[key]]
    rows = [(row["label"], *row["texts"]) for row in listed if row["differs"]]
    say(document["of"])
    print_table("What differs", ("", *names), rows, fold=True)
    say(f"beside one another -> {document['page']}")


def print_index(document: Mapping[str, Any]) -> None:
    """Print a row a shot of an index, and where its page is.

    Parameters
    ----------
    document
        Document of ``index --json``.
    """
    from recoil_identification.report.results.shot_index import conformity, deviates, first_reason, summary

    rows = [
        {
            "shot": one["shot"],
            "fired": (one["started"] or "")[:19].replace("T", " "),
            "state": one["state"] or "",
            "warnings": "" if one["warnings"] is None else str(one["warnings"]),
            **(
                {}
                if one["mass_kg"] is None
                else mass_cells(one["mass_kg"], (one["U95_low_kg"], one["U95_high_kg"]), one["E_n"])
            ),
            "verdict": verdict_cell(one["valid"], deviates=deviates(one), conformity=conformity(one)),
            "reason": first_reason(one),
        }
        for one in document["shots"]
    ]
    print_shots("Index of shots", rows)
    say(f"{summary(document)} -> {document['page']}")


def print_truth(document: Mapping[str, Any]) -> None:
    """Print how far the masses of a virtual shot are from the truth.

    Parameters
    ----------
    document
        Contents of the shot's ``report.json``.
    """
    truth, places = document["truth"], mass_decimals(document["mass"]["u"])
    paper = next(m for m in document["methods"] if m["name"] == "paper")
    against = 100 * (paper["mass_kg"] / truth["mass_kg"] - 1)
    output_console().print(
        f"truth {truth['mass_kg']:.{places}f} kg: this report is off by {truth['error_percent']:+.2f} %, "
        f"the published method by {against:+.2f} %",
        markup=False,
    )
