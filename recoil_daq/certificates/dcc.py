"""A certificate as a digital calibration certificate (DCC): the same content, for the programs of who receives it.

Schema 3.3.0 of the PTB (https://ptb.de/dcc), with numbers as D-SI (https://ptb.de/si): in SI units, with every digit of
``certificate.json``. What the header leaves open and the schema asks for is "not stated". The schema has no such words
for the country of the laboratory and for the days of firing: without these there is no DCC. It knows five kinds of
places alone: that of a test is "other", and is a statement in the words of the header.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from recoil_acquisition.errors import ReadError, visible
from recoil_identification.estimate.budget import MOST_DEGREES_OF_FREEDOM
from recoil_identification.estimate.conformity import Word
from recoil_identification.report.content.certificate_tables import (
    NOT_STATED,
    calibrations,
    chain,
    conditions,
    deviations,
    number_of,
    shots,
)
from recoil_identification.report.document.report_files import SEAL
from recoil_identification.shot.peaks import LABELS
from recoil_rigs.tables.issue import GUARD_BAND, SIMPLE

Document = Mapping[str, Any]

DCC_FILE = "certificate.xml"
SCHEMA_VERSION = "3.3.0"
"""Version of the schema by which it is written."""
UNITS: Mapping[str, str] = {
    "mass": r"\kilogram",
    "breech_pressure_pa": r"\pascal",
    "brake_pressure_pa": r"\pascal",
    "recuperator_pressure_pa": r"\pascal",
    "recoil_acceleration_m_s2": r"\metre\second\tothe{-2}",
    "recoil_velocity_m_s": r"\metre\second\tothe{-1}",
    "recoil_travel_m": r"\metre",
    "recoil_time_s": r"\second",
    "impulse_n_s": r"\newton\second",
}
"""Key of a result -> its unit as the D-SI spells it."""
_ONE = r"\one"
_COVERAGE = "0.95"
_CONFORMITY = {Word.CONFORMS: "pass", Word.DOES_NOT_CONFORM: "fail"}
"""Words that the schema has one for; what is not shown is neither, and stands in words alone."""
_NORMS = {SIMPLE: "ILAC-G8:09/2019", GUARD_BAND: "ILAC-G8:09/2019"}
_BY_PROBABILITY = "JCGM 106:2012"
_BLANKS = str.maketrans("\t\r\n", "   ")
_NO_CHARACTER = re.compile("[\ufffe\uffff]")
_DCC, _SI = "https://ptb.de/dcc", "https://ptb.de/si"
ET.register_namespace("dcc", _DCC)
ET.register_namespace("si", _SI)


def refuse_without_facts(document: Document, path: Path, header: str) -> None:
    """Raise a ReadError where something is open that a DCC must have and has no words for.

    Parameters
    ----------
    path
        Path of the document that the certificate is of.
    header
        Name of the header file.
    """
    if not document["issued"].get("country"):
        raise ReadError(
            "a DCC states the country of the laboratory, and this header does not", path=Path(header),
            expected='`country`, two letters of ISO 3166-1 such as country = "DE"', remedy="write it there",
        )  # fmt: skip
    days = _days(document)
    unknown = [str(one["shot"]) for one in document["shots"] if not one["fired_on"]]
    if unknown and days is None:
        raise ReadError(
            f"a DCC states the days of firing, and nothing states that of shot {', '.join(unknown)}", path=path,
            expected="a start in the files of each shot, or `fired_from` in the header",
            remedy="write fired_from, and fired_until where it is another day, into the header",
        )  # fmt: skip
    other = [one for one in document["shots"] if one["fired_on"] and days and not days[0] <= one["fired_on"] <= days[1]]
    if other:
        raise ReadError(
            f"shot {other[0]['shot']} was fired on another day than the header states", path=Path(header),
            expected=f"days with {other[0]['fired_on']} among them", found=f"{days[0]} to {days[1]}" if days else None,
            remedy="correct fired_from and fired_until, or leave them out",
        )  # fmt: skip


def dcc_bytes(document: Document) -> bytes:
    """Write a certificate as a DCC.

    Parameters
    ----------
    document
        Contents of ``certificate.json``, with what `refuse_without_facts` looks for.
    """
    root = ET.Element(f"{{{_DCC}}}digitalCalibrationCertificate", {"schemaVersion": SCHEMA_VERSION})
    _administrative(_add(root, "administrativeData"), document)
    _measured(_add(root, "measurementResults"), document)
    ET.indent(root)
    text: str = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _administrative(of: ET.Element, document: Document) -> None:
    issued = document["issued"]
    software = _add(_add(of, "dccSoftware"), "software")
    _words(software, "name", "recoil-daq")
    _add(software, "release", document["provenance"]["version"])
    _core(_add(of, "coreData"), document)
    item = _add(_add(of, "items"), "item")
    _header_words(item, "name", issued.get("item"))
    _words(item, "description", f"recoiling part of rig {document['rig']}, of the shots {_names(document)}")
    known = _add(item, "identifications")
    _identification(known, "calibrationLaboratory", document["rig"], "rig")
    for one in document["shots"]:
        _identification(known, "calibrationLaboratory", one["shot"], "shot")
    _contact(_add(_add(of, "calibrationLaboratory"), "contact"), issued.get("laboratory"))
    persons = _add(of, "respPersons")
    for key, role in (("approval", "authorized by"), ("operator", "tested by")):
        person = _add(persons, "respPerson")
        _header_words(_add(person, "person"), "name", issued.get(key))
        _add(person, "role", role)
    _contact(_add(of, "customer"), issued.get("customer"))
    _statements(_add(of, "statements"), document)


def _core(of: ET.Element, document: Document) -> None:
    issued, fired = document["issued"], [one["fired_on"] for one in document["shots"]]
    begin, end = _days(document) or (min(fired), max(fired))
    _add(of, "countryCodeISO3166_1", issued["country"])
    _add(of, "usedLangCodeISO639_1", "en")
    _add(of, "mandatoryLangCodeISO639_1", "en")
    _add(of, "uniqueIdentifier", number_of(document))
    if issued.get("order"):
        _identification(_add(of, "identifications"), "customer", issued["order"], "order")
    if issued.get("received"):
        _add(of, "receiptDate", issued["received"])
    _add(of, "beginPerformanceDate", begin)
    _add(of, "endPerformanceDate", end)
    _add(of, "performanceLocation", "other")
    if issued.get("date"):
        _add(of, "issueDate", issued["date"])


def _days(document: Document) -> tuple[str, str] | None:
    """Return the first and the last day of firing that the header states; None where it states none."""
    begin = document["issued"].get("fired_from")
    return None if begin is None else (begin, document["issued"].get("fired_until", begin))


def _statements(of: ET.Element, document: Document) -> None:
    issued, found = document["issued"], document["conformity"]
    measurand, _, specification, conforms, coverage, relates = conditions(document)
    _statement(of, "results relate only to the items tested", relates)
    stated = _statement(of, "statement of conformity")
    if found["probability"] is not None:
        _add(stated, "norm", _NORMS.get(found["rule"], _BY_PROBABILITY))
    _words(stated, "declaration", conforms)
    if found["word"] in _CONFORMITY:
        _add(stated, "conformity", _CONFORMITY[found["word"]])
    if found["probability"] is not None:
        data = _add(stated, "data")
        for name, limit in zip(("lower limit", "upper limit"), found["limits_kg"], strict=True):
            if limit is not None:
                _quantity(data, name, limit, UNITS["mass"])
        _quantity(data, "probability that the mass conforms", found["probability"], _ONE)
    validity = _statement(of, "validity", "VALID" if document["valid"] else "NOT VALID")
    _add(validity, "valid", "true" if document["valid"] else "false")
    for name, text in (("measurand", measurand), ("specification", specification), ("uncertainty", coverage)):
        _statement(of, name, text)
    for text in deviations(document):
        _statement(of, "deviations, repairs, what is taken for granted", text)
    _header_words(_statement(of, "place of the test"), "declaration", issued.get("place"))
    for key in ("replaces", "concession", "remark"):
        if issued.get(key):
            _header_words(_statement(of, key), "declaration", issued[key])
    for one in chain(document):
        _statement(of, "what it rests on", f"{one['what']} {one['file']}: SHA-256 {one['sha256']}")
    _statement(of, "what it rests on", f"certificate.json: digest of its content {document['provenance'][SEAL]}")


def _measured(of: ET.Element, document: Document) -> None:
    method = _add(_add(of, "usedMethods"), "usedMethod")
    _words(method, "name", "mass by the equation of motion of the recoiling part")
    _words(method, "description", conditions(document)[1])
    _add(method, "norm", "JCGM 100:2008")
    if document["calibrations"]:
        equipments = _add(of, "measuringEquipments")
        for stated, row in zip(document["calibrations"], calibrations(document), strict=True):
            _equipment(_add(equipments, "measuringEquipment"), stated, row)
    result = _add(of, "measurementResult")
    _words(result, "name", "recoiling mass, peaks, time and impulse")
    results = _add(result, "results")
    own = [one for one in document["results"] if one["shot"] is None]
    data = _result(results, "the certificate's results", str(document["measurand"]))
    for one in own:
        _found(data, one)
    specification = document["specification"]
    if specification["value"] is not None:
        _quantity(data, "specification of the mass", specification["value"], UNITS["mass"])
        _quantity(data, "deviation from the specification", specification["deviation_kg"], UNITS["mass"])
    if specification["E_n"] is not None:
        _quantity(data, "E_n", specification["E_n"], _ONE)
    for stated, row in zip(document["shots"], shots(document), strict=True):
        said = f"fired {row['fired']} {row['source']}; {row['configuration']}; {row['use']}"
        data = _result(results, f"shot {stated['shot']}", said)
        added = _quantity(data, "added mass", stated["added_mass_kg"], UNITS["mass"])
        _standard(added, stated["u_added_mass_kg"])
        _standard(_quantity(data, "mass of this shot", stated["mass"]["value"], UNITS["mass"]), stated["mass"]["u"])
        for one in document["results"]:
            if one["shot"] == stated["shot"]:
                _found(data, one)


def _equipment(of: ET.Element, stated: Mapping[str, Any], row: Mapping[str, Any]) -> None:
    """State a channel's sensor; the digest of its certificate, for which ``dcc:certificate`` asks, is not known."""
    _words(of, "name", f"{stated['channel']}, {stated['role']}")
    dates = f"calibrated {row['calibrated']}, due {row['due']}: {row['in_force']}"
    _words(of, "description", f"{dates}; U {row['U']}, k {row['k']}, ν {row['nu']}; shots {', '.join(stated['shots'])}")
    if stated["model"]:
        _add(of, "model", stated["model"])
    if stated["serial"] or stated["certificate"]:
        known = _add(of, "identifications")
        if stated["serial"]:
            _identification(known, "manufacturer", stated["serial"], "serial number")
        if stated["certificate"]:
            _identification(known, "other", stated["certificate"], "certificate of calibration")


