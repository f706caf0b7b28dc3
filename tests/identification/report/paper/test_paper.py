"""The paper copy: a PDF/A-3b that another program reads, with the report in it, the same bytes every time."""

from __future__ import annotations

import hashlib
import io
import json
import re
from dataclasses import replace

import pytest
from pypdf import PdfReader
from pypdf.generic import DictionaryObject

from recoil_acquisition.errors import StoreError
from recoil_acquisition.packages.extras import Extra
from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.shot import InputFile
from recoil_identification.campaign.combination import combine
from recoil_identification.report.document.campaign_document import campaign_document
from recoil_identification.report.document.document import report_document
from recoil_identification.report.document.report_files import write_document
from recoil_identification.report.figure.campaign_figures import campaign_figures
from recoil_identification.report.figure.figure import Figure, Panel, Trace
from recoil_identification.report.figure.figures import report_figures
from recoil_identification.report.figure.svg import figure_svg
from recoil_identification.report.paper import paper, typeset
from recoil_identification.report.paper.paper import campaign_pdf, report_pdf, target_pdf, write_figures
from recoil_identification.report.sections import (
    CAMPAIGN_SECTIONS,
    INDEX_SECTIONS,
    SHOT_SECTIONS,
    SWEEP_SECTIONS,
)
from recoil_identification.targets.target_document import target_document
from recoil_identification.targets.target_result import Quantity, Table, TargetResult
from tests.builders.campaign_summaries import campaign_of
from tests.builders.paper_edges import beyond
from tests.builders.virtual_shots import identified, virtual_shot

SHOT_FILE = InputFile("s1.h5", "ab" * 32, 123, "", "shot file")
HOSTILE = '#read("/etc/passwd") *b* _i_ $x$ [c] \\ @l <m> // /* \x00\x1b\u202e\ud800 射撃🤡 \u0645'
SMALL = Figure("k", "Title", "Caption", "x, s", (Panel("y, m", (Trace("t", [0.0, 1.0], [0.0, 1.0], "filtered"),)),))


@pytest.fixture(scope="module")
def report():
    return report_document(virtual_shot("mixed").shot, identified("mixed"), version="1.2.3", shot_file=SHOT_FILE)


@pytest.fixture(scope="module")
def figures():
    return report_figures(identified("mixed"))


@pytest.fixture(scope="module")
def pdf(report, figures):
    return report_pdf(report, figures)


@pytest.fixture(scope="module")
def pages(pdf):
    """The text of each sheet."""
    return [" ".join(page.extract_text().split()) for page in read(pdf).pages]


def read(pdf):
    return PdfReader(io.BytesIO(pdf), strict=True)


def text_of(pdf):
    return " ".join("\n".join(page.extract_text() for page in read(pdf).pages).split())


def unbroken(text):
    """A text as it reads wherever its lines end."""
    return re.sub(r"[-\s\u00ad]", "", text)


def objects_in(value, seen=None):
    """Everything that a PDF's object refers to."""
    seen = set() if seen is None else seen
    value = value.get_object()
    if id(value) in seen:
        return
    seen.add(id(value))
    if isinstance(value, DictionaryObject):
        yield value
        for one in value.values():
            yield from objects_in(one, seen)
    elif isinstance(value, list):
        for one in value:
            yield from objects_in(one, seen)


@pytest.mark.whole_way
def test_it_says_that_it_is_a_pdf_a_3b_and_what_its_colours_are(pdf):
    root = read(pdf).trailer["/Root"]
    metadata = root["/Metadata"].get_object().get_data().decode("utf-8")
    assert "<pdfaid:part>3</pdfaid:part>" in metadata
    assert "<pdfaid:conformance>B</pdfaid:conformance>" in metadata
    (intent,) = root["/OutputIntents"]
    assert intent["/S"] == "/GTS_PDFA1"
    assert intent["/DestOutputProfile"].get_object().get_data()


