"""Reports laid beside one another: their curves over one another, and what differs in parameters and result."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.remark import Note, NoteCode, findings_of
from recoil_identification.estimate.rounding import MINUS, NO_NUMBER, fixed, plain, rounded, signed, significant
from recoil_identification.report.content.result_table import ResultHead
from recoil_identification.report.content.section import Column, Section
from recoil_identification.report.content.sentences import specified
from recoil_identification.report.content.tables import PEAKS
from recoil_identification.report.document.reproduction import ELSEWHERE
from recoil_identification.report.figure.campaign_figures import PANELS
from recoil_identification.report.figure.figure import Figure, HorizontalLine, Panel, Trace, with_interval
from recoil_identification.shot.firing_record import Curves

Row = dict[str, Any]
"""A number, or a word, in each of the reports: ``label``, ``differs``, ``values``, and as people read it ``texts``."""

SCHEMA = "recoil-daq/beside/1"
PEAK_LABELS = {name: (f"{label} / {unit}", scale) for name, label, scale, _, unit in PEAKS}
"""Labels and scales of peaks, as the head of a report has them."""


@dataclass(frozen=True, eq=False)
class Laid(ReadOnlyArrays):
    """One of several reports.

    Attributes
    ----------
    name
        Name of the report beside the others.
    document
        The contents of its ``report.json``.
    sha256
        SHA-256 of that file.
    trace : ndarray, shape (n, 3)
        Time on the reference clock in s, mass and its standard uncertainty in kg, NaN where nothing was identified;
        None where it has none.
    curves
        Curves of the shot; None where the report has none.
    page
        Way to the report's page from that of all; None where there is none.
    """

    name: str
    document: Mapping[str, Any]
    sha256: str
    trace: Array | None
    curves: Curves | None
    page: str | None = None


def beside_document(laid: Sequence[Laid], *, version: str) -> dict[str, Any]:
    """Build the document of reports beside one another, the first one's folder its home.

    Parameters
    ----------
    version
        Version of the package.
    """
    first, of = laid[0].document, of_what([one.document for one in laid])
    return {
        "schema": SCHEMA,
        "shot": first["shot"],
        "rig": first["rig"],
        "reports": [{"name": one.name, "shot": one.document["shot"], "page": one.page} for one in laid],
        "of": of,
        "findings": findings_of([Note(NoteCode.COMPARISON, str(first["shot"]), of)]),
        "parameters": parameters(laid),
        "results": results(laid),
        "provenance": {
            "version": version,
            "inputs": [{"file": f"{one.name}/report.json", "sha256": one.sha256} for one in laid],
            "parameters": {},
        },
    }


def head(document: Mapping[str, Any]) -> ResultHead:
    """Return the head of the page."""
    return ResultHead(
        f"{len(document['reports'])} reports beside one another", f"shot {document['shot']} on rig {document['rig']}",
        (document["of"],), embedded={"shot": f"{document['shot']}-beside"},
    )  # fmt: skip


def differing(document: Mapping[str, Any]) -> list[Section]:
    """Return what differs in the results and in the parameters, with what is equal folded: a column a report."""
    reports = (Column(str(n), one["name"], "file", page=one["page"]) for n, one in enumerate(document["reports"]))
    columns = (Column("label", "", "name"), *reports)

    def section(key: str, word: str) -> Section:
        rows = [
            {"label": row["label"], "folded": not row["differs"], **{str(n): one for n, one in enumerate(row["texts"])}}
            for row in document[key]
        ]
        said = [] if any(row["differs"] for row in document[key]) else ["Nothing differs."]
        return Section(
            key, f"What differs in the {word}", "", columns, lambda _: rows, sentences=lambda _: said, folded="equal",
            link=word.capitalize(),
        )  # fmt: skip

    return [section("results", "result"), section("parameters", "parameters")]


def of_what(documents: Sequence[Mapping[str, Any]]) -> str:
    """Say plainly whether reports are of one shot."""
    shots = [str(one["shot"]) for one in documents]
    rigs = list(dict.fromkeys(str(one["rig"]) for one in documents))
    if len(set(shots)) > 1:
        of_rigs = f", on the rigs {', '.join(rigs)}" if len(rigs) > 1 else ""
        return (
            f"These reports are of different shots, {', '.join(dict.fromkeys(shots))}{of_rigs}: what differs between "
            "them is the firing, and not the parameters alone."
        )
    if len({_shot_file(one) for one in documents}) > 1:
        return (
            f"These reports are of shot {shots[0]}, but of different shot files: its recorded files were ingested in "
            "different ways, or these are different shots with one name."
        )
    return f"These reports are of one shot file, {shots[0]}: what differs between them is how it was evaluated."


def parameters(laid: Sequence[Laid]) -> list[Row]:
    """List with what the reports were made."""
    return [
        _row(laid, "shot", lambda d: d["shot"]),
        _row(laid, "started", lambda d: d.get("started")),
        _row(laid, "shot file, SHA-256", _shot_file, lambda digest: f"{digest[:16]}…" if digest else NO_NUMBER),
        _row(laid, "rig", lambda d: d["rig"]),
        _row(laid, "corrected in the rig", _corrections),
        _row(laid, "configuration", lambda d: (d.get("shot_log") or {}).get("configuration")),
        _row(laid, "added mass / kg", lambda d: (d.get("shot_log") or {}).get("added_mass_kg"), plain),
        _row(laid, "method", lambda d: d["mass"].get("method")),
        _row(laid, "low-pass / Hz", lambda d: d.get("filter", {}).get("cutoff_hz"), plain),
        _row(laid, "chosen by", lambda d: d.get("filter", {}).get("basis")),
        *_other_filters(laid),
        _row(laid, "its half order", lambda d: d.get("filter", {}).get("half_order")),
        _row(laid, "low-pass of the fit of the mass / Hz", lambda d: d.get("filter", {}).get("mass_cutoff_hz"), plain),
        _row(laid, "memory (window) / ms", lambda d: d.get("window_s"), lambda s: plain(1e3 * s), 1e3),
        _row(laid, "recoil-daq", lambda d: d["provenance"].get("version")),
        _row(laid, "computed with", lambda d: ", ".join((d["provenance"].get("computer") or {}).values()) or None),
    ]


def _other_filters(laid: Sequence[Laid]) -> list[Row]:
    """List the kinds of low-pass, where one is not the usual one."""
    kinds = _row(laid, "its kind", lambda d: d.get("filter", {}).get("description", {"kind": "butterworth"})["kind"])
    return [kinds] if any("description" in one.document.get("filter", {}) for one in laid) else []


def results(laid: Sequence[Laid]) -> list[Row]:
    """List what the reports found."""
    u = [one.document["mass"].get("u") for one in laid]
    values = [one.document["mass"].get("value") for one in laid]
    differences = [
        None if None in (value, values[0]) or _same(value, values[0]) else value - values[0] for value in values
    ]
    by = [NO_NUMBER if one is None else signed(significant(one, 3)) for one in differences]
    found = [
        _row(laid, "verdict", lambda d: "valid" if d["valid"] else "not valid"),
        _row(laid, "reasons", lambda d: "; ".join(d["reasons"]) or "none"),
        _numbers("mass / kg", values, [rounded(a, b)[0] for a, b in zip(values, u, strict=True)]),
        _numbers("mass, from that of the first / kg", differences, ["", *by[1:]]),
        _numbers("u / kg", u, [significant(one, 2) for one in u]),
        _intervals(laid, "95 % interval / kg", lambda d: d["mass"].get("U95")),
        _row(laid, "specification / kg", lambda d: d["mass"].get("specification"), plain),
        _row(laid, "of which it consists", specified),
        _row(laid, "what mass it is", lambda d: d.get("measurand")),
        _row(laid, "E_n", lambda d: d.get("E_n"), lambda e_n: signed(fixed(e_n, 2))),
        _row(laid, "RPE / %", lambda d: d["rpe_percent"].get("value"), lambda one: significant(one, 3)),
        _intervals(laid, "its 95 % interval / %", lambda d: d["rpe_percent"].get("U95")),
        _row(
            laid, "identified share / %", lambda d: d.get("identified_share"), lambda share: fixed(100 * share, 1), 100
        ),
    ]
    for name in dict.fromkeys(name for one in laid for name in one.document.get("peaks") or {}):
        values = [(one.document.get("peaks") or {}).get(name) for one in laid]
        label, scale = PEAK_LABELS.get(name, (f"peak: {name}", 1.0))
        texts = [NO_NUMBER if one is None else plain(scale * one) for one in values]
        found.append(_numbers(label, values, texts, scale))
    return found


def beside_figures(laid: Sequence[Laid]) -> list[Figure]:
    """Lay the reports' curves over one another, each report with one colour, times after its onset of force."""
    figures = []
    masses = [
        _band(one, one.trace, hue)
        for hue, one in enumerate(laid)
        if one.trace is not None and np.isfinite(one.trace[:, 1]).any()
    ]
    if masses:
        specified = dict.fromkeys(one.document["mass"]["specification"] for one in laid)
        lines = tuple(HorizontalLine("specification", kg) for kg in specified if kg is not None)
        caption = "The mass that the samples within the memory give, with its 95 % band, of each report."
        figures.append(
            Figure("mass", "Mass over time", caption, "time after the onset of force, ms",
                   (Panel("mass, kg", tuple(masses), lines, y_shown=_worth_seeing(laid)),))
        )  # fmt: skip
    panels = []
    for name, label, scale, unit in PANELS:
        traces = [
            Trace(one.name, 1e3 * one.curves.times_s, scale * one.curves.values[name], "filtered", unit, hue=hue)
            for hue, one in enumerate(laid)
            if one.curves is not None and name in one.curves.values
        ]
        panels += [Panel(label, tuple(traces))] if traces else []
    if panels:
        caption = "Breech pressure and acceleration behind each report's low-pass, and the recoil travel."
        figures.append(Figure("curves", "The shot", caption, "time after the onset of force, ms", tuple(panels)))
    return figures


