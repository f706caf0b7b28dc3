"""Page and paper copy read one list of sections: what stands in it stands in both, and nothing else does."""

from __future__ import annotations

import io
from dataclasses import replace

import pytest
from pypdf import PdfReader

from recoil_identification.report import sections
from recoil_identification.report.content.section import ALL_OTHERS, Column, Section, parts_of
from recoil_identification.report.document.report_files import to_json
from recoil_identification.report.figure.figure import Figure, Panel, Trace
from recoil_identification.report.page.html import render_page
from recoil_identification.report.paper.paper import report_pdf
from tests.builders.page_elements import PageElements
from tests.identification.report.page.test_report_html import a_report
from tests.test_contributing import recipe

FIGURE = Figure("a", "A", "Caption.", "x, s", (Panel("y, m", (Trace("t", [0.0, 1.0], [0.0, 1.0], "filtered"),)),))


def page_and_paper(report):
    paper = PdfReader(io.BytesIO(report_pdf(to_json(report), [])))
    sheets = " ".join("\n".join(sheet.extract_text() for sheet in paper.pages).split())
    return " ".join(PageElements(render_page(report, [])).text.split()), sheets


@pytest.mark.whole_way
def test_the_section_of_the_recipe_stands_on_page_and_paper(monkeypatch):
    section = recipe("report section")["ENERGY"]
    report = a_report(peaks={"impulse_n_s": 7604.0, "recoil_velocity_m_s": 8.5})
    assert all(section.title not in text for text in page_and_paper(report))
    monkeypatch.setattr(sections, "SHOT_SECTIONS", (*sections.SHOT_SECTIONS, section))
    for text in page_and_paper(report):
        assert section.title in text
        assert "half of impulse times velocity" in text
        assert "32.3" in text
    assert all(section.title not in text for text in page_and_paper(a_report()))


def test_every_table_of_a_report_has_the_same_heads_and_cells_on_page_and_paper():
    report = a_report()
    page, paper = page_and_paper(report)
    for part in parts_of(sections.sections_of(report), report, []):
        for row in part.rows:
            cells = [str(row[one.key]) for one in part.columns if one.kind != "bar" and row[one.key] != ""]
            assert all(cell in page for cell in cells), part.title
            assert all(cell in paper for cell in cells), part.title


@pytest.mark.parametrize("key", ["mass", "b", "alignment-camera"])
def test_a_figure_stands_where_its_key_is_named_and_where_all_others_are_if_it_is_not(key):
    listed = (Section("x", figure="mass"), Section("y", figure=ALL_OTHERS), Section("z", figure="alignment-*"))
    place = {"mass": 0, "b": 1, "alignment-camera": 2}[key]
    figures = [replace(FIGURE, key=one) for one in ("alignment-camera", "b", "mass")]
    parts = parts_of(listed, {}, figures)
    assert [part.figures[0][1].key for part in parts][place] == key
    assert [part.anchor for part in parts] == ["figure-2", "figure-1", "figure-0"]


def test_what_has_nothing_to_show_gives_no_part_and_an_empty_column_is_left_out():
    columns = (Column("a", "A"), Column("b", "B"))
    section = Section("s", "S", columns=columns, rows=lambda document: document["rows"], sparse=True)
    assert parts_of((section,), {"rows": []}, []) == []
    (part,) = parts_of((section,), {"rows": [{"a": "1", "b": ""}, {"a": "2", "b": "–", "folded": True}]}, [])
    assert [one.key for one in part.columns] == ["a"]
    assert [len(part.rows), len(part.folded)] == [1, 1]


@pytest.mark.parametrize("listed", [sections.SHOT_SECTIONS, sections.CAMPAIGN_SECTIONS])
def test_the_keys_of_a_list_are_anchors_and_stand_once(listed):
    keys = [section.key for section in listed]
    twice = {key for key in keys if keys.count(key) > 1}
    assert not twice, f"a section is added to a list once: {twice}"
    assert all(len({column.key for column in section.columns}) == len(section.columns) for section in listed)
