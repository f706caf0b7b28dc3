"""The machine-readable answer of a campaign: ``campaign.json`` and ``campaign.csv``."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from recoil_acquisition.remark import Caution, Note, NoteCode, findings_of
from recoil_acquisition.shot.quality_check import Check
from recoil_identification.campaign.agreement import Agreement, Misfit
from recoil_identification.campaign.campaign import Campaign, Estimated, Learnt, UnreadForce, Used
from recoil_identification.campaign.charted import Charted, ChartSignal
from recoil_identification.campaign.charts import RULE_SET, Trend
from recoil_identification.campaign.constancy import SharedConstancy
from recoil_identification.campaign.gauge_scales import GaugeScale
from recoil_identification.campaign.peaks import PeakOfShots
from recoil_identification.campaign.signal_kind import SignalKind
from recoil_identification.campaign.suspects import SharedSuspicion
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.estimate.conformity import stated_conformity
from recoil_identification.estimate.mass import MEASURAND_OF_SHOTS
from recoil_identification.report.document.document import outputs_of
from recoil_identification.report.document.report_files import (
    DRAWN,
    budget_rows,
    computer,
    json_bytes,
    sealed,
    stated,
    to_json,
)
from recoil_identification.report.document.spreadsheet import csv_text
from recoil_identification.rows.unread_resistance import FORCE
from recoil_identification.shot.peaks import LABELS, UNITS
from recoil_rigs.tables.issue import NOTHING_STATED, Issue

SCHEMA = "recoil-daq/campaign/1"
CAMPAIGN_FILE = "campaign.json"
TABLE_FILE = "campaign.csv"
LARGEST_ANSWER = 64_000_000
"""Bytes of a campaign.json, beyond which it is none."""
AGAINST = ("specification", "u_specification", "specification_of", "deviation_kg", "deviation_percent", "E_n")
"""Keys of the mass that compare it with the specification; E_n has k = 2."""


def campaign_document(
    campaign: Campaign,
    *,
    version: str,
    inputs: Sequence[Mapping[str, Any]],
    parameters: Mapping[str, Any],
    pages: Mapping[str, str] | None = None,
    issued: Issue = NOTHING_STATED,
    set_aside: Sequence[Mapping[str, Any]] = (),
    drawn: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Build the answer of a campaign, JSON types only.

    Parameters
    ----------
    version
        Version of the package.
    inputs
        File and digest of each report, and of the shot log.
    parameters
        Parameters with which the shots were identified.
    pages
        The page of each shot's report, relative to the answer's folder with slashes, by shot; of those that have one.
    issued
        Identity of the answer, and the tolerance of the mass without what was added.
    set_aside
        Shots that are not in it because they are made of the files of another one.
    drawn
        Forms in which its page is drawn, as those of
        `recoil_identification.report.document.document.report_document`.
    """
    mass, notes = campaign.mass, (*campaign.notes, *campaign.next_steps.notes, *_previewed(campaign))
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "rig": campaign.rig,
        "measurand": MEASURAND_OF_SHOTS,
        "mass": {
            **_mass(mass),
            "U_kg": mass.expanded_kg,
            "unit": "kg",
            **_against(campaign),
            "u_between_shots": campaign.u_between_shots_kg,
            "configuration": campaign.mechanisms[0].name,
        },
        "configurations": [
            {
                "name": one.name,
                "shots": list(one.shots),
                "mass": _mass(one.mass),
                "difference": None if one.difference is None else _mass(one.difference),
            }
            for one in campaign.mechanisms
        ],
        "shots": [_shot(one, (pages or {}).get(one.shot.name)) for one in campaign.shots],
        "common": [*map(_learnt, campaign.common), *_unread_force(campaign.unread_force)],
        "peaks": [_peak(one) for one in campaign.peaks],
        "gauges": [_gauge(one) for one in campaign.gauges],
        "constancy": _constancy(campaign.constancy),
        "breech_chain": _breech_chain(campaign.suspicion),
        "agreement": _agreement(campaign.agreement),
        "budget": budget_rows(
            campaign.budget, lambda row: f"sensor {row.source.detail}" if row.scope == "sensor" else row.scope
        ),
        "uncertainty": {
            "degrees_of_freedom": campaign.degrees_of_freedom,
            "coverage_factor": mass.coverage_factor,
            "U_kg": mass.expanded_kg,
        },
        "conformity": _conformity(campaign, issued),
        "issued": issued.to_json(),
        "channels": _channels(campaign),
        "constants": _constants(campaign),
        "repeatability": {
            "gain_rel": _scatter(campaign.gain_scatter),
            "friction_rel": _scatter(campaign.friction_scatter),
        },
        "signals": [
            {
                **stated(change, "kind", "influence", "shots", "size", "u", "unit", "normalised_residual"),
                "detail": str(change),
            }
            for change in campaign.changes
        ]
        + [_chart_signal(signal) for chart in campaign.charts for signal in chart.signals],
        "charts": {"rules": RULE_SET, "series": [_chart(one) for one in campaign.charts]},
        "assumptions": _assumptions(campaign),
        "next": [{"change": one.change, "u_kg": one.u_kg} for one in campaign.next_steps.lines],
        "valid": campaign.valid,
        "reasons": list(campaign.reasons),
        "notes": list(notes),
        "findings": findings_of(
            campaign.reasons,
            (change.remark() for change in campaign.changes),
            (signal.remark() for chart in campaign.charts for signal in chart.signals),
            _dated(campaign),
            notes,
        ),
        "set_aside": [dict(one) for one in set_aside],
        "provenance": {
            "version": version,
            "computer": computer(),
            "inputs": [dict(one) for one in inputs],
            "parameters": {**parameters, "cutoff_hz": campaign.cutoff_hz},
            **({} if drawn is None else {DRAWN: dict(drawn)}),
        },
    }
    written = to_json(document)
    outputs = outputs_of({TABLE_FILE: campaign_table(written)})
    return sealed({**written, "provenance": {**written["provenance"], "outputs": outputs}})