def _band(one: Laid, trace: Array, hue: int) -> Trace:
    after_onset_ms = 1e3 * (trace[:, 0] - one.document["interval_s"][0])
    return replace(with_interval(one.name, after_onset_ms, trace[:, 1], trace[:, 2], "kg", hue=hue), dash=hue)


def _worth_seeing(laid: Sequence[Laid]) -> tuple[float, float] | None:
    """Choose the range of masses: those of the reports, not what the first windows or a poor method swing to."""
    ends = [end for one in laid for end in one.document["mass"].get("U95") or () if end is not None]
    ends += [kg for one in laid if (kg := one.document["mass"]["specification"]) is not None]
    return (0.97 * min(ends), 1.03 * max(ends)) if ends else None


def _row(
    laid: Sequence[Laid],
    label: str,
    value: Callable[[Mapping[str, Any]], Any],
    text: Callable[[Any], str] = str,
    scale: float = 1.0,
) -> Row:
    values = [value(one.document) for one in laid]
    return _numbers(label, values, [NO_NUMBER if one is None else text(one) for one in values], scale)


def _numbers(label: str, values: Sequence[Any], texts: Sequence[str], scale: float = 1.0) -> Row:
    """Return a row; where its values differ by less than is printed of them, so many digits are that this shows.

    It differs where it is not the same in all, but for what rounding makes of a number on another computer. `scale`
    turns a value into the label's unit.
    """
    differs = not all(_same(value, values[0]) for value in values[1:])
    if differs and len(set(texts)) == 1:
        for digits in range(3, 16):
            again = [f"{scale * one:.{digits}g}" if isinstance(one, float) else str(one) for one in values]
            if all(a != b or _same(one, other) for a, one in zip(again, values, strict=True)
                   for b, other in zip(again, values, strict=True)):  # fmt: skip
                break
        texts = [text.replace("-", MINUS) for text in again]
    return {"label": label, "differs": differs, "values": list(values), "texts": list(texts)}


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        return all(_same(a, b) for a, b in zip(one, other, strict=True))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=ELSEWHERE)
    return bool(one == other)


def _shot_file(document: Mapping[str, Any]) -> str | None:
    inputs = document["provenance"].get("inputs") or [{}]
    digest = inputs[0].get("sha256")
    return None if digest is None else str(digest)


def _corrections(document: Mapping[str, Any]) -> str:
    said = [f"{one['key']} {one['was']} -> {one['is']}" for one in document.get("corrections") or ()]
    return "; ".join(said) or "nothing"


def _intervals(laid: Sequence[Laid], label: str, value: Callable[[Mapping[str, Any]], Any]) -> Row:
    """Return the row of intervals, those of nearly one width to the place that the narrowest of them justifies."""
    values = [value(one.document) for one in laid]
    ends = [[math.nan if one is None else one for one in pair or (None, None)] for pair in values]
    halves = [half for low, high in ends if (half := (high - low) / 2) > 0.0 and math.isfinite(half)]
    alike = bool(halves) and max(halves) <= 2.0 * min(halves)
    texts = [
        " … ".join(rounded(one, min(halves) if alike else (pair[1] - pair[0]) / 2)[0] for one in pair) for pair in ends
    ]
    return _numbers(label, values, texts)
