"""The paper copy of a report: what a page shows, put into an order for sheets, without what only a screen can do.

The rows are those of the page (`tables`, `campaign_tables`); checks that passed are counted, not listed.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from recoil_identification.estimate.rounding import NO_NUMBER, plain
from recoil_identification.report import campaign_tables, sentences, tables
from recoil_identification.report.figure import Figure
from recoil_identification.report.glossary import Glossary, notation
from recoil_identification.report.report_files import json_bytes
from recoil_identification.report.svg import figure_svg, key_of
from recoil_identification.report.typeset import pdf_bytes, png_bytes

PDF_FILE = "report.pdf"
CAMPAIGN_PDF = "campaign.pdf"
FIGURES_FOLDER = "figures"
SAID_ABOVE = ("rig", "date and time")
"""Facts that the heading of the first sheet has."""
FEW_COLUMNS = 9
"""More of them need smaller letters."""

_NOT_IN_NAMES = re.compile(r"[^\w.-]+")

Document = Mapping[str, Any]
Part = dict[str, Any]
Columns = Sequence[tuple[str, str]]
"""Heading and kind of each: ``text``, ``long`` (takes what room is left), ``number`` or ``code``."""


def figure_files(figures: Sequence[Figure], prefix: str = "") -> list[str]:
    """Return the paths, in a report's folder, of the files that `write_figures` writes."""
    return [file for one in figures for file in _files_of(one.key, prefix)]


def earlier_figures(folder: Path, prefix: str = "") -> list[str]:
    """Return the paths, in a report's folder, of the figures that an earlier report left there.

    A drawing is an earlier report's if it says in itself that it is the figure of whose key it bears the name; the
    picture of that name goes with it. What has another name, or says nothing, is somebody else's.
    """
    found = []
    for drawing in sorted((folder / FIGURES_FOLDER).glob("*.svg")):
        key = key_of(drawing)
        if key is not None and f"{FIGURES_FOLDER}/{drawing.name}" in (files := _files_of(key, prefix)):
            found += files
    return found


def _files_of(key: str, prefix: str) -> list[str]:
    # a key may have the name of a clock in it, which may have anything in it
    name = prefix + _NOT_IN_NAMES.sub("_", key)
    return [f"{FIGURES_FOLDER}/{name}.{suffix}" for suffix in ("svg", "png")]


def write_figures(folder: Path, figures: Sequence[Figure], prefix: str = "") -> None:
    """Write each figure as SVG and PNG into ``figures`` in a folder, under its key, as `figure_files` names them.

    Parameters
    ----------
    folder
        Folder, which is there already.
    prefix
        Beginning of the files' names.

    Raises
    ------
    StoreError
        If typst refuses one.
    """
    (folder / FIGURES_FOLDER).mkdir(exist_ok=True)
    drawn = [figure_svg(figure) for figure in figures]
    pictures = (one for svg, png in zip(drawn, png_bytes(drawn), strict=True) for one in (svg.encode("utf-8"), png))
    for name, content in zip(figure_files(figures, prefix), pictures, strict=True):
        (folder / name).write_bytes(content)


def report_pdf(report: Document, figures: Sequence[Figure]) -> bytes:
    """Typeset a shot's report, with its ``report.json`` embedded.

    Parameters
    ----------
    report
        Schema ``recoil-daq/report/1``.
    figures
        Figures in reading order.

    Returns
    -------
    bytes
        PDF/A-3b; the same for the same report and figures.

    Raises
    ------
    StoreError
        If typst refuses it.
    """
    verdict = tables.verdict(report)
    mass, rpe = report["mass"], report["rpe_percent"] or {}
    of_k = f" (k = {verdict['coverage_factor']}, U = {verdict['expanded']})" if verdict["coverage_factor"] else ""
    measures = [
        ("specification", verdict["specification"] and f"{verdict['specification']} {verdict['unit']}"),
        (f"95 % coverage interval{of_k}", verdict["interval"]),
        ("standard uncertainty u", mass.get("u") and f"{tables.budget(report)[1]} {verdict['unit']}"),
        ("relative percentage error, RPE", verdict["rpe"] and f"{verdict['rpe']} %"),
        ("RPE, 95 % coverage interval", verdict["rpe_interval"]),
        ("Eₙ to the specification (k = 2)", verdict["e_n"]),
    ]
    result = "no number"
    if verdict["number"]:
        result = f"{verdict['mass']} {verdict['spread'] or ''} {verdict['unit']}".replace("  ", " ")
    reasons = list(report.get("reasons") or ())
    if verdict["deviation"]:
        reasons.append(f"Valid, {verdict['deviation']}.")
    notes = [*(report.get("notes") or ()), *([rpe["meaning"]] if rpe.get("meaning") else ())]
    assumed = sentences.assumed(report)
    facts = [(label, text) for label, text in tables.facts(report) if label not in SAID_ABOVE]
    head = {
        "tone": "bad" if not verdict["valid"] else "doubt" if verdict["deviation"] else "ok",
        "stamp": "VALID" if verdict["valid"] else "NOT VALID",
        "result": result,
        "words": " ".join([*_measurand(verdict), sentences.in_words(report)]),
        "reasons": reasons,
        "measures": [pair for pair in measures if pair[1]],
        "groups": [("The shot", facts), ("Peaks", tables.peaks(report))],
        "lists": [("Notes", notes), ("What was assumed", [assumed] if assumed else [])],
    }
    parts = [*_results(report), *_figures(figures), *_processing(report)]
    return _typeset(f"Shot {report['shot']} on rig {report['rig']}", "report.json", report, head, parts, figures)


