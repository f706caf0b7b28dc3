"""The pages of a shot and of a campaign: they explain themselves, print, and need no network.

`render_page` turns a report (the mapping of ``report.json``) and its figures into one HTML text,
`render_target_page` the document of another target, `render_campaign_page` a campaign's answer, and
`render_results_page` results in a row. The numbers come from the documents.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from recoil_acquisition.errors import visible
from recoil_identification.estimate.rounding import NO_NUMBER, grouped
from recoil_identification.report.content.glossary import Glossary, notation
from recoil_identification.report.content.head import head_of, identity_of
from recoil_identification.report.content.result_table import ResultHead
from recoil_identification.report.content.section import parts_of
from recoil_identification.report.document.certificate_document import CERTIFICATE_FILE
from recoil_identification.report.document.report_files import OWN_DIGEST, SCHEMA, SEAL, to_json
from recoil_identification.report.figure.drawing import drawings
from recoil_identification.report.figure.figure import Figure
from recoil_identification.report.figure.svg import still_svg
from recoil_identification.report.page.packing import packed, packed_file
from recoil_identification.report.page.page_files import SCRIPT_NAME, plotly_script
from recoil_identification.report.results import beside, day, shot_index, sweep
from recoil_identification.report.sections import sections_of

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

PAGE_NAME = "report.html"
CAMPAIGN_PAGE = "campaign.html"
CERTIFICATE_PAGE = "certificate.html"
BESIDE_PAGE = "beside.html"
INDEX_PAGE = "index.html"
DAY_PAGE = "day.html"
NEEDED_PX = {"few": 480, "some": 640, "many": 640, "listing": 1060}
"""Kind of a table by the number of its columns, as ``parts.html`` tells it, or by its style -> width of a page up to
which its rows are blocks."""
MOST_COLUMNS = 24
"""Columns of a table that bear their headings where there is no room for them."""
_UNSAFE = re.compile(r"""[\x00-\x1f"'\\<>&{};]""")
"""Characters that a string of a style spells by their numbers."""
REQUIRED_KEYS = ("schema", "shot", "rig", "mass", "rpe_percent", "valid", "reasons", "provenance")


def render_page(report: Mapping[str, Any], figures: Sequence[Figure], *, standalone: bool = False) -> str:
    """Render the page.

    Parameters
    ----------
    report
        The report, schema ``recoil-daq/report/1``. ``methods``, ``truth``, ``summary`` and ``E_n`` are shown
        if they are there.
    figures
        Figures in reading order.
    standalone
        Whether the page holds the script as well.

    Returns
    -------
    str
        A complete HTML document that refers to ``plotly.min.js`` in the folder above its own and to nothing else; if it
        stands alone, to nothing at all.

    Raises
    ------
    ValueError
        A report of another schema or without a key that every report has, or figures with equal keys.
    StoreError
        The page is to stand alone, and plotly's script is not installed.
    """
    missing = [key for key in REQUIRED_KEYS if key not in report]
    if missing:
        raise ValueError(f"the report lacks {', '.join(missing)}")
    if report["schema"] != SCHEMA:
        raise ValueError(f"the report's schema is {report['schema']!r}; expected {SCHEMA!r}")
    return _render(
        "document.html", report, figures, standalone=standalone, head=head_of(report),
        series_file=(report.get("trace") or {}).get("file"), series_name="mass over time",
    )  # fmt: skip


def render_target_page(document: Mapping[str, Any], figures: Sequence[Figure], *, standalone: bool = False) -> str:
    """Render the page of a target.

    Parameters
    ----------
    document
        Document of `recoil_identification.targets.target_document.target_document`.
    figures
        Figures in reading order.
    standalone
        Whether the page holds all that it shows, see `render_page`.

    Returns
    -------
    str
        HTML, as `render_page` returns it.

    Raises
    ------
    ValueError
        Figures with equal keys.
    StoreError
        As of `render_page`.
    """
    return _render(
        "document.html", document, figures, standalone=standalone, head=head_of(document),
        series_file=(document.get("series") or {}).get("file"), series_name="what was identified over time",
    )  # fmt: skip


def render_campaign_page(document: Mapping[str, Any], figures: Sequence[Figure], *, standalone: bool = False) -> str:
    """Render the page of a campaign.

    Parameters
    ----------
    document
        Document of `recoil_identification.report.document.campaign_document.campaign_document`. It is not embedded:
        ``campaign.json`` stands beside the page.
    figures
        Figures of `recoil_identification.report.figure.campaign_figures.campaign_figures`.
    standalone
        Whether the page holds all that it shows, see `render_page`.

    Returns
    -------
    str
        A complete HTML document that refers to ``plotly.min.js`` beside it, unless it stands alone, to the shots'
        pages, and to nothing else.

    Raises
    ------
    ValueError
        Figures with equal keys.
    StoreError
        As of `render_page`.
    """
    return _render(
        "document.html", document, figures, embedded={"shot": f"campaign-{document['rig']}"}, standalone=standalone,
        script=SCRIPT_NAME, head=head_of(document), series_file="campaign.csv", series_name="the shots",
    )  # fmt: skip


