"""The certificate of a shot and of a campaign: what is on it, that it comes again, and that each forgery is found."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from pypdf import PdfReader
from typer.testing import CliRunner

from recoil_acquisition.errors import IdentificationError, ReadError, StoreError
from recoil_daq import check_reports, identify_file
from recoil_daq.campaigns.campaign import campaign
from recoil_daq.certificates.certificate import certificate
from recoil_daq.certificates.signature import Trust
from recoil_daq.cli import app
from recoil_daq.reports.explanation import CheckedReport
from recoil_identification.report.document.report_files import sealed
from tests.builders.campaign_reports import write_report
from tests.builders.campaign_summaries import campaign_of
from tests.builders.signers import signer

HEADER = """
laboratory = "Range North, 1 Proof Road"
customer = "Programme Office, Main Street"
order = "PO-4711"
number = "K-{shot}"
issue = "2"
date = 2026-11-28
replaces = "K-0001, issue 1: the customer's name was wrong"
approval = "A. Person, head of the laboratory"
operator = "B. Person"
place = "Range 3"
item = "recoiling part no. 17, new"
received = 2026-11-20
tolerance_kg = [-inf, 60.0]
decision_rule = "guard band"
"""
CHANNEL = {
    "channel": "p", "role": "breech_pressure", "quantity": "pressure", "unit": "Pa", "signal": "AI 1", "clock": "daq",
    "recorder": "dewetron", "model": "piezo", "serial": "4711", "certificate": "D-K-17", "calibrated": "2026-01-15",
    "due": "2026-10-01", "range": [0.0, 2.5e8], "u": 0.005,
    "known_by": {"U_rel": 0.0116, "k": 2.3, "nu": 9.0}, "chain": {},
}  # fmt: skip
SHOTS = campaign_of((0.0, 120.0) * 2, seed=4).shots
pytestmark = pytest.mark.whole_way


@pytest.fixture(scope="module")
def made(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A shot, its report and its signed certificate; not to be changed."""
    folder = tmp_path_factory.mktemp("certified")
    (folder / "shots").mkdir()
    shutil.copy(stored, folder / "shots")
    (folder / "header.toml").write_text(HEADER, encoding="utf-8")
    for name in ("lab", "forger"):
        signer(folder / f"{name}.pem", "Range North")
    identify_file(folder / "shots" / "0001.h5", out=folder / "reports")
    other = HEADER.replace("K-{shot}", "K-other")
    (folder / "other.toml").write_text(other, encoding="utf-8")
    for out, header in (("certificate", "header.toml"), ("other", "other.toml")):
        certificate(folder / "reports" / "0001", folder / header, out=folder / out, sign=folder / "lab.pem")
    return folder


@pytest.fixture
def done(made: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(made, tmp_path / "done"))


def document_of(folder: Path) -> dict[str, Any]:
    """The contents of a certificate."""
    return dict(json.loads((folder / "certificate.json").read_text("utf-8")))


def sheets_of(folder: Path) -> list[str]:
    """The texts of the sheets of a certificate."""
    paper = PdfReader(io.BytesIO((folder / "certificate.pdf").read_bytes()))
    return [" ".join(sheet.extract_text().split()) for sheet in paper.pages]


def checked(done: Path, trust: Trust | None = None) -> CheckedReport:
    """What came of a certificate's check."""
    (one,) = check_reports(
        done / "certificate", workers=1, trust=Trust(signer=done / "lab.crt") if trust is None else trust
    ).reports
    return one


