"""The certificate as a DCC: its elements in the order of the schema, its values those of the document."""

from __future__ import annotations

import json
import shutil
from copy import deepcopy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from typer.testing import CliRunner

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_daq import check_reports, identify_file
from recoil_daq.campaigns.campaign import campaign
from recoil_daq.certificates.certificate import certificate
from recoil_daq.certificates.dcc import UNITS, dcc_bytes
from recoil_daq.certificates.signature import Trust
from recoil_daq.cli import app
from recoil_daq.reports.explanation import CheckedReport
from recoil_identification.report.content.tables import PEAKS
from recoil_identification.report.document.report_files import sealed
from recoil_rigs.tables.digital_certificate import is_digital_certificate, read_digital_certificate
from tests.builders.campaign_reports import write_report
from tests.builders.signers import signer
from tests.recoil_daq.certificates.test_certificate import CHANNEL, HEADER
from tests.recoil_daq.certificates.test_certificate import SHOTS as CAMPAIGN_SHOTS

NS = {"d": "https://ptb.de/dcc", "s": "https://ptb.de/si"}
STATED = HEADER + 'country = "SE"\nfired_from = 2026-11-24\nfired_until = 2026-11-25\n'
pytestmark = pytest.mark.whole_way


@pytest.fixture(scope="module")
def made(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A shot, its report and its signed certificate with a DCC; not to be changed."""
    folder = tmp_path_factory.mktemp("digital")
    (folder / "shots").mkdir()
    shutil.copy(stored, folder / "shots")
    (folder / "header.toml").write_text(STATED, encoding="utf-8")
    signer(folder / "lab.pem", "Range North")
    identify_file(folder / "shots" / "0001.h5", out=folder / "reports")
    certificate(
        folder / "reports/0001", folder / "header.toml", out=folder / "certificate", sign=folder / "lab.pem", dcc=True
    )
    return folder


@pytest.fixture
def done(made: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(made, tmp_path / "done"))


def document_of(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "certificate/certificate.json").read_text("utf-8")))


def checked(done: Path) -> CheckedReport:
    (one,) = check_reports(done / "certificate", workers=1, trust=Trust(signer=done / "lab.crt")).reports
    return one


def parsed(content: bytes) -> ET.Element:
    return ET.fromstring(content)  # noqa: S314 - it is our own


def text_of(root: ET.Element, path: str) -> str:
    found = root.find(path, NS)
    assert found is not None, path
    return " ".join(" ".join(found.itertext()).split())


def values_of(data: ET.Element) -> dict[str, dict[str, str]]:
    """Name of each quantity -> texts of its number by the names of their elements."""
    return {
        text_of(one, "d:name"): {
            part.tag.partition("}")[2]: part.text or "" for part in one.iterfind("s:real//*", NS) if not len(part)
        }
        for one in data.iterfind("d:quantity", NS)
    }


def _names(of: ET.Element) -> list[str]:
    return [one.tag.partition("}")[2] for one in of]


def test_a_dcc_says_what_the_certificate_says_with_every_digit(made: Path) -> None:
    document = document_of(made)
    assert document["provenance"]["dcc"] == "3.3.0"
    root = parsed((made / "certificate/certificate.xml").read_bytes())
    assert root.get("schemaVersion") == "3.3.0"
    assert _names(root) == ["administrativeData", "measurementResults"]
    stated, measured = root
    assert _names(stated) == [
        "dccSoftware", "coreData", "items", "calibrationLaboratory", "respPersons", "customer", "statements",
    ]  # fmt: skip
    core = stated[1]
    assert [(one.tag.partition("}")[2], one.text) for one in core if not len(one)] == [
        ("countryCodeISO3166_1", "SE"), ("usedLangCodeISO639_1", "en"), ("mandatoryLangCodeISO639_1", "en"),
        ("uniqueIdentifier", "K-0001, issue 2"), ("receiptDate", "2026-11-20"), ("beginPerformanceDate", "2026-11-24"),
        ("endPerformanceDate", "2026-11-25"), ("performanceLocation", "other"), ("issueDate", "2026-11-28"),
    ]  # fmt: skip
    assert text_of(core, "d:identifications") == "customer PO-4711 order"
    assert text_of(stated, "d:items/d:item/d:name") == "recoiling part no. 17, new"
    assert text_of(stated, "d:calibrationLaboratory/d:contact/d:name") == "Range North, 1 Proof Road"
    assert text_of(stated, "d:customer/d:name") == "Programme Office, Main Street"
    assert text_of(stated, "d:respPersons") == "A. Person, head of the laboratory authorized by B. Person tested by"
    said = text_of(stated, "d:statements")
    for words in (
        document["statement"], "CONFORMS", "guard band (ILAC-G8", "place of the test Range 3", "replaces K-0001",
        *(one["sha256"] for one in document["provenance"]["inputs"]),
    ):  # fmt: skip
        assert words in said
    assert text_of(stated, "d:statements/d:statement/d:conformity") == "pass"
    of_mass, of_shot = measured.findall(".//d:result/d:data", NS)
    mass, *peaks = document["results"]
    assert values_of(of_mass)["recoiling mass"] == {
        "value": repr(mass["value"]), "unit": r"\kilogram", "valueExpandedMU": repr(mass["U"]),
        "coverageFactor": repr(mass["k"]), "coverageProbability": "0.95",
        "distribution": values_of(of_mass)["recoiling mass"]["distribution"],
    }  # fmt: skip
    found = list(values_of(of_shot).values())[2:]
    assert [(float(one["value"]), one["unit"], float(one["valueExpandedMU"])) for one in found] == [
        (one["value"], UNITS[one["key"]], one["U"]) for one in peaks
    ]
    serials = {one.text for one in measured.iterfind("d:measuringEquipments//d:identification/d:value", NS)}
    assert serials >= {one["serial"] for one in document["calibrations"] if one["serial"]}
    # the day is the header's: the files of this shot state none
    assert {one["in_force"] for one in document["calibrations"] if one["due"]} == {True}
    assert "fired from" in (made / "certificate/certificate.html").read_text("utf-8")
    assert "day of the shot" not in text_of(measured, "d:measuringEquipments")


def test_our_own_reader_takes_it_for_a_dcc_and_for_none_of_a_sensor(made: Path) -> None:
    path = made / "certificate/certificate.xml"
    assert is_digital_certificate(path)
    with pytest.raises(CorruptFileError, match="which serial number the sensor has"):
        read_digital_certificate(path)


def test_it_comes_again_to_the_byte_is_signed_and_checked(made: Path, tmp_path: Path) -> None:
    found = checked(made)
    assert found.again
    assert found.comparison is not None
    assert {"certificate.xml", "certificate.xml.sig"} <= {one.partition(" ")[0] for one in found.comparison.drawings}
    certificate(made / "reports/0001", made / "header.toml", out=tmp_path / "signed", dcc=True, sign=made / "lab.pem")
    for name in ("certificate.xml", "certificate.json"):
        assert (tmp_path / "signed" / name).read_bytes() == (made / "certificate" / name).read_bytes()


def _changed(done: Path, old: str, new: str) -> None:
    path = done / "certificate/certificate.xml"
    content = path.read_text("utf-8")
    assert old in content
    path.write_text(content.replace(old, new, 1), encoding="utf-8")


FORGERIES = {
    "a digit": lambda d: _changed(d, "<si:value>7", "<si:value>8"),
    "the coverage": lambda d: _changed(d, "0.95", "0.99"),
    "a name": lambda d: _changed(d, "Programme Office", "Another Office"),
    "a blank behind it": lambda d: _changed(d, "Certificate>\n", "Certificate> \n"),
    "taken away": lambda d: (d / "certificate/certificate.xml").unlink(),
    "its signature taken away": lambda d: (d / "certificate/certificate.xml.sig").unlink(),
}  # fmt: skip


@pytest.mark.parametrize("forge", FORGERIES.values(), ids=FORGERIES)
def test_what_was_changed_in_it_is_found_and_named(done: Path, forge) -> None:
    forge(done)
    found = checked(done)
    assert not found.again
    assert found.comparison is not None
    assert "certificate.xml" in " ".join(map(str, found.comparison.differences))


def test_one_that_was_put_beside_a_certificate_without_one_is_named_and_an_older_one_goes(done: Path) -> None:
    kept = (done / "certificate/certificate.xml").read_bytes()
    certificate(done / "reports/0001", done / "header.toml", out=done / "certificate", overwrite=True)
    assert sorted(path.suffix for path in (done / "certificate").iterdir()) == [".html", ".json", ".pdf"]
    (done / "certificate/certificate.xml").write_bytes(kept)
    (found,) = check_reports(done / "certificate", workers=1).reports
    assert not found.again
    assert "certificate.xml" in " ".join(map(str, found.comparison.differences))


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (HEADER, "states the country of the laboratory"),
        (HEADER + 'country = "SE"\n', "nothing states that of shot 0001"),
        (HEADER + 'country = "Sweden"\n', "two letters of ISO 3166-1"),
        (STATED.replace("2026-11-25", "2026-11-23"), "a day on or after"),
    ],
)
def test_what_the_schema_needs_and_nobody_stated_is_asked_for_and_never_invented(
    done: Path, header: str, said: str
) -> None:
    (done / "open.toml").write_text(header, encoding="utf-8")
    words = ["certificate", str(done / "reports/0001"), "--header", str(done / "open.toml"), "--out", str(done / "new")]
    ran = CliRunner().invoke(app, [*words, "--dcc"])
    assert (ran.exit_code, ran.output.count("\n")) == (3, 1), ran.output
    assert said in ran.output
    assert not (done / "new").exists()


def test_what_a_header_leaves_open_is_not_stated(done: Path) -> None:
    (done / "bare.toml").write_text('number = "K-9"\ncountry = "SE"\nfired_from = 2026-11-24\n', encoding="utf-8")
    words = ["certificate", str(done / "reports/0001"), "--header", str(done / "bare.toml"), "--out", str(done / "new")]
    ran = CliRunner().invoke(app, [*words, "--dcc"])
    assert ran.exit_code == 0, ran.output
    root = parsed((done / "new/certificate.xml").read_bytes())
    for path in ("d:items/d:item/d:name", "d:calibrationLaboratory/d:contact/d:name", "d:customer/d:location"):
        assert text_of(root[0], path) == "not stated"
    assert text_of(root[0], "d:coreData/d:endPerformanceDate") == "2026-11-24"
    assert root.find(".//d:conformity", NS) is None
    assert "NOT STATED" in text_of(root[0], "d:statements")


def test_a_campaign_has_each_shot_and_its_days(tmp_path: Path) -> None:
    for number, shot in enumerate(CAMPAIGN_SHOTS):
        write_report(
            tmp_path / "reports", shot, started=f"2026-09-2{number}T10:00:00", channels=[CHANNEL], issued={},
            peaks={"breech_pressure_pa": 2e8, "recoil_travel_m": 0.8}, peaks_u={"breech_pressure_pa": 1e6},
            peaks_U95={"breech_pressure_pa": [1.98e8, 2.02e8]},
        )  # fmt: skip
    (tmp_path / "header.toml").write_text('number = "K-{campaign}"\ncountry = "SE"\n', encoding="utf-8")
    campaign(tmp_path / "reports", out=tmp_path / "autumn")
    certificate(tmp_path / "autumn", tmp_path / "header.toml", out=tmp_path / "certificate", dcc=True)
    root = parsed((tmp_path / "certificate/certificate.xml").read_bytes())
    days = [text_of(root[0], f"d:coreData/d:{name}PerformanceDate") for name in ("begin", "end")]
    assert days == ["2026-09-20", "2026-09-23"]
    results = root[1].findall(".//d:result", NS)
    assert [text_of(one, "d:name") for one in results[1:]] == [f"shot {shot.name}" for shot in CAMPAIGN_SHOTS]
    found = values_of(results[1].find("d:data", NS))
    assert found["peak breech pressure"]["unit"] == r"\pascal"
    assert float(found["peak breech pressure"]["valueExpandedMU"]) == pytest.approx(2e6)
    assert "valueExpandedMU" not in next(one for one in found.values() if one["unit"] == r"\metre")
    assert "D-K-17" in text_of(root[1], "d:measuringEquipments")
    (one,) = check_reports(tmp_path / "certificate", workers=1).reports
    assert one.again
    (tmp_path / "header.toml").write_text(
        'number = "K-{campaign}"\ncountry = "SE"\nfired_from = 2026-09-21\nfired_until = 2026-09-23\n', encoding="utf-8"
    )
    with pytest.raises(ReadError, match="was fired on another day than the header states"):
        certificate(tmp_path / "autumn", tmp_path / "header.toml", out=tmp_path / "other", dcc=True)


def test_a_hostile_text_is_spelled_and_the_file_stays_well_formed(made: Path) -> None:
    document = deepcopy(document_of(made))
    evil = "<b>&\"'\x00\x1b[2J\u202e\ud800\ufffe\uffff]]>\n  tail "
    document["issued"] |= dict.fromkeys(("laboratory", "item", "number", "place", "order"), evil)
    document["rig"] = document["shots"][0]["shot"] = evil
    document["calibrations"][0]["serial"] = evil
    root = parsed(dcc_bytes(sealed(document)))
    assert text_of(root[0], "d:items/d:item/d:name") == ("<b>&\"'\\x00\\x1b[2J\\u202e\\ud800\\ufffe\\uffff]]> tail")
    assert dcc_bytes(sealed(document)).startswith(b'<?xml version="1.0" encoding="UTF-8"?>\n')
    document["issued"]["item"] = " \n"
    assert text_of(parsed(dcc_bytes(document))[0], "d:items/d:item/d:name") == "not stated"


def test_every_quantity_of_a_report_has_a_unit_of_the_d_si() -> None:
    assert set(UNITS) == {"mass", *(key for key, *_ in PEAKS)}