def with_history(document: Mapping[str, Any], history: Mapping[str, Any]) -> dict[str, Any]:
    """Return an answer with its history, sealed anew; that the campaigns differ is a note of it.

    Parameters
    ----------
    history
        Document of `recoil_identification.report.results.history.history_document`.
    """
    told = [Note(NoteCode.COMPARISON, str(document["rig"]), history["detail"])] if history["agrees"] is False else []
    notes, findings = [*document["notes"], *map(str, told)], [*document["findings"], *findings_of(told)]
    return sealed(to_json({**document, "history": history, "notes": notes, "findings": findings}))


def _conformity(campaign: Campaign, issued: Issue) -> dict[str, Any]:
    """State the conformity of the mass with its tolerance."""
    mass = campaign.mass
    return stated_conformity(
        issued, campaign.specification, mass.mass_kg, mass.u_kg, mass.degrees_of_freedom, valid=campaign.valid
    )


def _channels(campaign: Campaign) -> list[dict[str, Any]]:
    """List the chains of the channels of all shots, each once, with the shots that have it."""
    found: dict[str, tuple[Mapping[str, Any], list[str]]] = {}
    for used in campaign.shots:
        for one in used.shot.channels:
            found.setdefault(json.dumps(one, sort_keys=True), (one, []))[1].append(used.shot.name)
    return [{**one, "shots": shots} for one, shots in found.values()]


def _constants(campaign: Campaign) -> list[dict[str, Any]]:
    """List the constants of the shots' rigs, each once."""
    found = {json.dumps(one, sort_keys=True): dict(one) for used in campaign.shots for one in used.shot.constants}
    return list(found.values())


def _dated(campaign: Campaign) -> Iterator[Caution]:
    """Name the channels whose calibrations do not cover the day of a shot of the campaign, once each."""
    for one in _channels(campaign):
        fired = [used.shot for used in campaign.shots if used.shot.name in one["shots"] and not used.excluded]
        for day in filter(None, (shot.calibration_day for shot in fired)):
            if said := "; ".join(filter(None, day.faults(_date(one["calibrated"]), _date(one["due"])))):
                yield Caution(Check.CALIBRATION, one["channel"], f"{one['channel']}: {said}")
                break