def target_pdf(document: Document, figures: Sequence[Figure]) -> bytes:
    """Typeset what was identified of a shot beside its mass, as `report_pdf`."""
    head = {
        **_plain_head(document),
        "result": document["title"],
        "words": document["summary"],
        "lists": [("Notes", list(document["notes"]))],
    }
    columns = [("Quantity", "long"), ("Symbol", "text"), ("Value", "number"), ("u", "number"),
               ("95 % interval", "number"), ("Unit", "text"), ("Declared", "number"), ("Eₙ", "number"),
               ("How", "long")]  # fmt: skip
    keys = ("name", "symbol", "value", "u", "interval", "unit", "expected", "e_n", "basis")
    parts = [
        _table("What was identified", columns, _cells(tables.quantities(document), keys),
               "u is the standard uncertainty; the interval covers the true value with 95 %. Eₙ compares with what the "
               "rig file declares: within 1 the two agree."),
        *_figures(figures),
        *(_table(one["title"], [(head, "text") for head in one["columns"]], one["rows"], one["caption"])
          for one in document["tables"]),
    ]  # fmt: skip
    name = f"{document['target']}.json"
    title = f"Shot {document['shot']} on rig {document['rig']}: {document['title']}"
    return _typeset(title, name, document, head, parts, figures)


def campaign_pdf(document: Document, figures: Sequence[Figure]) -> bytes:
    """Typeset a campaign's answer, with its ``campaign.json`` embedded, as `report_pdf`.

    Of the figures that a page shows when it is asked for, only those in which something fired are on paper.
    """
    verdict = campaign_tables.verdict(document)
    changed = campaign_tables.changed(document)
    words = (*_measurand(verdict), campaign_tables.unchanged(document), campaign_tables.constancy(document))
    head = {
        **_plain_head(document),
        "result": f"{verdict['mass']} {verdict['spread']} {verdict['unit']}",
        "words": " ".join(word for word in words if word),
        "reasons": [*document["reasons"], *changed],
        "measures": [
            ("95 % coverage interval", verdict["interval"]),
            ("standard uncertainty u", f"{verdict['u']} {verdict['unit']}"),
            *(
                [
                    ("specification, nothing added", f"{verdict['specification']} {verdict['unit']}"),
                    ("deviation", verdict["deviation"]),
                    ("E_n to specification", verdict["e_n"]),
                ]
                if verdict["specification"]
                else ()
            ),
            ("shots", verdict["shots"]),
            ("from shot to shot", f"{verdict['between']} {verdict['unit']}"),
            *campaign_tables.facts(document),
        ],
        "lists": [("Looks that the control charts ask for", campaign_tables.charted(document))],
    }
    shown = [one for one in figures if not one.folded or any(t.kind == "marks" for p in one.panels for t in p.traces)]
    left_out = len(figures) - len(shown)
    notes = [*document["notes"], *campaign_tables.assumed(document)]
    if left_out:
        notes.append(f"The control charts of {left_out} sensors, in which nothing fired, are in campaign.html.")
    columns, rows = campaign_tables.shots(document)
    headings = [(label.replace("&nbsp;", "\u00a0"), "number" if numeric else "text") for label, numeric in columns]
    parts = [
        *_figures(shown),
        _table("Configurations with other parts",
               [("Configuration", "long"), ("Shots", "number"), ("Mass / kg", "number"), ("u / kg", "number"),
                ("Difference / kg", "number"), ("u / kg", "number")],
               _cells(campaign_tables.mechanisms(document),
                      ("name", "shots", "mass", "u", "difference", "u_difference")),
               "Each has a mass of its own; the difference is that from the first."),
        _table("What the campaign learnt of the sensors",
               [("Influence", "long"), ("Known to", "number"), ("Found", "number"), ("u now", "number"),
                ("Times better", "number"), ("w", "number")],
               _cells(campaign_tables.learnt(document), ("influence", "prior", "value", "u", "gained", "w")),
               "What the shots share, and may be off by; w is by how much the shots contradict what was known."),
        _table("What to do next", [("Change", "long"), ("u / kg", "number"), ("u / %", "number")],
               _cells(campaign_tables.next_steps(document), ("change", "u", "percent")),
               "What would make the mass surer, tried on what these shots tell."),
        _table("Shots", headings, [[cell for cell, _ in row["cells"]] for row in rows],
               "Mass and u are those of the shot's report, with what was added; bare and own u are without it, and "
               "with the sensors' errors as the campaign found them."),
        _text("Notes, and what was assumed", notes),
    ]  # fmt: skip
    title = f"Campaign on rig {document['rig']}, {verdict['shots']} shots"
    return _typeset(title, "campaign.json", document, head, parts, shown)


