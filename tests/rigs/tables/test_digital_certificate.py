"""Digital calibration certificates: what is read of them, and which are refused."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError, RecoilDaqError, RigError
from recoil_rigs.tables.certificate_table import read_certificates
from recoil_rigs.tables.digital_certificate import is_digital_certificate, read_digital_certificate

pytest.importorskip("signxml", reason="the extra `dcc` is not installed")
from tests.builders.digital_certificates import CERTIFICATE, laboratory

REAL = r"<si:value>40.2</si:value>"


def written(folder: Path, content: str | bytes = CERTIFICATE, name: str = "dcc.xml") -> Path:
    path = folder / name
    path.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
    return path


def changed(old: str, new: str) -> str:
    assert CERTIFICATE.count(old) == 1, old
    return CERTIFICATE.replace(old, new)


def test_a_certificate_says_sensor_sensitivity_uncertainty_day_and_number(tmp_path: Path) -> None:
    path = written(tmp_path)
    assert is_digital_certificate(path)
    found = read_digital_certificate(path)
    assert found.cells == {
        "serial": "V301", "certificate": "D-K-15055-2026-04711", "model": "6215", "calibrated": dt.date(2026, 3, 1),
        "quantity": "pressure", "sensitivity": 40.2, "sensitivity_unit": "mV/MPa", "U_percent": pytest.approx(1.0),
        "k": 2.5,
    }  # fmt: skip
    assert "is not signed" in str(found)
    (certificate,) = read_certificates(path)
    sensor = certificate.sensor("V")
    assert (sensor["U_rel"], sensor["k"], sensor["sensitivity"]) == (0.01, 2.5, "40.2 mV/MPa")
    assert sensor["certificate"] == "D-K-15055-2026-04711"


@pytest.mark.parametrize(
    ("uncertainty", "u_percent", "k"),
    [
        (
            "<si:expandedMU><si:valueExpandedMU>0.804</si:valueExpandedMU><si:coverageFactor>2</si:coverageFactor>",
            2.0,
            2.0,
        ),
        (
            "<si:standardMU><si:valueStandardMU>0.402</si:valueStandardMU>",
            1.0,
            1.0,
        ),
    ],
)
def test_uncertainties_of_later_schemas_are_read_as_well(
    tmp_path: Path, uncertainty: str, u_percent: float, k: float
) -> None:
    start, stop = CERTIFICATE.index("<si:expandedUnc>"), CERTIFICATE.index("</si:expandedUnc>")
    whole = f"<si:measurementUncertaintyUnivariate>{uncertainty}{uncertainty.partition('>')[0].replace('<', '</')}>"
    whole += "</si:measurementUncertaintyUnivariate>"
    text = CERTIFICATE[:start] + whole + CERTIFICATE[stop + len("</si:expandedUnc>") :]
    cells = read_digital_certificate(written(tmp_path, text)).cells
    assert (cells["U_percent"], cells["k"]) == (pytest.approx(u_percent), k)


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        (r"\pico\coulomb\per\bar", "pC/bar"),
        (r"\milli\volt\per\metre\second\tothe{2}", "mV/m/s^2"),
        (r"\volt\metre\tothe{-1}\second\tothe{2}", "V/m/s^2"),
        (r"\milli\volt\per\volt\per\kilo\newton", "mV/V/kN"),
        (r"\milli\volt\per\degree\second", "mV/deg/s"),
    ],
)
def test_units_of_sensitivities_are_understood(tmp_path: Path, unit: str, text: str) -> None:
    path = written(tmp_path, changed(r"\milli\volt\per\mega\pascal", unit))
    assert read_certificates(path)[0].sensitivity.replace("(", "").replace(")", "") == f"40.2 {text}"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (r"\milli\volt\per\mega\pascal", r"\kelvin", "does not say what the sensor's sensitivity is"),
        (r"\milli\volt\per\mega\pascal", r"\frob\volt", "does not say what the sensor's sensitivity is"),
        (REAL, "<si:value>-40.2</si:value>", "its sensitivity is none"),
        (REAL, "<si:value>many</si:value>", "a number of its results is none"),
        ("<si:uncertainty>0.402</si:uncertainty>", "", "its sensitivity is none"),
        ("<dcc:value>V301</dcc:value>", "<dcc:value></dcc:value>", "which serial number"),
        ("2026-03-01</dcc:end", "soon</dcc:end", "it has no date"),
        ("D-K-15055-2026-04711", "", "it has no number"),
        ("</dcc:item>", "</dcc:item><dcc:item/>", "of which sensor"),
        ('https://ptb.de/dcc" xmlns:si', 'https://else" xmlns:si', "no digital certificate"),
        ("</dcc:items>", "", "it is no XML"),
    ],
)
def test_what_a_certificate_lacks_is_said_in_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(CorruptFileError, match=said) as caught:
        read_digital_certificate(written(tmp_path, changed(old, new)))
    assert "dcc.xml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_of_several_sensitivities_none_is_guessed(tmp_path: Path) -> None:
    text = changed(
        r"<si:value>296.1</si:value><si:unit>\kelvin", r"<si:value>41</si:value><si:unit>\milli\volt\per\bar"
    )
    with pytest.raises(CorruptFileError, match="2 of them"):
        read_digital_certificate(written(tmp_path, text))


def test_the_same_sensitivity_in_another_unit_is_no_second_one(tmp_path: Path) -> None:
    start = CERTIFICATE.index("<si:real>\n")
    stop = CERTIFICATE.index("</si:real>", start) + len("</si:real>")
    real = CERTIFICATE[start:stop]
    other = real.replace("40.2<", "4.02<").replace("0.402<", "0.0402<").replace(r"\mega\pascal", r"\bar")
    text = f"{CERTIFICATE[:start]}<si:hybrid>{real}{other}</si:hybrid>{CERTIFICATE[stop:]}"
    assert read_digital_certificate(written(tmp_path, text)).cells["sensitivity_unit"] == "mV/MPa"


BOMB = '<!DOCTYPE d [<!ENTITY a "V301"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'


@pytest.mark.parametrize(
    "type_",
    [BOMB, '<!DOCTYPE d SYSTEM "http://192.0.2.1/d.dtd">', '<!DOCTYPE d [<!ENTITY a SYSTEM "file:///etc/passwd">]>'],
)
def test_document_types_and_entities_are_refused_unread(tmp_path: Path, type_: str) -> None:
    text = CERTIFICATE.replace("?>\n", f"?>\n{type_}\n", 1).replace("V301", "&a;" if "ENTITY a" in type_ else "V301")
    with pytest.raises(CorruptFileError, match=r"document type or entities|it is no XML"):
        read_digital_certificate(written(tmp_path, text))


def test_a_signature_is_said_and_one_changed_digit_refused(tmp_path: Path) -> None:
    signed = laboratory().signed()
    found = read_digital_certificate(written(tmp_path, signed))
    assert found.signer == "CN=Calibration Lab"
    assert found.cells["sensitivity"] == 40.2
    for old, new in ((b"40.2<", b"41.2<"), (b"V301", b"V302"), (b"2026-03-01", b"2027-03-01")):
        with pytest.raises(CorruptFileError, match="it was changed after it was signed"):
            read_digital_certificate(written(tmp_path, signed.replace(old, new)))


@pytest.mark.parametrize("signed", [False, True])
def test_bytes_that_were_spoilt_anywhere_are_refused_or_change_nothing_of_a_signed_one(
    tmp_path: Path, signed: bool
) -> None:
    whole = laboratory().signed() if signed else CERTIFICATE.encode("utf-8")
    sound, rng = read_digital_certificate(written(tmp_path, whole)), np.random.default_rng(7)
    for _ in range(60):
        spoilt = bytearray(whole)
        for _ in range(rng.choice([1, 1, 4])):
            spoilt[rng.integers(len(spoilt))] = int(rng.integers(256))
        cut = spoilt[: rng.integers(len(spoilt))] if rng.random() < 0.2 else spoilt
        try:
            found = read_digital_certificate(written(tmp_path, bytes(cut)))
        except RecoilDaqError:
            continue
        # a signature that was spoilt into something else is none, and that is said
        assert not signed or found.cells == sound.cells or found.signer is None


def test_another_document_around_the_signed_one_is_refused(tmp_path: Path) -> None:
    # signature wrapping: the root is the forger's, the signed certificate lies somewhere inside it
    signed = laboratory().signed().partition(b"?>")[2].strip().decode("utf-8")
    forged = changed("</dcc:measurementResults>", f"</dcc:measurementResults><dcc:comment>{signed}</dcc:comment>")
    with pytest.raises(CorruptFileError, match=r"changed after it was signed|signature cannot be checked"):
        read_digital_certificate(written(tmp_path, forged.replace("<si:value>40.2<", "<si:value>50.2<", 1)))


def test_of_a_document_around_what_was_signed_by_name_the_signed_part_alone_is_read(tmp_path: Path) -> None:
    signed = laboratory().signed_by_name()
    assert read_digital_certificate(written(tmp_path, signed)).signer == "CN=Calibration Lab"
    other = CERTIFICATE.replace("40.2<", "50.2<", 1)
    forged = other.replace("</dcc:measurementResults>", f"</dcc:measurementResults><dcc:comment>{signed}</dcc:comment>")
    assert read_digital_certificate(written(tmp_path, forged)).cells["sensitivity"] == 40.2


def test_a_signer_whom_a_list_beside_it_revokes_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, laboratory().signed())
    (tmp_path / "other.crl").write_bytes(laboratory("Another").revoking(laboratory()))
    read_digital_certificate(path)
    (tmp_path / "lab.crl").write_bytes(laboratory().revoking())
    with pytest.raises(CorruptFileError, match=r"revoked on 2026-03-02, lab\.crl says"):
        read_digital_certificate(path)
    (tmp_path / "lab.crl").write_bytes(b"nothing")
    with pytest.raises(ReadError, match="no list of revoked certificates"):
        read_digital_certificate(path)


def test_a_row_of_the_table_is_filled_in_by_the_certificate_that_it_names(tmp_path: Path) -> None:
    written(tmp_path)
    table = tmp_path / "sensors.csv"
    table.write_text(
        "serial,signal,unit,range_low,range_high,due,dcc\nV301,AI 6,MPa,0,250,01.03.2027,dcc.xml\n", "utf-8"
    )
    (row,) = read_certificates(table)
    sensor = row.sensor("V")
    assert (sensor["certificate"], sensor["U_rel"], sensor["range"]) == ("D-K-15055-2026-04711", 0.01, [0.0, 250.0])
    assert (sensor["calibrated"], sensor["due"]) == (dt.date(2026, 3, 1), dt.date(2027, 3, 1))
    assert "is not signed" in row.said
    table.write_text("serial,U_percent,k,dcc\nV301,2,2.5,dcc.xml\n", "utf-8")
    with pytest.raises(RigError, match=r"U_percent: dcc\.xml says 1"):
        read_certificates(table)


def test_without_the_library_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recoil_acquisition.packages.extras.find_spec", lambda _: None)
    with pytest.raises(ReadError, match="signxml") as caught:
        read_digital_certificate(written(tmp_path))
    assert "pip install 'signxml" in str(caught.value)
