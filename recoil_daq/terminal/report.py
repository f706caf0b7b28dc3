"""Output of the commands that identify: masses, targets, and a demonstration beside the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from recoil_daq.terminal.console import output_console
from recoil_daq.terminal.tables import fixed, print_outcome, print_table, say

if TYPE_CHECKING:
    from pathlib import Path

    from recoil_acquisition.errors import RecoilDaqError
    from recoil_acquisition.recorded_file import Double
    from recoil_daq.demo import Demonstration
    from recoil_daq.reports.identify import Reported
    from recoil_daq.reports.targets import TargetReported


def reports_document(
    reports: Sequence[Reported],
    targets: Sequence[TargetReported] = (),
    repeats: Mapping[str, tuple[str, str]] | None = None,
    aside: Mapping[Path, Double] | None = None,
    without_mass: Sequence[RecoilDaqError] = (),
) -> dict[str, Any]:
    """Build the document of ``identify --json``.

    Parameters
    ----------
    repeats
        The verdict on the repeatability by rig, and by kind of its shots where they are of several.
    aside
        Shot files that were not identified, and what they have of others.
    without_mass
        Why shots allow none.
    """
    return {
        "schema": "recoil-daq/identify/1",
        "reports": [{"folder": str(r.folder), **r.document} for r in reports],
        "targets": [{"folder": str(t.folder), **t.document} for t in targets],
        "repeatability": [
            {"rig": rig, "verdict": verdict, "detail": detail} for rig, (verdict, detail) in (repeats or {}).items()
        ],
        "set_aside": [
            {"file": str(path), "of": one.of, "files": list(one.files), "detail": str(one)}
            for path, one in (aside or {}).items()
        ],
        "failed": [{"file": str(error.path), "error": str(error)} for error in without_mass],
    }


def print_masses(reports: Sequence[Reported]) -> None:
    """Print the masses of several shots, a row each, with how far each is to be trusted; nothing for one shot."""
    if len(reports) < 2:
        return
    rows = []
    for one in reports:
        d = one.document
        low, high = d["mass"]["U95"]
        rows.append(
            (
                d["shot"], fixed(d["mass"]["value"], 2), fixed((high - low) / 2, 2), fixed(d["E_n"], 2, sign=True),
                _verdict(d), "" if d["valid"] else d["reasons"][0],
            )
        )  # fmt: skip
    columns = ("shot", "mass, kg", "U, kg", "E_n", "verdict", "first reason")
    print_table(f"Masses of {len(reports)} shots", columns, rows, numeric=(1, 2, 3))


def _verdict(document: Mapping[str, Any]) -> str:
    if not document["valid"]:
        return "NOT VALID"
    return "VALID, deviates" if document.get("deviation") else "VALID"


def print_repeatability(repeats: Mapping[str, tuple[str, str]]) -> None:
    """Print whether the shots of each rig repeat; nothing where there was one shot only."""
    for rig, (verdict, detail) in repeats.items():
        say(f"repeatability on rig {rig}: {verdict}, {detail}")


def print_set_aside(aside: Mapping[Path, Double]) -> None:
    """Print which shot files of folders were not identified, and why."""
    for path, double in aside.items():
        say(f"set aside: {path}: {double}; name the file itself to identify it all the same")


def print_report(report: Reported, told: set[str] | None = None) -> None:
    """Print one shot's mass, its methods, and what speaks against it.

    Parameters
    ----------
    told
        What was said of methods before, of other shots: it is not said again, and what is said now is added.
    """
    from recoil_identification.report.tables import logged

    d = report.document
    notes = {m["name"]: m["note"] for m in d["methods"] if told is None or m["note"] not in told}
    if told is not None:
        told |= set(notes.values())
    how = any(notes.values())
    columns = ("method", "mass, kg", "u, kg", "deviation, %", "RPE, %", "identified, %", "how")
    print_table(
        f"Shot {d['shot']} on rig {d['rig']}: specification {d['mass']['specification']:g} kg",
        columns if how else columns[:-1],
        [
            (
                f"{m['name']} *" if m["name"] == d["mass"]["method"] else m["name"],
                fixed(m["mass_kg"], 2),
                fixed(m["u_kg"], 2),
                fixed(m["deviation_percent"], 2, sign=True),
                fixed(m["rpe_percent"], 2),
                fixed(m["identified_share"], 0, scale=100.0),
                *([notes.get(m["name"], "")] if how else []),
            )
            for m in d["methods"]
        ],
        numeric=(1, 2, 3, 4, 5),
    )
    if in_the_log := logged(d):
        say("; ".join(f"{label}: {text}" for label, text in in_the_log))
    low, high = d["mass"]["U95"]
    rpe = d["rpe_percent"]
    say(
        f"mass {fixed(d['mass']['value'], 2)} kg, 95 % interval [{fixed(low, 2)}, {fixed(high, 2)}] kg, "
        f"E_n {fixed(d['E_n'], 2, sign=True)}"
        + (
            ", no RPE: there is no mass over time by this method"
            if rpe["value"] is None
            else f", RPE {fixed(rpe['value'], 2)} % [{fixed(rpe['U95'][0], 2)}, {fixed(rpe['U95'][1], 2)}]"
        )
    )
    if rpe["value"] is not None:
        say(rpe["meaning"])
    say(low_passes(d))
    print_outcome(d, report.folder / "report.html")


def low_passes(document: Mapping[str, Any]) -> str:
    """Say which low-pass the mass of a report has passed, and which its mass over time, RPE and peaks."""
    from recoil_identification.calibration.methods import AS_RECORDED

    said, method = document["filter"], document["mass"]["method"]
    basis = {"given": "as asked for", "shot": "by this shot's spectra", "campaign": "by the spectra of all shots"}
    why, allowed_hz = basis.get(said["basis"], said["reason"]), said.get("spectra_hz")
    if said["basis"] in ("shot", "campaign") and allowed_hz is not None and said["cutoff_hz"] < allowed_hz:
        why = f"a fifth of the rate of its slowest force ({allowed_hz:.4g} Hz {why})"
    whole, mass_hz = f"{said['cutoff_hz']:.4g} Hz, {why}", said["mass_cutoff_hz"]
    if method in AS_RECORDED or mass_hz is None:
        return f"low-pass: the mass is of what was recorded, without one; what is shown over time, peaks: {whole}"
    if mass_hz == said["cutoff_hz"]:
        return f"low-pass of the mass, of what is shown over time, RPE and peaks: {whole}"
    shared = document["provenance"]["parameters"]["options"].get("mass_cutoff_hz") is not None
    band = "the force's band, one for all shots" if shared else "this force's own band"
    return f"low-pass of the mass: {mass_hz:.4g} Hz, {band}; of the mass over time, RPE and peaks: {whole}"


def print_target(one: TargetReported) -> None:
    """Print a target's quantities with their intervals, and what speaks against them."""
    from recoil_identification.report.tables import quantities

    d = one.document
    print_table(
        f"Shot {d['shot']} on rig {d['rig']}: {d['title']}",
        ("quantity", "value", "u", "95 % interval", "unit", "declared", "how"),
        [
            (row["name"], row["value"], row["u"], row["interval"], row["unit"], row["expected"], row["basis"])
            for row in quantities(d)
        ],
        numeric=(1, 2, 3, 5),
    )
    print_outcome(d, one.folder / f"{d['target']}.html")


def demo_document(done: Demonstration) -> dict[str, Any]:
    """Build the document of ``demo --json``."""
    return {
        "schema": "recoil-daq/demo/1",
        "usable": done.ingested.shot.usable,
        "state": done.ingested.shot.state.value,
        "shot_file": str(done.ingested.path),
        "truth": dict(done.simulated.truth),
        "folder": str(done.report.folder),
        "report": done.report.document,
    }


def print_demo(done: Demonstration) -> None:
    """Print the verdict on the shot, the methods, and the mass beside the truth."""
    done.ingested.show()
    done.report.show()
    truth = done.report.document["truth"]
    paper = next(m for m in done.report.document["methods"] if m["name"] == "paper")
    against = 100 * (paper["mass_kg"] / truth["mass_kg"] - 1)
    output_console().print(
        f"truth {truth['mass_kg']:.2f} kg: this report is off by {truth['error_percent']:+.2f} %, "
        f"the published method by {against:+.2f} %",
        markup=False,
    )