def _measurand(verdict: Part) -> list[str]:
    """Say what mass it is; nothing where an earlier report does not."""
    return [f"It is {verdict['measurand']}."] if verdict["measurand"] else []


def _plain_head(document: Document) -> Part:
    return {
        "tone": "ok" if document["valid"] else "bad",
        "stamp": "VALID" if document["valid"] else "NOT VALID",
        "reasons": list(document["reasons"]),
        "measures": [],
        "groups": [],
        "lists": [],
    }


def _figures(figures: Sequence[Figure]) -> list[Part]:
    return [
        {"kind": "figure", "number": number, "title": figure.title, "caption": figure.caption}
        for number, figure in enumerate(figures)
    ]


def _results(report: Document) -> list[Part | None]:
    budget, combined = tables.budget(report)
    rows = _cells(budget, ("source", "group", "kind", "u_source", "sensitivity", "freedom", "u", "share"))
    if combined is not None:
        # first: at the end it might stand alone on the next sheet
        rows.insert(0, ["Combined standard uncertainty", "", "", "", "", "", combined, ""])
    methods = tables.methods(report)
    return [
        _table("Methods compared",
               [("Method", "text"), ("Mass / kg", "number"), ("u / kg", "number"), ("Deviation / %", "number"),
                ("RPE / %", "number"), ("Note", "long")],
               _cells(methods, ("name", "mass", "u", "deviation", "rpe", "note")),
               "Every method sees the same signals; the one in bold gives the result. The deviation is that from the "
               "specification.",
               strong=[k for k, row in enumerate(methods) if row["chosen"]]),
        _table("Uncertainty budget",
               [("Source", "long"), ("Group", "text"), ("Type", "text"), ("u of the source", "number"),
                ("Sensitivity", "number"), ("ν", "number"), ("u / kg", "number"), ("Share / %", "number")],
               rows,
               "Standard uncertainty of the mass from each source, the largest first: A by statistics of this shot, B "
               "by other knowledge; ν are degrees of freedom, the share is that of the variance.",
               strong=[0] if combined is not None else [], after=sentences.coverage(report)),
        _table("What this shot could not have told",
               [("Source", "long"), ("Largest error that passes", "number"),
                ("Change of the mass by it / kg", "number"), ("Change of the mass", "number")],
               _cells(tables.hidden(report), ("source", "largest", "mass", "per")), sentences.HIDDEN),
    ]  # fmt: skip


def _processing(report: Document) -> list[Part | None]:
    attention = [row for row in tables.quality(report) if row["verdict"] != "ok"]
    passed = sum(count for verdict, count in tables.quality_counts(report) if verdict == "ok")
    checks = f"{passed} checks passed"
    return [
        _table("Alignment of the clocks",
               [("Clock", "text"), ("Offset / ms", "number"), ("u / µs", "number"), ("Drift / ppm", "number"),
                ("u / ppm", "number"), ("Status", "text"), ("Method", "long")],
               _cells(tables.alignment(report),
                      ("clock", "offset", "u_offset", "drift", "u_drift", "status", "method")),
               "How each source's clock maps to the reference clock, in which the figures' times are: reference time = "
               "(1 + drift) × time of the source + offset; u is that of the mapped time in the middle of the motion."),
        _text("What was done to the signals", sentences.conditioning(report)),
        _table("Ringing taken off",
               [("Channel", "long"), ("Energy taken off / %", "number"), ("Mode / Hz", "number"),
                ("Damping / %", "number"), ("Its energy / %", "number"), ("Amplitude", "number")],
               _cells(tables.ringing(report), ("channel", "share", "frequency", "damping", "mode", "amplitude"))),
        _table("Repairs", [("Channel", "text"), ("Repair", "text"), ("Samples", "number"), ("Detail", "long")],
               _cells(tables.repairs(report), ("channel", "what", "samples", "detail"))),
        _table("Quality of the recording",
               [("Channel", "text"), ("Check", "text"), ("Verdict", "text"), ("Detail", "long")],
               _cells(attention, ("channel", "check", "verdict", "detail")),
               f"{checks}; what needs attention:" if attention else f"{checks}; nothing needs attention.",
               shown=bool(attention or passed)),
    ]  # fmt: skip