@pytest.mark.whole_way
def test_nothing_in_it_runs_or_leads_elsewhere_and_its_fonts_are_in_it(pdf):
    keys, fonts = set(), []
    for one in objects_in(read(pdf).trailer["/Root"]):
        keys |= set(one)
        if one.get("/Type") == "/FontDescriptor":
            fonts.append(one)
    assert not keys & {"/JS", "/JavaScript", "/URI", "/Launch", "/AA", "/OpenAction"}
    assert fonts
    assert all({"/FontFile", "/FontFile2", "/FontFile3"} & set(one) for one in fonts)


@pytest.mark.indispensable("a page on paper")
def test_the_report_is_embedded_byte_for_byte(pdf, pages, report, tmp_path):
    reader = read(pdf)
    assert list(reader.attachments) == ["report.json"]
    (content,) = reader.attachments["report.json"]
    assert content == write_document(tmp_path, report).read_bytes()
    assert hashlib.sha256(content).hexdigest() in " ".join(pages[-2:])
    (file,) = [one for one in objects_in(reader.trailer["/Root"]["/AF"]) if one.get("/Type") == "/Filespec"]
    assert file["/AFRelationship"] == "/Source"


@pytest.mark.whole_way
def test_it_has_the_same_bytes_when_it_is_made_again(pdf, report, figures):
    assert report_pdf(json.loads(json.dumps(report)), figures) == pdf


@pytest.mark.whole_way
def test_its_date_is_the_shots_and_of_a_shot_without_one_none_of_today(report):
    shot = report | {"started": "2026-11-20T09:12:44.120+01:00"}
    assert read(report_pdf(shot, [])).metadata.creation_date.isoformat() == "2026-11-20T08:12:44+00:00"
    for unknown in (None, "no date", "1815-06-18T11:35:00"):
        assert read(report_pdf(report | {"started": unknown}, [])).metadata.creation_date.year == 1970


@pytest.mark.whole_way
def test_it_has_what_an_archive_asks_for_on_full_pages(pages, report, figures):
    assert 4 <= len(pages) <= 8
    for number, page in enumerate(pages, 1):
        assert f"{number} of {len(pages)}" in page
    first, whole = pages[0], " ".join(pages)
    assert first.index(f"{report['started']} ({report['started_source']})") < first.index("VALID")
    assert "relative percentage error (RPE)" in first
    assert f"{report['mass']['value']:.1f} ± " in first
    peak_mpa, u_mpa = re.search(r"peak breech pressure ([\d.]+) ± ([\d.]+) MPa", first).groups()
    assert float(peak_mpa) == pytest.approx(1e-6 * report["peaks"]["breech_pressure_pa"], abs=0.005)
    low_pa, high_pa = report["peaks_U95"]["breech_pressure_pa"]
    assert float(u_mpa) == pytest.approx(0.5e-6 * (high_pa - low_pa), abs=0.01)
    assert all(" ".join(figure.title.split()) in whole for figure in figures)
    passed = sum(row["verdict"] == "ok" for row in report["quality"])
    assert f"{passed} checks passed" in whole
    assert "ab" * 32 in whole
    assert all(unbroken(row["source"]) in unbroken(whole) for row in report["budget"])


@pytest.mark.whole_way
def test_units_and_signs_are_those_of_the_page(pages):
    whole = " ".join(pages)
    assert "m/s²" in whole
    assert "m/s^2" not in whole
    assert not re.search(r"(?<=\s)-\d", whole)


@pytest.mark.whole_way
def test_the_terms_of_its_texts_and_the_methods_in_its_tables_are_explained_at_its_end(pages):
    explained = unbroken(" ".join(pages[-2:]).partition("Terms")[2])
    for name in ("RPE", "reverse", "breech", "Eₙ", "F'", "Welch-Satterthwaite"):
        assert unbroken(f"{name}: ") in explained, name
    assert "EWMA" not in explained


@pytest.mark.whole_way
def test_sources_that_the_page_folds_are_listed_and_not_counted(pages, report):
    text = unbroken(" ".join(pages))
    assert all(unbroken(row["source"]) in text for row in report["budget"])
    assert "moretogether" not in text


@pytest.mark.whole_way
def test_figures_are_vectors(pdf):
    kinds = {one.get("/Subtype") for one in objects_in(read(pdf).trailer["/Root"])}
    assert "/Image" not in kinds


