"""The pages of a shot and of a campaign: they explain themselves, print, and need no network.

`render_page` turns a report (the mapping of ``report.json``) and its figures into one HTML text,
`render_target_page` the document of another target, and `render_campaign_page` a campaign's answer; `write_page` puts
a page into a folder, with plotly's script beside it. The numbers come from the documents.
"""

from __future__ import annotations

import filecmp
import json
import math
import shutil
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import StoreError
from recoil_identification.report import campaign_tables, tables
from recoil_identification.report.drawing import drawings
from recoil_identification.report.figure import Figure
from recoil_identification.report.rounding import NO_NUMBER

if TYPE_CHECKING:
    from jinja2 import Environment

SCHEMA = "recoil-daq/report/1"
PAGE_NAME = "report.html"
CAMPAIGN_PAGE = "campaign.html"
BESIDE_PAGE = "beside.html"
SCRIPT_NAME = "plotly.min.js"
REQUIRED_KEYS = ("schema", "shot", "rig", "mass", "rpe_percent", "valid", "reasons", "provenance")


def write_page(folder: Path, page: str, name: str = PAGE_NAME) -> Path:
    """Write a page and, beside it, the script that draws its figures.

    Parameters
    ----------
    folder
        Created where it is missing. An older page in it is replaced, at once and whole.
    page
        Of `render_page` or `render_target_page`.
    name
        Of the file.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    StoreError
        The folder cannot be written, or plotly's script is not installed.
    """
    script = plotly_script()
    path, beside = folder / name, folder / SCRIPT_NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not (beside.is_file() and filecmp.cmp(script, beside, shallow=False)):
            partial = folder / (SCRIPT_NAME + ".part")
            shutil.copyfile(script, partial)
            partial.replace(beside)
        partial = folder / (name + ".part")
        partial.write_text(page, encoding="utf-8", newline="\n")
        partial.replace(path)
    except OSError as error:
        raise StoreError(
            "the report page cannot be written",
            path=folder,
            found=error.strerror or str(error),
            remedy="free some space, or choose a folder you may write to with --out",
        ) from error
    return path


def plotly_script() -> Path:
    """Find plotly's browser script in the installed package, without importing that package.

    Raises
    ------
    StoreError
        It is not there.
    """
    spec = find_spec("plotly")
    for root in (spec.submodule_search_locations if spec is not None else None) or ():
        script = Path(root) / "package_data" / SCRIPT_NAME
        if script.is_file():
            return script
    raise StoreError(
        "the script that draws the report's figures is not installed",
        expected=f"package_data/{SCRIPT_NAME} in the package plotly",
        found="no package plotly" if spec is None else f"plotly without it in {spec.origin}",
        remedy="install it again: pip install --force-reinstall plotly",
    )


def render_page(report: Mapping[str, Any], figures: Sequence[Figure]) -> str:
    """Render the page.

    Parameters
    ----------
    report
        The report, schema ``recoil-daq/report/1``. ``methods``, ``truth``, ``summary`` and ``E_n`` are shown
        if they are there.
    figures
        In reading order.

    Returns
    -------
    str
        A complete HTML document that refers to ``plotly.min.js`` beside it and to nothing else.

    Raises
    ------
    ValueError
        A report of another schema or without a key that every report has, or figures with equal keys.
    """
    missing = [key for key in REQUIRED_KEYS if key not in report]
    if missing:
        raise ValueError(f"the report lacks {', '.join(missing)}")
    if report["schema"] != SCHEMA:
        raise ValueError(f"the report's schema is {report['schema']!r}; expected {SCHEMA!r}")
    budget_rows, combined = tables.budget(report)
    return _render(
        "page.html",
        report,
        figures,
        verdict=tables.verdict(report),
        facts=tables.facts(report),
        notes=tables.notes(report),
        methods=tables.methods(report),
        budget=budget_rows,
        combined=combined,
        coverage=tables.coverage(report),
        alignment=tables.alignment(report),
        conditioning=tables.conditioning(report),
        ringing=tables.ringing(report),
        repairs=tables.repairs(report),
        quality=tables.quality(report),
        quality_counts=tables.quality_counts(report),
        series_file=(report.get("trace") or {}).get("file"),
        series_name="mass over time",
    )


