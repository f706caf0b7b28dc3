"""Texts that a browser, a typesetter or a spreadsheet would obey: shown as they are spelled, everywhere."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pandas as pd
import pytest
from pypdf import PdfReader

from recoil_acquisition.shot.shot import InputFile
from recoil_identification.campaign.combination import combine
from recoil_identification.report.document.campaign_document import campaign_document, campaign_table
from recoil_identification.report.document.certificate_document import Behind, certificate_document
from recoil_identification.report.document.document import report_document
from recoil_identification.report.document.spreadsheet import write_workbook
from recoil_identification.report.figure.figure import Figure, HorizontalLine, Panel, Span, Trace
from recoil_identification.report.page.html import (
    render_campaign_page,
    render_certificate_page,
    render_page,
    render_results_page,
    render_target_page,
)
from recoil_identification.report.paper.paper import campaign_pdf, certificate_pdf, report_pdf, target_pdf
from recoil_identification.report.results.beside import Laid, beside_document
from recoil_identification.report.results.shot_index import INDEX, index_document, row_of_report
from recoil_identification.report.results.sweep import SWEEP, found_row, sweep_document
from recoil_identification.targets.target_document import target_document
from recoil_identification.targets.target_result import Quantity, Table, TargetResult
from recoil_rigs.tables.issue import Issue
from tests.builders.campaign_summaries import campaign_of
from tests.builders.virtual_shots import identified, virtual_shot

EVIL = "\x1b[2J\u202eevil\u2066\x00\ud800<script>alert(1)</script><b onload=x>'\"&{{7*7}}#panic()$x$\\input{x}%{y}"
DECIDING = (
    "schema", "verdict", "status", "unit", "kind", "severity", "type", "method", "target", "sha256", "logo", "group",
    "key", "certified", "word", "rule", "date", "interval_by",
)  # fmt: skip
"""Keys of words that decide something, and of what is checked before a page is made."""
OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
SCRIPTS = re.compile("<script.*?</script>", re.DOTALL)


def poisoned(value: Any, key: str = "") -> Any:
    """Put what is obeyed behind every text that is free."""
    if isinstance(value, dict):
        return {name: poisoned(one, name) for name, one in value.items()}
    if isinstance(value, list):
        return [poisoned(one, key) for one in value]
    return value + EVIL if isinstance(value, str) and key not in DECIDING else value


def a_figure() -> Figure:
    band = Trace(f"a{EVIL}", [0.0, 1.0], [2.0, 4.0], "band", f"N{EVIL}", [1.0, 3.0], [3.0, 5.0])
    panel = Panel(f"p, {EVIL}", (band,), (HorizontalLine(f"l{EVIL}", 3.0),), (Span(f"s{EVIL}", 0.1, 0.2),))
    return Figure(f"k{EVIL}", f"T{EVIL}", f"C{EVIL}", f"x{EVIL}", (panel,))


def of_shot() -> dict[str, Any]:
    virtual = virtual_shot("mixed")
    shot_file = InputFile("s1.h5", "ab" * 32, 123, "", "shot file")
    issued = {"laboratory": "L", "remark": "r", "concession": "c"}
    document = report_document(virtual.shot, identified("mixed"), version="1", shot_file=shot_file, rig=virtual.rig)
    return {**document, "issued": issued, "notes": ["a note"], "reasons": ["a reason"], "valid": False}


def of_target() -> dict[str, Any]:
    quantity = Quantity("stiffness", "k", 3.25e7, 4.0e5, "N/m", "load on deflection")
    table = Table("Supports", "What each tells.", ("support", "rows"), (("ground", "38"),))
    found = TargetResult("stiffness", "Stiffness", "By inverse dynamics.", (quantity,), tables=(table,))
    shot_file = InputFile("s1.h5", "ab" * 32, 123, "", "shot file")
    return target_document(virtual_shot("mixed").shot, found, version="1", shot_file=shot_file)


def of_campaign() -> dict[str, Any]:
    campaign = combine(campaign_of((0.0, 120.0) * 2, seed=4).shots)
    document = campaign_document(campaign, version="1", inputs=[], parameters={"cutoff": "x"}, pages={"1": "../a"})
    document["shots"][0] |= {"shot_log": {"notes": "n", "charge": "c"}, "excluded": "misfire", "report": "../a.html"}
    return document


def of_certificate() -> dict[str, Any]:
    issued = Issue(
        number="K-1", laboratory="L", item="i", date="2026-11-28", decision_rule="guard band", tolerance_kg=(-4, 4)
    )
    inputs = [{"file": "0001/report.json", "kind": Behind.REPORT, "sha256": "ab" * 32}]
    source = {**of_shot(), "valid": True}
    return certificate_document(source, [source], issued, version="1", inputs=inputs, drawn={})


def of_index() -> dict[str, Any]:
    row = row_of_report(of_shot())
    return index_document([row, row], version="1", failed=[{"file": "f", "error": "no file"}])


def of_sweep() -> dict[str, Any]:
    own = found_row(identified("mixed"))
    return sweep_document(
        "cutoff_hz", {None: own, 150.0: "no mass"}, shot="0001", rig="mixed", specification_kg=782.0, version="1",
        inputs=[], options={"cutoff_hz": None},
    )  # fmt: skip


def of_beside() -> dict[str, Any]:
    laid = [Laid(name=name, document=poisoned(of_shot()), sha256="ab" * 32, trace=None, curves=None) for name in "ab"]
    return beside_document(laid, version="1")


PAGES: dict[str, tuple[Callable[[], dict[str, Any]], Callable[[dict[str, Any]], str]]] = {
    "shot": (of_shot, lambda one: render_page(one, [a_figure()])),
    "target": (of_target, lambda one: render_target_page(one, [a_figure()])),
    "campaign": (of_campaign, lambda one: render_campaign_page(one, [a_figure()])),
    "certificate": (of_certificate, render_certificate_page),
    "index": (of_index, render_results_page),
    "sweep": (of_sweep, lambda one: render_results_page(one, [a_figure()])),
    "beside": (of_beside, lambda one: render_results_page(one, [a_figure()])),
}


@pytest.mark.whole_way
@pytest.mark.parametrize("kind", PAGES)
def test_a_page_shows_what_it_would_obey_as_it_is_spelled(kind: str) -> None:
    document, render = PAGES[kind]
    page = render(poisoned(document()))
    page.encode("utf-8")
    assert OBEYED.findall(page) == []
    shown = SCRIPTS.sub("", page)
    assert "<script" not in shown.lower()
    assert not re.search(r"<b\s+onload", shown)
    assert r"\u202eevil\u2066" in shown
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in shown
    assert "{{7*7}}" in shown


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("kind", "made"),
    [
        ("shot", report_pdf), ("target", target_pdf), ("campaign", campaign_pdf),
        ("certificate", lambda one, _: certificate_pdf(one)),
    ],
)  # fmt: skip
def test_paper_shows_it_as_it_is_spelled(kind: str, made: Callable[..., bytes]) -> None:
    content = made(poisoned(PAGES[kind][0]()), [a_figure()])
    text = "".join("".join(sheet.extract_text() for sheet in PdfReader(io.BytesIO(content)).pages).split())
    assert "<script>alert(1)</script>" in text
    assert "#panic()" in text
    assert "{{7*7}}" in text


@pytest.mark.whole_way
@pytest.mark.parametrize("start", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1+1", " =1+1", "\uff1d1+1", "\r=1"])
def test_no_cell_is_a_formula(start: str, tmp_path: Path) -> None:
    document = of_campaign()
    document["shots"][0] |= {"shot": start, "excluded": start, "reasons": [start], "configuration": start}
    row = {**row_of_report(of_shot()), "shot": start, "reason": start, "configuration": start}
    sweep = of_sweep()
    sweep["rows"][0]["reason"] = start
    texts = [campaign_table(document), INDEX.csv(index_document([row], version="1")), SWEEP.csv(sweep)]
    found = [cell for text in texts for line in csv.reader(io.StringIO(text)) for cell in line if "1" in cell]
    bad = [cell for cell in found if cell.strip()[:1] in "=+@\uff1d\uff0b\uff20" or cell[:1] in "\t\r"]
    bad += [cell for cell in found if cell.strip()[:1] in ("-", "\uff0d") and not re.fullmatch(r"-[\d.e+-]+", cell)]
    assert [cell for cell in bad if cell] == []
    write_workbook(tmp_path / "book.xlsx", {"a": pd.DataFrame({start: [start], "n": np.array([-1.5])})})
    sheet = openpyxl.load_workbook(tmp_path / "book.xlsx")["a"]
    assert [cell.data_type for line in sheet.iter_rows() for cell in line] == ["s", "s", "s", "n"]
    assert sheet["A2"].value.strip()[:1] not in tuple("=+@-")
    assert sheet["A1"].value.strip()[:1] not in tuple("=+@-")
