"""The paper copy of a report: head and sections of the page, without what only a screen can do.

Rows that a page folds are counted, not listed, but those whose sum it states.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from recoil_identification.estimate.rounding import NO_NUMBER, grouped, plain
from recoil_identification.report.content import tables
from recoil_identification.report.content.glossary import Glossary, notation
from recoil_identification.report.content.head import PEAKS, Head, head_of
from recoil_identification.report.content.section import SCREEN_ONLY, Column, parts_of
from recoil_identification.report.content.section import Part as Filled
from recoil_identification.report.document.certificate_document import CERTIFICATE_FILE
from recoil_identification.report.document.certificate_document import SCHEMA as CERTIFICATE
from recoil_identification.report.document.report_files import OWN_DIGEST, SEAL, json_bytes
from recoil_identification.report.figure.figure import Figure
from recoil_identification.report.figure.svg import figure_svg, key_of
from recoil_identification.report.paper.typeset import pdf_bytes, png_bytes
from recoil_identification.report.results import sweep
from recoil_identification.report.sections import sections_of

PDF_FILE = "report.pdf"
CAMPAIGN_PDF = "campaign.pdf"
CERTIFICATE_PDF = "certificate.pdf"
FIGURES_FOLDER = "figures"
SAID_ABOVE = ("rig", "date and time")
"""Facts that the heading of the first sheet has."""
SIZES = {9: 8.5, 14: 7.0, 99: 6.0}
"""Columns up to which a table has letters of a size, pt."""
AS_SPELLED = ("file", "sha256")
"""Keys of columns whose texts are names of files or digests."""
ROW_LETTERS = 90
"""Letters of a line over a whole row: by its columns, those of a name that fits into any cell."""
LONG_CELL = 900
"""Letters of a cell from which on a row may go over two sheets."""

_NOT_IN_NAMES = re.compile(r"[^\w.-]+")

Document = Mapping[str, Any]
Part = dict[str, Any]


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


def drawings_of(figures: Sequence[Figure]) -> list[str]:
    """Return each figure as an SVG drawing."""
    return [figure_svg(figure) for figure in figures]


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
    drawn = drawings_of(figures)
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
    return _typeset("report.json", report, figures)


def target_pdf(document: Document, figures: Sequence[Figure]) -> bytes:
    """Typeset what was identified of a shot beside its mass, as `report_pdf`."""
    return _typeset(f"{document['target']}.json", document, figures)


def campaign_pdf(document: Document, figures: Sequence[Figure]) -> bytes:
    """Typeset a campaign's answer, with its ``campaign.json`` embedded, as `report_pdf`.

    Of the figures that a page shows when it is asked for, only those in which something fired are on paper.
    """
    return _typeset("campaign.json", document, figures)


def sweep_pdf(document: Document, figures: Sequence[Figure]) -> bytes:
    """Typeset a sweep of one option, with its JSON file embedded, as `report_pdf`."""
    return _typeset(f"{sweep.stem(document['key'])}.json", document, figures, sweep.paper_head(document))


def certificate_pdf(document: Document) -> bytes:
    """Typeset a certificate, with its ``certificate.json`` embedded, as `report_pdf`; its date is that of issue."""
    return _typeset(CERTIFICATE_FILE, document, ())


def _typeset(name: str, document: Document, figures: Sequence[Figure], head: Head | None = None) -> bytes:
    content, head = json_bytes(document), head or head_of(document)
    title = f"{head.of} on rig {head.rig}" + (f": {head.result}" if "target" in document else "")
    parts = [part for one in parts_of(sections_of(document), document, figures) for part in _parts(one)]
    written = _head(head)
    page = {
        "title": title,
        "when": tables.started(document) or "",
        "running": " · ".join([title, *([head.when] if head.when else [])]),
        "made-by": f"recoil-daq {document['provenance'].get('version', NO_NUMBER)}",
        "identity": [list(pair) for pair in head.identity],
        "logo": list(base64.b64decode(head.logo.partition(",")[2])),
        "head": written,
        "parts": [*parts, _provenance(name, document, content), _terms([written, *parts])],
    }
    return pdf_bytes(page, [figure_svg(figure) for figure in figures], (name, content), _day_of(document))


def _day_of(document: Document) -> str | None:
    """Return the date that the paper copy bears: of issue where a certificate states it, else of the shot."""
    of_issue, day = None, document.get("started")
    if document.get("schema") == CERTIFICATE:
        of_issue, day = document["issued"].get("date"), document["first_fired"]
    return str(of_issue or day) if of_issue or day else None


def _head(head: Head) -> Part:
    """Return the head as ``paper.typ`` reads it: the first sheet has the rig and the time above it."""
    return _noted(
        {
            "tone": head.tone,
            "stamp": head.stamp,
            "conformity": head.conformity,
            "result": head.whole,
            "words": " ".join(head.words),
            "reasons": [*head.reasons, *head.changes],
            "measures": [(_sub(one.label), one.text) for one in head.measures],
            "concession": head.concession,
            "groups": [
                (
                    title,
                    [
                        (_sub(label), grouped(text) if title == PEAKS else text)
                        for label, text in facts
                        if label not in SAID_ABOVE
                    ],
                )
                for title, facts in reversed(head.groups)
            ],
            "lists": [(one.title, list(one.items)) for one in head.lists],
        }
    )


def _parts(part: Filled) -> Iterator[Part]:
    """Yield what a section is on paper: its table or its sentences, and its figures.

    Figures that a page folds into a section are on paper as far as something fired in them.
    """
    if part.is_figure:
        ((number, figure),) = part.figures
        yield {"kind": "figure", "number": number, "title": figure.title, "caption": figure.caption}
        return
    columns = [one for one in part.columns if one.kind not in SCREEN_ONLY]
    # the sum first: at the end it might stand alone on the next sheet
    listed = [*([{**part.total, "strong": True}] if part.total is not None else []), *part.rows]
    listed += part.folded if part.rest is not None else ()
    rows = [
        _row([_cell(row.get(one.key, ""), one) for one in columns], strong=bool(row.get("strong"))) for row in listed
    ]
    fired = [(number, one) for number, one in part.figures if _fired(one)]
    quiet = len(part.figures) - len(fired)
    sentences = [part.caption] if part.caption else []
    sentences += [f"The control charts of {quiet} sensors, in which nothing fired, are on the page."] if quiet else []
    yield _noted(
        {
            "kind": "table",
            "title": part.title,
            "size": next(size for most, size in SIZES.items() if len(columns) <= most),
            "sentences": [*sentences, *(() if part.section.listed else part.sentences)],
            "items": list(part.sentences) if part.section.listed else [],
            "columns": [{"head": _sub(one.heading), "kind": _kind(one)} for one in columns] if rows else [],
            "rows": rows,
            "after": list(part.after),
        },
        besides=[place for place, one in enumerate(columns) if one.key in AS_SPELLED],
    )
    for number, figure in fired:
        yield {"kind": "figure", "number": number, "title": figure.title, "caption": figure.caption}


def _row(cells: Sequence[str], *, strong: bool = False) -> Part:
    """Return a row of a table: names may end at its cells' edges, and a row that is longer than a sheet on the next."""
    longest = ROW_LETTERS // len(cells)
    return {"cells": cells, "strong": strong, "longest": longest, "long": max(map(len, cells)) > LONG_CELL}