def render_target_page(document: Mapping[str, Any], figures: Sequence[Figure]) -> str:
    """Render the page of a target.

    Parameters
    ----------
    document
        Of `recoil_identification.report.target_document.target_document`.
    figures
        In reading order.

    Returns
    -------
    str
        A complete HTML document that refers to ``plotly.min.js`` beside it and to nothing else.

    Raises
    ------
    ValueError
        Figures with equal keys.
    """
    return _render(
        "target.html",
        document,
        figures,
        quantities=tables.quantities(document),
        series_file=(document.get("series") or {}).get("file"),
        series_name="what was identified over time",
    )


def render_campaign_page(document: Mapping[str, Any], figures: Sequence[Figure]) -> str:
    """Render the page of a campaign.

    Parameters
    ----------
    document
        Of `recoil_identification.report.campaign_document.campaign_document`. It is not embedded: ``campaign.json``
        stands beside the page.
    figures
        Of `recoil_identification.report.campaign_figures.campaign_figures`.

    Returns
    -------
    str
        A complete HTML document that refers to ``plotly.min.js`` beside it, to the shots' pages, and to nothing else.

    Raises
    ------
    ValueError
        Figures with equal keys.
    """
    columns, rows = campaign_tables.shots(document)
    return _render(
        "campaign.html",
        document,
        figures,
        embedded={"shot": f"campaign-{document['rig']}"},
        verdict=campaign_tables.verdict(document),
        changed=campaign_tables.changed(document),
        unchanged=all(signal["kind"] == campaign_tables.CHART for signal in document["signals"]),
        charted=campaign_tables.charted(document),
        facts=campaign_tables.facts(document),
        mechanisms=campaign_tables.mechanisms(document),
        learnt=campaign_tables.learnt(document),
        next_steps=campaign_tables.next_steps(document),
        columns=columns,
        rows=rows,
        assumed=campaign_tables.assumed(document),
        series_file="campaign.csv",
        series_name="the shots",
    )


def render_beside_page(document: Mapping[str, Any], figures: Sequence[Figure]) -> str:
    """Render the page of reports beside one another.

    Parameters
    ----------
    document
        Of `recoil_identification.report.beside.beside_document`.
    figures
        Of `recoil_identification.report.beside.beside_figures`.

    Returns
    -------
    str
        A complete HTML document that refers to ``plotly.min.js`` beside it, to the reports' pages, and to nothing else.

    Raises
    ------
    ValueError
        Figures with equal keys.
    """
    return _render(
        "beside.html",
        document,
        figures,
        embedded={"shot": f"{document['shot']}-beside"},
        series_file=None,
        series_name=None,
    )


@cache
def _environment() -> Environment:
    """Make the environment once: it keeps its templates compiled."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _render(
    template: str,
    report: Mapping[str, Any],
    figures: Sequence[Figure],
    embedded: Mapping[str, Any] | None = None,
    **more: Any,
) -> str:
    from markupsafe import Markup

    if len({figure.key for figure in figures}) != len(figures):
        raise ValueError("two figures have the same key")
    drawn = drawings(figures)
    return (
        _environment()
        .get_template(template)
        .render(
            report=report,
            figures=[
                {
                    "number": number,
                    "height": d["height"],
                    **{k: getattr(f, k) for k in ("key", "title", "caption", "folded")},
                }
                for number, (f, d) in enumerate(zip(figures, drawn, strict=True))
            ],
            inputs=tables.inputs(report),
            started=tables.started(report),
            **more,
            version=report["provenance"].get("version", NO_NUMBER),
            parameters=json.dumps(
                _finite(report["provenance"].get("parameters") or {}), indent=2, ensure_ascii=False, default=str
            ),
            script=SCRIPT_NAME,
            figures_json=Markup(_embedded(drawn)),  # noqa: S704 - `_embedded` leaves no character that HTML reads
            report_json=Markup(_embedded(report if embedded is None else embedded)),  # noqa: S704 - as above
        )
    )


def _finite(value: Any) -> Any:
    """Put null for every number that JSON has no word for, and plain numbers for numpy's."""
    if isinstance(value, Mapping):
        return {str(k): _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    if hasattr(value, "tolist"):
        return _finite(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _embedded(value: Any) -> str:
    """JSON that may stand inside a script element: no character in it can end the element or a line."""
    text = json.dumps(_finite(value), ensure_ascii=False, allow_nan=False, separators=(",", ":"), default=str)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text