def test_a_certificate_has_what_was_asked_for_and_comes_again_to_the_byte(made: Path, tmp_path: Path) -> None:
    document, report = document_of(made / "certificate"), json.loads((made / "reports/0001/report.json").read_text())
    assert document["schema"] == "recoil-daq/certificate/1"
    mass, *others = document["results"]
    assert (mass["value"], mass["u"], mass["U"]) == tuple(report["mass"][key] for key in ("value", "u", "U_kg"))
    assert mass["k"] == report["uncertainty"]["coverage_factor"]
    assert {one["key"]: one["value"] for one in others} == {k: v for k, v in report["peaks"].items() if v is not None}
    assert {one["key"]: one["u"] for one in others} == {k: report["peaks_u"][k] for k in (one["key"] for one in others)}
    assert document["conformity"]["word"] == "conforms"
    assert document["not_stated"] == []
    found = checked(made)
    assert found.again
    assert found.comparison is not None
    assert [name.partition(" ")[0] for name in found.comparison.drawings] == [
        "certificate.html", "certificate.pdf", "certificate.json.sig", "certificate.pdf.sig",
    ]  # fmt: skip
    certificate(made / "reports" / "0001", made / "header.toml", out=tmp_path / "again", sign=made / "forger.pem")
    for name in ("certificate.json", "certificate.html", "certificate.pdf"):
        assert (tmp_path / "again" / name).read_bytes() == (made / "certificate" / name).read_bytes()


AUDITED = {
    "a title": "Certificate",
    "b laboratory and its address": "Range North, 1 Proof Road",
    "c place of the test": "place of the test Range 3",
    "d unique identification": "number K-0001",
    "e customer": "Programme Office, Main Street",
    "f method": "Method: The mass is that of the equation of motion",
    "g item, its identity and condition": "recoiling part no. 17, new",
    "h date of receipt": "item received 2026-11-20",
    "i date of the test": "Fired at",
    "j date of issue": "date of issue 2026-11-28",
    "l relates to the items tested": "The results relate only to the items tested",
    "m results with units": "recoiling mass",
    "n deviations from the method": "Deviations, repairs, what is taken for granted",
    "o who authorizes": "authorized by A. Person, head of",
    "7.8.2.2 software": "software: recoil-daq",
    "7.8.3.1 c uncertainty": "expanded uncertainty U = k u",
    "7.8.6.1 decision rule": "guard band (ILAC-G8",
    "7.8.6.2 results, specification, rule of the statement": "Statement of conformity: CONFORMS",
    "7.8.8.3 what it replaces": "replaces K-0001, issue 1: the customer's name was wrong",
}


def test_each_point_of_iso_17025_7_8_stands_on_the_paper_and_each_sheet_bears_the_number(made: Path) -> None:
    sheets = sheets_of(made / "certificate")
    text = " ".join(sheets)
    assert {point for point, said in AUDITED.items() if said not in text} == set()
    page = (made / "certificate" / "certificate.html").read_text("utf-8")
    plain = " ".join(unescape(re.sub(r"</?abbr[^>]*>", "", page)).split())
    shown = " ".join(re.sub(r"<[^>]*>", " ", plain).split())
    assert {point for point, said in AUDITED.items() if said not in shown} == set()
    for number, sheet in enumerate(sheets, 1):
        assert "Certificate K-0001, issue 2" in sheet
        assert f"{number} of {len(sheets)}" in sheet
    assert len(sheets) <= 4
    dated = PdfReader(io.BytesIO((made / "certificate" / "certificate.pdf").read_bytes())).metadata
    assert dated is not None
    assert str(dated.creation_date).startswith("2026-11-28")


def _digit(path: Path, pattern: str) -> None:
    """Change the last digit of what a pattern finds first in a file."""
    content = path.read_bytes()
    found = re.search(pattern.encode(), content)
    assert found is not None
    place = found.end() - 1
    digit = b"%d" % ((content[place] - 48 + 1) % 10)
    path.write_bytes(content[:place] + digit + content[place + 1 :])