def render_certificate_page(document: Mapping[str, Any]) -> str:
    """Render the page of a certificate: one file that needs no script and no other file.

    Parameters
    ----------
    document
        Document of `recoil_identification.report.document.certificate_document.certificate_document`.
    """
    return _render(
        "document.html", document, (), embedded={"shot": "certificate"}, standalone=False, head=head_of(document),
        series_file=CERTIFICATE_FILE, series_name="all of it for machines",
    )  # fmt: skip


def render_results_page(
    document: Mapping[str, Any], figures: Sequence[Figure] = (), *, standalone: bool = False
) -> str:
    """Render the page of results in a row: an index of shots, a sweep of one option, or reports beside one another.

    Parameters
    ----------
    document
        Document of `recoil_identification.report.results.shot_index.index_document`,
        `recoil_identification.report.results.sweep.sweep_document` or
        `recoil_identification.report.results.beside.beside_document`.
    figures
        Figures in reading order.
    standalone
        Whether the page holds all that it shows, see `render_page`.

    Returns
    -------
    str
        HTML, as `render_page` returns it, and it refers to the reports' pages. Without figures it needs no script.

    Raises
    ------
    ValueError
        Figures with equal keys.
    StoreError
        As of `render_page`.
    """
    head = asdict(replace(_HEADS[document["schema"]](document), identity=identity_of(document.get("issued") or {})))
    return _render("overview.html", document, figures, standalone=standalone, **head)


_HEADS: dict[str, Callable[[Mapping[str, Any]], ResultHead]] = {
    shot_index.SCHEMA: shot_index.head,
    sweep.SCHEMA: sweep.head,
    beside.SCHEMA: beside.head,
    day.SCHEMA: day.head,
}
"""Schema of a document of results -> function that returns the head of its page."""


@cache
def _environment() -> Environment:
    """Make the environment once: it keeps its templates compiled."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_nothing_hidden,
    )
    environment.filters["urlencode"] = _link
    return environment


def _link(path: str) -> str:
    """Write a path for a link; bytes of a name that are no text are these bytes again."""
    try:
        return quote(path.encode("utf-8", "surrogateescape"))
    except UnicodeEncodeError:
        return quote(path.encode("utf-8", "replace"))


def _nothing_hidden(value: Any) -> Any:
    """Spell what a browser would obey in a text out of a file, such as a mark that turns the rest of a line round."""
    from markupsafe import Markup

    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _render(
    template: str,
    report: Mapping[str, Any],
    figures: Sequence[Figure],
    *,
    standalone: bool,
    script: str = f"../{SCRIPT_NAME}",
    embedded: Mapping[str, Any] | None = None,
    **more: Any,
) -> str:
    from markupsafe import Markup

    if len({figure.key for figure in figures}) != len(figures):
        raise ValueError("two figures have the same key")
    drawn = drawings(figures)
    glossary = Glossary()
    carried = {"report": to_json(report if embedded is None else embedded), "figures": drawn}
    return (
        _environment()
        .get_template(template)
        .render(
            report=report,
            parts=parts_of(sections_of(report), report, figures),
            figures=[
                {
                    "number": number,
                    "height": d["height"],
                    "still": Markup(still_svg(f)),  # noqa: S704 - every text in it is escaped where it is drawn
                    "link": d["link"],
                    **{k: getattr(f, k) for k in ("key", "title", "caption", "folded")},
                }
                for number, (f, d) in enumerate(zip(figures, drawn, strict=True))
            ],
            whole=embedded is None,
            **more,
            glossary=glossary,
            said=glossary.text,
            term=glossary.term,
            heading=glossary.heading,
            headings=headings,
            notation=notation,
            parted=parted,
            grouped=grouped,
            version=report["provenance"].get("version", NO_NUMBER),
            own_digest=(OWN_DIGEST, report["provenance"].get(SEAL)),
            parameters=Markup("\n").join(
                visible(line)
                for line in json.dumps(
                    to_json(report["provenance"].get("parameters") or {}), indent=2, ensure_ascii=False, default=str
                ).split("\n")
            ),
            script=script,
            packed_script=packed_file(plotly_script()) if standalone else None,
            style=Markup(_style()),  # noqa: S704 - files of this package
            code=Markup(_text("figures.js")),  # noqa: S704 - a file of this package
            packed=packed(carried),
        )
    )


def parted(text: str) -> Markup:
    """Write a text as HTML that may end a line behind each underscore: names of signals are longer than a column."""
    from markupsafe import Markup, escape

    return Markup("_<wbr>").join(escape(_nothing_hidden(text)).split("_"))


def headings(names: Iterable[str]) -> str:
    """Return a style that holds the headings of a table's columns, which its cells show where it has no room.

    The table holds each heading once, and its cells none; no character of a heading ends the style.
    """
    written = (_UNSAFE.sub(lambda found: f"\\{ord(found[0]):x} ", name) for name in names)
    return ";".join(f'--h{number}:"{name}"' for number, name in enumerate(written, 1) if name)


@cache
def _text(name: str) -> str:
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


@cache
def _style() -> str:
    """Return the style of all pages, with that of tables which have less room than they need."""
    rows = _text("rows.css")
    narrow = (
        rows.replace("WIDTH", f"{width_px}px").replace(".told", f".{name}") for name, width_px in NEEDED_PX.items()
    )
    heads = (f"td:nth-child({n}){{--h:var(--h{n},none)}}" for n in range(2, MOST_COLUMNS + 1))
    return "".join([_text("frame.css"), *heads, *narrow])
