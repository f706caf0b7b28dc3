"""Terms are explained where they stand and at the end, and numbers and units are written in one way."""

import pytest

from recoil_identification.report.content.glossary import ONLY_NAMED, TERMS, Glossary, notation
from recoil_identification.report.page.html import render_page
from tests.builders.page_elements import PageElements
from tests.identification.report.page.test_report_html import a_figure, a_report


def test_a_term_is_explained_at_its_first_place_in_a_text_and_listed_at_the_end():
    glossary = Glossary()
    written = glossary.text("The RPE of a low-pass; again the RPE, u 0.3 kg & <b>")
    assert written.count("<abbr") == 3
    assert written.endswith(" kg &amp; &lt;b&gt;")
    assert [name for name, _ in glossary.met] == ["low-pass", "RPE", "u"]
    assert "<abbr" in glossary.text("memory (window)")
    assert dict(glossary.met)["RPE"].startswith("Relative percentage error")


@pytest.mark.parametrize("text", ["run u-boat", "specifications2", "a reversed paper", "mu 3", "x_u 3", "camera"])
def test_what_only_looks_like_a_term_is_left_alone(text):
    assert Glossary().text(text) == text


def test_every_sentence_is_one_and_every_word_of_every_day_is_a_term():
    for term, sentence in TERMS.items():
        assert sentence.endswith((".", ").")), term
        assert "\n" not in sentence
    assert set(TERMS) > ONLY_NAMED


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("-3.5 m/s^2 and 12 rad/s2", "−3.5 m/s² and 12 rad/s²"),
        ("u 26.9 us, offset -14.66 ms", "u 26.9 µs, offset −14.66 ms"),
        ("[-5, 5], (-1), +-2 and 1e-09", "[−5, 5], (−1), +−2 and 1e−09"),
        ("2026-11-20T09:00-05:00, shot-0001, a1-2, --window-s 0.02", None),
        ("0001_can.blf of us all, m/s2x", None),
        ("N s2/m2", "N s²/m²"),
    ],
)
def test_units_and_minus_signs_are_written_in_one_way(text, written):
    assert notation(text) == (written or text)


def test_a_page_lists_each_term_that_it_explains_and_no_other():
    parsed = PageElements(render_page(a_report(), [a_figure()]))
    explained = {attributes["title"] for tag, attributes in parsed.elements if tag == "abbr"}
    listed = {sentence for sentence in TERMS.values() if sentence in parsed.text.partition("Terms")[2]}
    assert explained == listed
    assert TERMS["RPE"] in explained
    assert TERMS["EWMA"] not in parsed.text
