"""Figures of a text: their words stay where they are when texts are put together, handed on and written down."""

from __future__ import annotations

import json
import pickle

import pytest

from recoil_acquisition.measured import Worded, beside, figures_of, measured, with_figures, worded
from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.quality_check import Check, QualityCheck

TEXT = worded("p 20 MPa reads ", measured(12.5, "MPa", ".3g"), " and ", measured(-3, "kN", "+.1f"), ".")


def words(text: str) -> list[str]:
    return [text[one.start : one.end] for one in figures_of(text)]


def test_a_text_is_the_words_of_its_pieces_and_knows_its_figures() -> None:
    assert TEXT == "p 20 MPa reads 12.5 MPa and -3.0 kN."
    assert words(TEXT) == ["12.5 MPa", "-3.0 kN"]
    assert [(one.value, one.unit) for one in figures_of(TEXT)] == [(12.5, "MPa"), (-3.0, "kN")]


def test_figures_keep_their_words_in_a_longer_text_a_check_and_its_remark() -> None:
    check = QualityCheck("channel 3 m", Check.BASELINE, "fail", worded(TEXT, " Twice: ", TEXT))
    assert words(check.remark()) == 2 * ["12.5 MPa", "-3.0 kN"]
    assert words(check.remark().again(worded("because ", check.remark()))) == 2 * ["12.5 MPa", "-3.0 kN"]


def test_figures_come_back_from_another_process_and_from_a_document() -> None:
    reason = Reason(ReasonCode.NOISE, "p", TEXT)
    assert words(pickle.loads(pickle.dumps(reason))) == words(TEXT)  # noqa: S301 - its own
    read = json.loads(json.dumps(reason.to_json()))
    assert figures_of(with_figures(read["text"], read)) == figures_of(TEXT)


@pytest.mark.parametrize("text", ["a name of 20 MPa", measured(float("nan"), "MPa", ".3g"), measured(1.0, "", ".3g")])
def test_a_text_without_figures_states_none(text: str) -> None:
    assert beside(text) == {}
    assert "figures" not in Reason(ReasonCode.NOISE, "p", text).to_json()
    assert isinstance(worded(text), Worded)