def _previewed(campaign: Campaign) -> Iterator[Note]:
    """Name the shots that were found by what was read live of an instrument."""
    live: dict[str, list[str]] = {}
    for used in campaign.shots:
        for source in () if used.excluded else used.shot.previews:
            live.setdefault(source, []).append(used.shot.name)
    for source, shots in live.items():
        told = f"by a preview, what was read live of {source}, in shot {', '.join(shots)}: when the instrument's own "
        yield Note(Check.PREVIEW, source, told + "file has replaced it, the campaign is to be made anew")


def _date(text: str | None) -> dt.date | None:
    with suppress(ValueError):
        return None if text is None else dt.date.fromisoformat(text)
    return None


def campaign_table(document: Mapping[str, Any]) -> str:
    """Return the shots of a campaign as text that spreadsheets read, one row a shot."""
    columns = (
        "shot", "started", "configuration", "added_mass_kg", "mass_kg", "u_kg", "joint_mass_kg", "own_u_kg",
        "own_mass_kg",
    )  # fmt: skip
    peaks = list(dict.fromkeys(name for shot in document["shots"] for name in shot["peaks"]))
    rows = []
    for shot in document["shots"]:
        cells = [shot[name] for name in columns[:4]] + [shot["mass"]["value"], shot["mass"]["u"]]
        cells += [shot[name] for name in (*columns[6:], "normalised_residual", "excluded")]
        cells += [shot["valid"], "; ".join(shot["reasons"]), shot["use"]]
        rows.append([*cells, *(shot["peaks"].get(name) for name in peaks), *map(shot["peaks_u"].get, peaks)])
    further = ("normalised_residual", "excluded", "valid", "reasons", "use", *peaks, *(f"u_{name}" for name in peaks))
    return csv_text((*columns, *further), rows)


def write_campaign(folder: Path, document: Mapping[str, Any]) -> None:
    """Write ``campaign.json`` and ``campaign.csv`` into a folder."""
    (folder / CAMPAIGN_FILE).write_bytes(json_bytes(document))
    (folder / TABLE_FILE).write_text(campaign_table(document), encoding="utf-8", newline="\n")


def _mass(mass: Estimated) -> dict[str, Any]:
    return {"value": mass.mass_kg, "u": mass.u_kg, "U95": list(mass.interval_kg)}


def _against(campaign: Campaign) -> dict[str, Any]:
    """State the specification beside the mass, null where there is none, and the deviation from it."""
    specification, mass_kg = campaign.specification, campaign.mass.mass_kg
    if specification is None:
        return dict.fromkeys(AGAINST)
    kg, of, percent = specification.mass_kg, specification.to_json(), 100.0 * (mass_kg / specification.mass_kg - 1.0)
    stated_of = (kg, specification.u_kg, of, mass_kg - kg, percent, campaign.normalised_error)
    return dict(zip(AGAINST, stated_of, strict=True))


def _scatter(scatter: tuple[float, float, float]) -> dict[str, Any]:
    mean, low, high = scatter
    return {"value": mean, "U95": [low, high]}


def _chart_signal(signal: ChartSignal) -> dict[str, Any]:
    return {
        "kind": SignalKind.CHART,
        **stated(signal, "influence", "quantity", "rule", "shots", "size", "u", "unit"),
        "normalised_residual": None,
        "detail": str(signal),
    }


def _chart(one: Charted) -> dict[str, Any]:
    """Return a chart's numbers: those of a noise are natural logarithms of its SI values."""
    chart = one.individuals
    return {
        **stated(one, "influence", "quantity", "unit", "shots"),
        **stated(chart, "values", "centre", "sigma", "provisional"),
        "trend": _trend(one.trend),
    }


def _assumptions(campaign: Campaign) -> list[dict[str, Any]]:
    """List what the shots' reports take for granted, each once."""
    assumed = [one for used in campaign.shots for one in used.shot.assumptions]
    found = {(one["quantity"], one["taken"], one["detail"]): one for one in assumed}
    return [dict(one) for one in found.values()]


def _learnt(one: Learnt) -> dict[str, Any]:
    return {
        "influence": one.influence.source,
        "identity": one.influence.identity,
        "prior_u": one.influence.u,
        **stated(one, "value", "u"),
        "unit": one.influence.unit,
        "normalised_residual": one.normalised_residual,
    }