def _cell(value: Any, column: Column) -> str:
    return grouped(str(value)) if column.kind == "number" else str(value)


def _fired(figure: Figure) -> bool:
    return any(trace.kind == "marks" for panel in figure.panels for trace in panel.traces)


def _kind(column: Column) -> str:
    if column.kind in ("number", "code"):
        return column.kind
    return "long" if column.wide or column.kind == "long" else "text"


def _sub(text: str) -> str:
    return text.replace("E_n", "Eₙ")


def _provenance(name: str, document: Document, content: bytes) -> Part:
    """Say what made the document, with which parameters, and the digest of what is embedded."""
    provenance = document["provenance"]
    version = provenance.get("version", NO_NUMBER)
    given = ", ".join(f"{key} {value}" for key, value in _flat(provenance.get("parameters") or {}))
    made = f"Made by recoil-daq {version}; {name}, which holds every number of this document, is embedded in it."
    return {
        "kind": "table",
        "title": "Provenance",
        "size": 8.5,
        "sentences": [made, *([f"Parameters: {given}."] if given else [])],
        "items": [],
        "columns": [{"head": "File", "kind": "long"}, {"head": "SHA-256", "kind": "code"}],
        "rows": [
            _row([label, digest])
            for label, digest in (
                (f"{name} (embedded)", hashlib.sha256(content).hexdigest()),
                (OWN_DIGEST, provenance.get(SEAL)),
            )
            if digest is not None
        ],
        "after": [],
    }


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


def _noted(part: Part, besides: Sequence[int] = ()) -> Part:
    """Write units and signs of all texts of a part as pages do; texts of the columns `besides` as they are spelled."""
    written = _written(part)
    for row, spelled in zip(written.get("rows", ()), part.get("rows", ()), strict=True):
        for place in besides:
            row["cells"][place] = spelled["cells"][place]
    return dict(written)


def _written(value: Any) -> Any:
    if isinstance(value, str):
        return notation(value)
    if isinstance(value, Mapping):
        return {key: _written(one) for key, one in value.items()}
    return [_written(one) for one in value] if isinstance(value, list | tuple) else value


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