def _found(of: ET.Element, one: Mapping[str, Any]) -> None:
    """State a result with its expanded uncertainty, where that is known."""
    name = "recoiling mass" if one["key"] == "mass" else LABELS[one["key"]]
    real = _quantity(
        of, f"{name}, mean with {one['kind']}" if one.get("kind") else name, one["value"], UNITS[one["key"]]
    )
    if one["U"] is None or one["k"] is None:
        return
    expanded = _si(_si(real, "measurementUncertaintyUnivariate"), "expandedMU")
    _si(expanded, "valueExpandedMU", _number(one["U"]))
    _si(expanded, "coverageFactor", _number(one["k"]))
    _si(expanded, "coverageProbability", _COVERAGE)
    is_normal = one["nu"] is None or one["nu"] > MOST_DEGREES_OF_FREEDOM
    _si(expanded, "distribution", "normal" if is_normal else f"Student's t, {one['nu']:.6g} degrees of freedom")


def _standard(real: ET.Element, u: float | None) -> None:
    if u is not None:
        standard = _si(_si(real, "measurementUncertaintyUnivariate"), "standardMU")
        _si(standard, "valueStandardMU", _number(u))


def _quantity(of: ET.Element, name: str, value: float, unit: str) -> ET.Element:
    quantity = _add(of, "quantity")
    _words(quantity, "name", name)
    real = _si(quantity, "real")
    _si(real, "value", _number(value))
    _si(real, "unit", unit)
    return real