@pytest.mark.whole_way
def test_names_from_files_are_typeset_as_they_are_spelled_and_never_obeyed(report):
    evil = {
        "shot": HOSTILE, "rig": HOSTILE, "reasons": [HOSTILE, "x" * 5000], "notes": [HOSTILE], "valid": False,
        "budget": [{"source": HOSTILE, "u_kg": 1.0}],
        "quality": [{"channel": HOSTILE, "check": HOSTILE, "verdict": "fail", "detail": HOSTILE}],
        "provenance": {"version": "1", "parameters": {HOSTILE: HOSTILE}, "inputs": [{"file": HOSTILE, "sha256": "0"}]},
    }  # fmt: skip
    panel = Panel(HOSTILE, (Trace(HOSTILE, [0.0, 1.0], [0.0, 1.0], "filtered"),))
    text = text_of(report_pdf(report | evil, [Figure("k", HOSTILE, HOSTILE, HOSTILE, (panel,))]))
    for word in ('#read("/etc/passwd")', "*b*", "_i_", "$x$", "[c]", "//", "/*"):
        assert text.count(word) >= 9
    assert "[U+5C04][U+6483][U+1F921]" in text
    assert "root:" not in text


def test_a_report_of_nothing_but_its_verdict_can_be_printed():
    bare = {
        "schema": "recoil-daq/report/1", "shot": "1", "rig": "r", "valid": False, "reasons": [],
        "mass": {"value": None, "u": None, "U95": None, "specification": None}, "rpe_percent": None,
        "provenance": {"version": "1", "inputs": []},
    }  # fmt: skip
    text = text_of(report_pdf(bare, []))
    assert "NOT VALID no number" in text


def test_a_target_has_a_paper_copy_too():
    quantity = Quantity("stiffness of the ground", "k", 3.25e7, 4.0e5, "N/m", "load on deflection", 3.0e7)
    found = TargetResult(
        "stiffness", "Stiffness", "By inverse dynamics.", (quantity,), (SMALL,),
        tables=(Table("Supports", "What each tells.", ("support", "rows"), (("ground", "38"),)),),
        reasons=(Reason(ReasonCode.MODEL, "ground", "it slipped"),),
        parameters={"bands": {"ground": {"low_pass_hz": 80.0}}},
    )  # fmt: skip
    document = target_document(virtual_shot("mixed").shot, found, version="1.2.3", shot_file=SHOT_FILE)
    pdf = target_pdf(document, found.figures)
    text = text_of(pdf)
    for said in ("NOT VALID", "it slipped", "stiffness of the ground", "Supports", "bands.ground.low_pass_hz 80"):
        assert said in text
    assert list(read(pdf).attachments) == ["stiffness.json"]


@pytest.mark.whole_way
def test_a_campaign_has_its_shots_and_only_the_charts_that_fired():
    campaign = combine(campaign_of((0.0, 120.0) * 4, seed=4).shots)
    document = campaign_document(campaign, version="1.2.3", inputs=[], parameters={})
    figures = campaign_figures(campaign, None)
    quiet = replace(SMALL, key="quiet", title="Quiet chart", folded=True)
    rung = Trace("fired", [0.0], [0.5], "marks")
    loud = replace(SMALL, key="loud", title="Loud chart", folded=True, panels=(Panel("y, m", (rung,)),))
    pdf = campaign_pdf(document, [*(one for one in figures if not one.folded), quiet, loud])
    text = text_of(pdf)
    assert "Loud chart" in text
    assert "Quiet chart" not in text
    assert "control charts of 1 sensors, in which nothing fired" in text
    assert all(one["shot"] in text for one in document["shots"])
    assert list(read(pdf).attachments) == ["campaign.json"]
    assert campaign_pdf(document, figures) == campaign_pdf(document, figures)


@pytest.mark.parametrize("clock", ["DAQ/1", "../../../elsewhere", "..\\..\\x", "a:b?*|<>", "Uhr µ"])
def test_a_figure_of_any_clock_has_a_file_in_its_folder(tmp_path, clock):
    write_figures(tmp_path, [replace(SMALL, key=f"alignment-{clock}")])
    names = [path.name for path in (tmp_path / "figures").iterdir()]
    assert len(names) == 2
    assert not set("".join(names)) & set('/\\:?*|<>"')


