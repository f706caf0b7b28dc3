"""The identity of a report: the rig's table, a header file before it, and what is refused of either."""

from __future__ import annotations

import base64
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError, RigError
from recoil_identification.report.document.report_files import to_json
from recoil_rigs.rig import find_rig, parse_rig
from recoil_rigs.tables.issue import CAMPAIGN, SHOT, Issue, read_header

PNG = b"\x89PNG\r\n\x1a\n" + bytes(20)
LOGO = "data:image/png;base64," + base64.b64encode(PNG).decode()


def rig_with(report: str):
    path = find_rig("field-2013")
    return parse_rig(path.read_text("utf-8").replace("[twin]\n", f"[report]\n{report}\n[twin]\n"), path)


def test_a_rig_states_who_issues_its_reports_and_the_tolerance():
    rig = rig_with('laboratory = "North"\norder = "4711"\ntolerance_kg = [-4.0, 4.0]')
    assert rig.report == Issue(laboratory="North", order="4711", tolerance_kg=(-4.0, 4.0))
    assert parse_rig(find_rig("field-2013").read_text("utf-8"), find_rig("field-2013")).report == Issue()


@pytest.mark.parametrize(
    ("report", "said"),
    [
        ("tolerance_kg = [4.0, -4.0]", "must be [lower, upper]"),
        ("tolerance_kg = 4.0", "report.tolerance_kg"),
        ('logo = "logo.png"', "given with --header"),
        ('logo = "data:image/png;base64,AAAA"', "is no PNG picture"),
        ('labratory = "North"', "laboratory"),
        ("number = 4711", "report.number"),
    ],
)
def test_what_no_report_can_have_is_a_fault_of_the_rig(report, said):
    with pytest.raises(RigError) as caught:
        rig_with(report)
    assert said in str(caught.value)


def test_a_header_file_goes_before_the_rig_and_brings_its_picture(tmp_path: Path):
    (tmp_path / "logo.png").write_bytes(PNG)
    (tmp_path / "header.toml").write_text('laboratory = "South"\nlogo = "logo.png"\n', encoding="utf-8")
    header = read_header(tmp_path / "header.toml")
    assert header.over(Issue(laboratory="North", order="4711")) == Issue(laboratory="South", order="4711", logo=LOGO)
    (tmp_path / "table.toml").write_text('[report]\nlaboratory = "South"\n', encoding="utf-8")
    assert read_header(tmp_path / "table.toml") == Issue(laboratory="South")
    assert Issue.model_validate(header.to_json()) == header


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("laboratory = ", "TOML"),
        ('laboratory = ""', "laboratory"),
        ('logo = "nowhere.png"', "no such picture"),
        ('logo = "header.toml"', "is no picture of a logo"),
    ],
)
def test_a_header_file_at_fault_is_refused_by_name(tmp_path: Path, text, said):
    (tmp_path / "header.toml").write_text(text, encoding="utf-8")
    with pytest.raises((ReadError, RigError)) as caught:
        read_header(tmp_path / "header.toml")
    assert said in str(caught.value)
    with pytest.raises(ReadError, match="no such header file"):
        read_header(tmp_path / "nowhere.toml")


@pytest.mark.parametrize("text", ["[[report]]\n", "report = 3\n", "report = []\n", 'report = "x"\n'])
def test_a_header_whose_report_is_no_table_is_a_fault(tmp_path: Path, text: str) -> None:
    (tmp_path / "header.toml").write_text(text, encoding="utf-8")
    with pytest.raises(RigError, match="must be a table"):
        read_header(tmp_path / "header.toml")


def test_a_logo_of_a_name_that_no_file_has_is_no_picture(tmp_path: Path) -> None:
    (tmp_path / "header.toml").write_text(f'logo = "{"x" * 5000}"\n', encoding="utf-8")
    with pytest.raises(ReadError, match="no such picture"):
        read_header(tmp_path / "header.toml")


@pytest.mark.parametrize(
    ("report", "said"),
    [
        ("tolerance_kg = [nan, 4.0]", "must be [lower, upper]"),
        ("tolerance_kg = [-inf, inf]", "with one limit"),
        ('decision_rule = "shared risk"', '"simple", "guard band", or a probability'),
        ("decision_rule = 0.5", "between 0.5 and 1"),
        ("decision_rule = 1", "between 0.5 and 1"),
        ("decision_rule = true", "decision_rule"),
        ('number = "R-{day}"', "{shot} or {campaign}"),
        ('date = "soon"', "report.date"),
    ],
)
def test_what_nobody_can_have_agreed_is_a_fault(report, said):
    with pytest.raises(RigError) as caught:
        rig_with(report)
    assert said in str(caught.value)


def test_one_side_may_be_open_and_documents_say_so_without_a_number():
    for limits, written in (("[-inf, 4.0]", [None, 4.0]), ("[-4.0, inf]", [-4.0, None])):
        stated = rig_with(f"tolerance_kg = {limits}\ndate = 2026-11-26").report
        assert to_json(stated.to_json()) == {"tolerance_kg": written, "date": "2026-11-26"}
        assert Issue.model_validate(to_json(stated.to_json())) == stated


def test_a_number_has_the_name_of_its_document_and_no_other_document_takes_it_over():
    one = Issue(laboratory="North", number="R-{shot}", issue="2", date="2026-11-26", approval="A", concession="B")
    assert one.named(SHOT, "0001").number == "R-0001"
    assert Issue(number="TR-42").named(CAMPAIGN, "spring").number == "TR-42"
    assert Issue(number="R-{campaign}").named(CAMPAIGN, "spring").number == "R-spring"
    with pytest.raises(ReadError, match=r"has \{shot\}, and this document is of a campaign"):
        one.named(CAMPAIGN, "spring")
    assert one.of_another() == Issue(laboratory="North")


def test_a_number_without_its_shot_in_a_rig_is_doubted():
    (doubt,) = (one for one in rig_with('number = "TR-42"').warnings if "every shot" in str(one))
    assert str(doubt).startswith("report.number")
    assert not [one for one in rig_with('number = "TR-{shot}"').warnings if "every shot" in str(one)]