def _result(of: ET.Element, name: str, description: str) -> ET.Element:
    result = _add(of, "result")
    _words(result, "name", name)
    _words(result, "description", description)
    return _add(result, "data")


def _statement(of: ET.Element, name: str, text: str | None = None) -> ET.Element:
    stated = _add(of, "statement")
    _words(stated, "name", name)
    if text is not None:
        _words(stated, "declaration", text)
    return stated


def _contact(of: ET.Element, text: str | None) -> None:
    """State who somebody is; a header has name and address as one text, which is not taken apart."""
    _header_words(of, "name", text)
    _header_words(_add(of, "location"), "further", text)


def _identification(of: ET.Element, issuer: str, value: str, name: str) -> None:
    one = _add(of, "identification")
    _add(one, "issuer", issuer)
    _add(one, "value", value)
    _words(one, "name", name)


def _words(of: ET.Element, name: str, text: str) -> None:
    """Add a text in the language of this program."""
    _add(_add(of, name), "content", text).set("lang", "en")


def _header_words(of: ET.Element, name: str, text: str | None) -> None:
    """Add a text of the header, whose language is not known."""
    if text is None:
        _words(of, name, NOT_STATED)
    else:
        _add(_add(of, name), "content", text)


def _add(of: ET.Element, name: str, text: str | None = None) -> ET.Element:
    found = ET.SubElement(of, f"{{{_DCC}}}{name}")
    if text is not None:
        found.text = _plain(text)
    return found


def _si(of: ET.Element, name: str, text: str | None = None) -> ET.Element:
    found = ET.SubElement(of, f"{{{_SI}}}{name}")
    found.text = text
    return found


def _plain(text: str) -> str:
    """Return a text as XML and the schema can hold it: what is no character is spelled, and blanks are single ones."""
    seen = visible(" ".join(filter(None, text.translate(_BLANKS).split(" "))))
    return _NO_CHARACTER.sub(lambda found: f"\\u{ord(found.group()):04x}", seen) or NOT_STATED


def _number(value: float) -> str:
    if not math.isfinite(value):
        raise ValueError(f"a number that is {value}")
    return repr(float(value))


def _names(document: Document) -> str:
    return ", ".join(str(one["shot"]) for one in document["shots"])