def test_each_figure_is_written_as_vectors_and_as_a_picture(tmp_path):
    write_figures(tmp_path, [SMALL, replace(SMALL, key="l")], "p-")
    names = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert names == ["p-k.png", "p-k.svg", "p-l.png", "p-l.svg"]
    assert (tmp_path / "figures" / "p-k.svg").read_text("utf-8") == figure_svg(SMALL)
    picture = (tmp_path / "figures" / "p-k.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert int.from_bytes(picture[16:20]) == pytest.approx(180 / 25.4 * 200, abs=2)
    write_figures(tmp_path, [])


def test_what_typst_refuses_is_one_line():
    with pytest.raises(StoreError, match=r"cannot be typeset.*leave out --pdf") as caught:
        typeset.pdf_bytes({}, [], ("a", b"{}"), None)
    assert "\n" not in str(caught.value)


def test_the_extra_is_named_where_it_is_missing(monkeypatch):
    monkeypatch.setattr(typeset, "PDF", Extra("pdf", "no_such_module", "typst>=0.15"))
    typeset.refuse_without_typst(pdf=False, figures=False)
    for option in ("pdf", "figures"):
        with pytest.raises(StoreError, match=rf"--{option} needs, is not installed; pip install 'typst>=0.15'"):
            typeset.refuse_without_typst(**{"pdf": False, "figures": False, option: True})


NAME = "p_recuperator_left_behind_the_carriage"
LONG = (
    "delay_s 0.00042; filter_hz 800; filter_type bessel; u_zero_rel 0.001; the amplifier is shared with the breech; "
    "serial KIS-6215-2026-000000000000000000047110815; range/2026-03-02/0001_dewetron_of_the_second_recorder.csv "
)


def long_cell(column, place):
    if column.kind == "number":
        return "\N{MINUS SIGN}1234567.8"
    return {0: f"§ {NAME}", 1: LONG}.get(place, NAME if column.kind != "long" else LONG * 2)


def rows_are_whole(pdf, count):
    sheets = [page.extract_text() for page in read(pdf).pages]
    where = {word: [n for n, one in enumerate(sheets) for _ in range(one.count(word))] for word in ("§", "¶")}
    assert len(where["¶"]) == count
    return where["§"] == where["¶"]


@pytest.mark.indispensable("no cell leaves a sheet: all tables of the house")
def test_no_letter_of_any_of_our_tables_leaves_the_sheet_and_no_row_is_torn(report, monkeypatch):
    listed, count = [], 0
    for one in (*SHOT_SECTIONS, *CAMPAIGN_SECTIONS, *INDEX_SECTIONS, *SWEEP_SECTIONS):
        if one.columns:
            row = {column.key: long_cell(column, place) for place, column in enumerate(one.columns)}
            last = next(column.key for column in reversed(one.columns) if column.kind not in ("bar", "span"))
            row[last] += " ¶"
            count += 3
            listed.append(replace(one, rows=lambda _, row=row: [row] * 3, total=None, caption="", after=lambda _: ()))
    monkeypatch.setattr(paper, "sections_of", lambda _: listed)
    pdf = report_pdf(report, [])
    assert not beyond(pdf)
    assert rows_are_whole(pdf, count)


@pytest.mark.whole_way
@pytest.mark.parametrize("columns", [3, 8, 13])
def test_no_letter_of_a_targets_table_leaves_the_sheet_however_many_columns_of_long_texts_it_has(columns):
    heads = tuple(f"heading of column {k}" for k in range(columns))
    row = (f"§ {NAME}", *([LONG * 2] * (columns - 2)), f"{LONG} ¶")
    table = Table("A table", "Of long texts.", heads, (row,) * 4)
    found = TargetResult("stiffness", "Stiffness", "By inverse dynamics.", (), (), tables=(table,))
    document = target_document(virtual_shot("mixed").shot, found, version="1.2.3", shot_file=SHOT_FILE)
    pdf = target_pdf(document, [])
    assert not beyond(pdf)
    assert rows_are_whole(pdf, 4)