def _resealed(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    document = document_of(folder)
    change(document)
    (folder / "certificate.json").write_text(json.dumps(sealed(document), indent=2) + "\n", encoding="ascii")


def _flip(path: Path, place: int) -> None:
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(bytes(content))


def _copied(name: str, *others: str) -> Callable[[Path], None]:
    def copy(done: Path) -> None:
        for one in (name, *others):
            shutil.copy(done / "other" / one, done / "certificate" / one)

    return copy


def _swap_signatures(done: Path) -> None:
    one, other = (done / "certificate" / f"certificate.{kind}.sig" for kind in ("json", "pdf"))
    one_content, other_content = one.read_bytes(), other.read_bytes()
    one.write_bytes(other_content)
    other.write_bytes(one_content)


def _forger(done: Path) -> None:
    """Make it anew with a better mass limit and another key: all of one piece."""
    (done / "header.toml").write_text(HEADER.replace("60.0", "90.0"), encoding="utf-8")
    certificate(
        done / "reports" / "0001", done / "header.toml", out=done / "certificate", sign=done / "forger.pem",
        overwrite=True,
    )  # fmt: skip


def _unsigned(done: Path) -> None:
    (done / "header.toml").write_text(HEADER.replace("60.0", "90.0"), encoding="utf-8")
    certificate(done / "reports" / "0001", done / "header.toml", out=done / "certificate", overwrite=True)


FORGERIES: dict[str, tuple[Callable[[Path], object], str]] = {
    "a digit of the page": (
        lambda d: _digit(d / "certificate/certificate.html", r'class="n">\d\d'), "certificate.html",
    ),
    "a name on the page": (
        lambda d: _resealed_page(d, "Programme Office", "Another Office"), "certificate.html",
    ),
    "a byte of the paper": (lambda d: _flip(d / "certificate/certificate.pdf", -2000), "certificate.pdf"),
    "a byte behind the paper": (lambda d: _append(d / "certificate/certificate.pdf"), "certificate.pdf"),
    "a digit of the document": (
        lambda d: _digit(d / "certificate/certificate.json", r'"U": \d+\.\d{4}'), "results",
    ),
    "a mass, sealed anew": (lambda d: _resealed(d / "certificate", _heavier), "results"),
    "the word, sealed anew": (
        lambda d: _resealed(d / "certificate", lambda c: c["conformity"].update(word="not shown")), "conformity.word",
    ),
    "the number, sealed anew": (
        lambda d: _resealed(d / "certificate", lambda c: c["issued"].update(number="K-0002")), "certificate.html",
    ),
    "the rule, sealed anew": (
        lambda d: _resealed(d / "certificate", lambda c: c["issued"].update(decision_rule="simple")), "conformity.rule",
    ),
    "a calibration, sealed anew": (
        lambda d: _resealed(d / "certificate", lambda c: c["calibrations"][0].update(due="2099-01-01")), "calibrations",
    ),
    "the digest of a shot file, sealed anew": (
        lambda d: _resealed(d / "certificate", lambda c: c["provenance"]["inputs"][1].update(sha256="0" * 64)),
        "provenance.inputs",
    ),
    "a byte of a signature": (lambda d: _flip(d / "certificate/certificate.json.sig", -5), "certificate.json.sig"),
    "signatures exchanged": (_swap_signatures, "certificate.json.sig"),
    "a signature taken away": (
        lambda d: (d / "certificate/certificate.pdf.sig").unlink(), "certificate.pdf.sig",
    ),
    "another certificate's page": (_copied("certificate.html"), "certificate.html"),
    "another certificate's paper with its signature": (
        _copied("certificate.pdf", "certificate.pdf.sig"), "certificate.pdf",
    ),
    "another certificate's document with its signature": (
        _copied("certificate.json", "certificate.json.sig"), "certificate.html",
    ),
    "all made anew and signed by another key": (_forger, "not by whom --signer names"),
    "all made anew without a signature": (_unsigned, "certificate.json.sig"),
    "a byte of the shot file": (lambda d: _flip(d / "shots/0001.h5", -100), "0001.h5"),
}  # fmt: skip


def _heavier(document: dict[str, Any]) -> None:
    document["results"][0]["value"] += 10.0


def _resealed_page(done: Path, one: str, other: str) -> None:
    path = done / "certificate" / "certificate.html"
    path.write_text(path.read_text("utf-8").replace(one, other), encoding="utf-8")


def _append(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"\n")


@pytest.mark.parametrize("forgery", FORGERIES.values(), ids=FORGERIES)
def test_each_forgery_is_found_and_named(done: Path, forgery: tuple[Callable[[Path], object], str]) -> None:
    forge, named = forgery
    forge(done)
    found = checked(done)
    assert not found.again
    assert found.comparison is not None
    assert named in " ".join(map(str, found.comparison.differences))


GONE: dict[str, Callable[[Path], object]] = {
    "changed": lambda d: _digit(d / "reports/0001/report.json", r'"U_kg": \d+\.\d{4}'),
    "taken away": lambda d: shutil.rmtree(d / "reports"),
    "named by a way out of the folder": lambda d: _resealed(
        d / "certificate", lambda c: c["provenance"]["inputs"][0].update(file="../../etc/passwd")
    ),
    "named by a number": lambda d: _resealed(d / "certificate", lambda c: c["provenance"].update(inputs=[3])),
}


@pytest.mark.parametrize("spoil", GONE.values(), ids=GONE)
def test_a_certificate_without_its_document_cannot_be_made_again_and_that_is_said(done: Path, spoil) -> None:
    spoil(done)
    found = checked(done)
    assert not found.again
    assert found.comparison is None
    assert "certificate" in found.fault
    ran = CliRunner().invoke(app, ["explain", str(done / "certificate"), "--check"])
    assert ran.exit_code == 3
    assert "Traceback" not in ran.output


def test_no_certificate_is_made_of_a_report_that_was_changed(done: Path) -> None:
    _digit(done / "reports/0001/report.json", r'"U_kg": \d+\.\d{4}')
    with pytest.raises(ReadError, match="was changed after it was written"):
        certificate(done / "reports" / "0001", done / "header.toml", out=done / "changed")
    with pytest.raises(ReadError, match="identify it first"):
        certificate(done / "shots" / "0001.h5", done / "header.toml", out=done / "changed")
    with pytest.raises(ReadError, match="neither a report nor the answer of a campaign"):
        certificate(done / "shots", done / "header.toml", out=done / "changed")
    assert not (done / "changed").exists()


def test_a_shot_file_that_is_not_here_is_said_and_whose_signature_it_is_too(done: Path) -> None:
    shutil.rmtree(done / "shots")
    (done.parent / "shots").mkdir()
    (done.parent / "shots" / "0001.h5").write_bytes(b"another day's")
    found = checked(done, Trust())
    assert found.again
    assert found.comparison is not None
    said = " ".join(map(str, found.comparison.not_compared))
    assert "0001.h5 was not compared" in said
    assert "--signer tells whose it should be" in said


def test_a_header_without_a_number_and_one_with_little_else(done: Path) -> None:
    bare = done / "bare.toml"
    bare.write_text('laboratory = "Range North"\n', encoding="utf-8")
    with pytest.raises(ReadError, match="states none"):
        certificate(done / "reports" / "0001", bare, out=done / "bare")
    bare.write_text('number = "K-{campaign}"\n', encoding="utf-8")
    with pytest.raises(ReadError, match="this document is of a shot"):
        certificate(done / "reports" / "0001", bare, out=done / "bare")
    bare.write_text('number = "K-9"\n', encoding="utf-8")
    ran = CliRunner().invoke(
        app, ["certificate", str(done / "reports/0001"), "--header", str(bare), "--out", str(done / "bare")]
    )
    assert ran.exit_code == 0, ran.output
    assert "not stated in the header" in ran.output
    document = document_of(done / "bare")
    assert document["conformity"]["word"] == "not stated"
    assert set(document["not_stated"]) >= {"laboratory", "customer", "date", "approval"}
    assert " ".join(sheets_of(done / "bare")).count("not stated") >= len(document["not_stated"])


def test_nothing_is_overwritten_unasked_and_an_older_signature_goes_with_its_file(done: Path) -> None:
    with pytest.raises(StoreError):
        certificate(done / "reports" / "0001", done / "header.toml", out=done / "certificate")
    certificate(done / "reports" / "0001", done / "header.toml", out=done / "certificate", overwrite=True)
    assert not list((done / "certificate").glob("*.sig"))


def _not_valid(document: dict[str, Any]) -> dict[str, Any]:
    return sealed({**document, "valid": False, "reasons": ["the gauge was clipped"]})


def test_of_a_result_that_is_not_valid_there_is_none_without_a_concession(done: Path) -> None:
    path = done / "reports" / "0001" / "report.json"
    path.write_text(json.dumps(_not_valid(json.loads(path.read_text("utf-8")))), encoding="utf-8")
    words = ["certificate", str(path), "--header", str(done / "header.toml"), "--out", str(done / "invalid")]
    ran = CliRunner().invoke(app, words)
    assert (ran.exit_code, ran.output.count("\n")) == (1, 1)
    assert "the gauge was clipped" in ran.output
    assert not (done / "invalid").exists()
    with pytest.raises(IdentificationError):
        certificate(path, done / "header.toml", out=done / "invalid")
    conceded = done / "conceded.toml"
    conceded.write_text(HEADER + 'concession = "accepted by C. Person: only the peak is needed"\n', encoding="utf-8")
    words[3] = str(conceded)
    assert CliRunner().invoke(app, words).exit_code == 1
    document = document_of(done / "invalid")
    assert (document["conformity"]["word"], document["conformity"]["probability"]) == ("not stated", None)
    text = " ".join(sheets_of(done / "invalid"))
    for said in ("NOT VALID", "the gauge was clipped", "accepted by C. Person", "NOT STATED"):
        assert said in text


@pytest.fixture(scope="module")
def combined(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of four shots, one of them set aside and one fired after a calibration was due, as a person says."""
    folder = tmp_path_factory.mktemp("combined")
    for number, shot in enumerate(SHOTS):
        stated = {"on": "2026-10-04", "of": "given"} if number == 3 else {"on": "2026-09-30", "of": "start"}
        write_report(
            folder / "reports", shot, started="2026-09-30T10:00:00", calibration_day=stated,
            channels=[CHANNEL],
            issued={"laboratory": "North", "customer": "C", "number": "1", "concession": f"of {shot.name}"},
            peaks={"breech_pressure_pa": 2e8, "recoil_travel_m": 0.8}, peaks_u={"breech_pressure_pa": 1e6},
            peaks_U95={"breech_pressure_pa": [1.98e8, 2.02e8]},
        )  # fmt: skip
    (folder / "header.toml").write_text('number = "K-{campaign}"\ntolerance_kg = [-20, inf]\n', encoding="utf-8")
    campaign(folder / "reports", out=folder / "autumn")
    certificate(folder / "autumn", folder / "header.toml", out=folder / "certificate")
    return folder


def test_a_campaign_s_certificate_has_each_shot_and_takes_no_identity_over(combined: Path) -> None:
    document = document_of(combined / "certificate")
    assert document["issued"] == {
        "laboratory": "North", "customer": "C", "number": "K-autumn", "tolerance_kg": [-20.0, None],
    }  # fmt: skip
    assert [one["shot"] for one in document["shots"]] == [shot.name for shot in SHOTS]
    assert [one["added_mass_kg"] for one in document["shots"]] == [0.0, 120.0, 0.0, 120.0]
    assert [one["concession"] for one in document["shots"]] == [f"of {shot.name}" for shot in SHOTS]
    (calibration,) = document["calibrations"]
    assert (calibration["certificate"], calibration["in_force"]) == ("D-K-17", False)
    assert (calibration["U_rel"], calibration["k"], calibration["nu"]) == (0.0116, 2.3, 9.0)
    assert "3 days before" in calibration["said"][0]
    text = " ".join(sheets_of(combined / "certificate"))
    for said in (
        "K-autumn",
        "D-K-17",
        "1.2 % 2.3 9",
        "200.0 ± 2.0",
        "800 ± –",
        "1 of 1 calibrations were not in force",
    ):
        assert said in text
    assert checked(combined, Trust()).again


def test_a_campaign_s_certificate_rests_on_the_reports_as_they_were(combined: Path, tmp_path: Path) -> None:
    done = Path(shutil.copytree(combined, tmp_path / "done"))
    report = done / "reports" / SHOTS[1].name / "report.json"
    report.write_text(report.read_text("utf-8").replace("2026-09-30", "2026-09-29"), encoding="utf-8")
    found = checked(done, Trust())
    assert found.comparison is None
    assert f"the report of shot {SHOTS[1].name}" in found.fault
    (done / "header.toml").write_text('number = "K-{shot}"\n', encoding="utf-8")
    with pytest.raises(ReadError, match="this document is of a campaign"):
        certificate(combined / "autumn", done / "header.toml", out=done / "another")