def _peak(one: PeakOfShots) -> dict[str, Any]:
    u, half = one.u, one.expanded
    return {
        "name": f"{LABELS[one.quantity]}, {one.kind}",
        **stated(one, "quantity", "kind", "shots"),
        "value": one.mean,
        "scatter": one.scatter,
        "u": u,
        "U95": None if half is None else [one.mean - half, one.mean + half],
        "degrees_of_freedom": None if u is None else one.degrees_of_freedom,
        "coverage_factor": None if u is None or half is None or not u else half / u,
        "unit": UNITS[one.quantity],
    }


def _gauge(one: GaugeScale) -> dict[str, Any]:
    return {
        **stated(one, "force", "sensors", "value", "u", "known_u"),
        "U95": [one.value - COVERAGE_FACTOR * one.u, one.value + COVERAGE_FACTOR * one.u],
        "beside": list(one.beside),
        "gauge": {"value": one.gauge, "u": one.u_gauge},
        "told": one.is_told,
    }


def _unread_force(force: UnreadForce | None) -> list[dict[str, Any]]:
    """State the size of the force that no gauge reads as what the shots share: its values are many, and none is one."""
    if force is None:
        return []
    return [
        {
            "influence": f"{FORCE}, share of the peak resistance",
            "identity": force.identity,
            "prior_u": force.stated,
            "value": None,
            "u": force.u,
            "unit": "1",
            "normalised_residual": None,
            "sizes": [
                {"size": size, "weight": weight} for size, weight in zip(force.sizes, force.weights, strict=True)
            ],
        }
    ]


def _constancy(test: SharedConstancy | None) -> dict[str, Any] | None:
    if test is None:
        return None
    return {
        **stated(test, "ln_bayes_factor", "constant", "could_hide_percent"),
        "drift": stated(test.drift, "size_percent", "u_percent"),
        "step": {**stated(test.step, "size_percent", "u_percent"), "at": test.step_at},
        "detail": str(test),
    }


def _breech_chain(found: SharedSuspicion | None) -> dict[str, Any] | None:
    if found is None:
        return None
    size, u_size = found.size
    return {
        **stated(found, "suspected", "source", "ln_bayes_factor"),
        "size": size,
        "u_size": u_size,
        "moves_percent": 100 * found.moves_rel,
        "spread_percent": 100 * found.spread_rel,
        "detail": str(found),
    }


def _agreement(found: Agreement) -> dict[str, Any]:
    return {
        "between": _misfit(found.between),
        "own": [{"shot": name, **_misfit(one), "factor": found.noisy.get(name, 1.0)} for name, one in found.own],
        "apart": [
            {"shot": one.shot, **_misfit(one.misfit), "mass_without": {"value": one.mass_kg, "u": one.u_kg}}
            for one in found.apart
        ],
        "factor": found.unexplained,
        "detail": str(found),
    }


def _misfit(one: Misfit) -> dict[str, Any]:
    return {"misfit": one.size, **stated(one, "degrees_of_freedom", "probability")}


def _shot(used: Used, page: str | None) -> dict[str, Any]:
    shot = used.shot
    return {
        "shot": shot.name,
        **stated(shot, "started", "configuration", "added_mass_kg", "u_added_mass_kg"),
        "mass": {"value": shot.mass_kg, "u": shot.u_kg},
        "joint_mass_kg": used.joint_kg,
        **stated(used, "own_mass_kg", "own_u_kg", "excluded", "normalised_residual"),
        "valid": shot.valid,
        "reasons": list(shot.reasons),
        "use": (shot.use or None) if used.excluded is None else None,
        "peaks": dict(shot.peaks),
        "peaks_u": dict(shot.peaks_u),
        "shot_log": dict(shot.log),
        "report": page,
        "calibration_day": None if shot.calibration_day is None else shot.calibration_day.to_json(),
    }


def _trend(trend: Trend | None) -> dict[str, Any] | None:
    """State a trend that is no chance."""
    if trend is None or not trend.fired:
        return None
    return {"change": trend.change, "u": trend.u, "p": trend.p_value}