def _typeset(
    title: str, name: str, document: Document, head: Part, parts: Iterable[Part | None], figures: Sequence[Figure]
) -> bytes:
    content, provenance = json_bytes(document), document["provenance"]
    version, parts = provenance.get("version", NO_NUMBER), list(parts)
    given = ", ".join(f"{key} {value}" for key, value in _flat(provenance.get("parameters") or {}))
    made = f"Made by recoil-daq {version} from the files below; {name}, which holds every number of this document, is "
    sentences = [f"{made}embedded in it.", *([f"Parameters: {given}."] if given else [])]
    rows = [[row["file"], row["sha256"]] for row in tables.inputs(document)]
    rows.append([f"{name} (embedded)", hashlib.sha256(content).hexdigest()])
    origin = _table("Provenance", [("File", "long"), ("SHA-256", "code")], rows, *sentences)
    page = {
        "title": title,
        "when": tables.started(document) or "",
        "running": " · ".join([title, *([when] if (when := document.get("started")) else [])]),
        "made-by": f"recoil-daq {version}",
        "head": _noted(head),
        # names of files stay as they are
        "parts": [*(_noted(part) for part in parts if part is not None), origin, _terms([head, *parts])],
    }
    return pdf_bytes(page, [figure_svg(figure) for figure in figures], (name, content), document.get("started"))


def _terms(parts: Sequence[Any]) -> Part:
    """List the terms that are met in what a document says: a sheet has no other place where they are explained."""
    glossary = Glossary()
    for text in _texts(parts):
        glossary.text(text.replace("Eₙ", "E_n"))
        glossary.term(text)  # the name of a method is a cell of its own
    return {
        "kind": "terms",
        "title": "Terms",
        "terms": [(name.replace("E_n", "Eₙ"), sentence) for name, sentence in glossary.met],
    }


def _texts(value: Any) -> Iterator[str]:
    """Yield all texts in a mapping or a list, at any depth."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping | list | tuple):
        for one in value.values() if isinstance(value, Mapping) else value:
            yield from _texts(one)


def _noted(value: Any) -> Any:
    """Write units and signs of all texts in a mapping or a list as pages do."""
    if isinstance(value, str):
        return notation(value)
    if isinstance(value, Mapping):
        return {key: _noted(one) for key, one in value.items()}
    return [_noted(one) for one in value] if isinstance(value, list | tuple) else value


def _flat(parameters: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    """Yield names and values as far as there are any, those of a mapping in a mapping with both names."""
    for key, value in parameters.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{key}.")
        elif value is not None:
            yield f"{above}{key}", _value(value)


def _value(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " … ".join(_value(one) for one in value)
    return plain(value) if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def _cells(rows: Iterable[Mapping[str, Any]], keys: Sequence[str]) -> list[list[str]]:
    return [[str(row[key]) for key in keys] for row in rows]


def _table(
    title: str,
    columns: Columns,
    rows: Sequence[Sequence[str]],
    *sentences: str,
    after: Sequence[str] = (),
    strong: Sequence[int] = (),
    shown: bool = False,
) -> Part | None:
    """Return a table; None if it has no rows, unless it is to be shown all the same."""
    if not rows and not shown:
        return None
    return {
        "kind": "table",
        "title": title,
        "size": 8.5 if len(columns) <= FEW_COLUMNS else 7.0,
        "sentences": sentences,
        "columns": [{"head": head, "kind": kind} for head, kind in columns],
        "rows": [{"cells": list(row), "strong": number in strong} for number, row in enumerate(rows)],
        "after": after,
    }


def _text(title: str, sentences: Sequence[str]) -> Part | None:
    return _table(title, (), (), *sentences, shown=bool(sentences))
