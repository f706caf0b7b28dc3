"""Digital calibration certificates, DCC of the PTB, schema 2.4 and 3.x: what they say of a sensor's sensitivity.

Schema: https://www.ptb.de/dcc, with quantities of the D-SI (https://ptb.de/si) in both of its ways to state an expanded
uncertainty, ``si:expandedUnc`` and ``si:expandedMU``. Elements are looked for by their names in that namespace; a
certificate of several items, or of several sensitivities, does not say which one a sensor has, and is refused.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from recoil_acquisition.errors import CorruptFileError, RecoilDaqError
from recoil_acquisition.files.regular_file import read_beginning
from recoil_acquisition.quantities.quantity import find_unit
from recoil_rigs.tables.sensitivity import Sensitivity, sensitivity_from_text
from recoil_rigs.tables.signed_xml import read_signed_xml

WHAT = "a digital calibration certificate (DCC)"
ROOT = "digitalCalibrationCertificate"
_NAMESPACE = "{https://ptb.de/dcc}"
_SI = "{https://ptb.de/si}"
_HEAD_BYTES = 65_536
SUFFIX = ".xml"

_PREFIXES: Mapping[str, str] = MappingProxyType(
    {
        "giga": "G",
        "mega": "M",
        "kilo": "k",
        "hecto": "h",
        "centi": "c",
        "milli": "m",
        "micro": "u",
        "nano": "n",
        "pico": "p",
    }
)
_UNITS: Mapping[str, str] = MappingProxyType({
    "volt": "V", "coulomb": "C", "ampere": "A", "pascal": "Pa", "bar": "bar", "newton": "N", "metre": "m",
    "second": "s", "radian": "rad", "degree": "deg", "standardgravity": "g",
})  # fmt: skip
_TOKEN = re.compile(r"\\([A-Za-z]+)(?:\{([^}]*)\})?")


class DigitalCertificate(NamedTuple):
    """A digital certificate: its statements, and who signed it.

    Attributes
    ----------
    cells
        Values by columns of `recoil_rigs.tables.certificate_table`.
    signer
        Name of who signed it; None if nobody did.
    """

    cells: Mapping[str, Any]
    signer: str | None

    def __str__(self) -> str:
        number = self.cells["certificate"]
        if self.signer is None:
            return f"certificate {number} is not signed: nothing shows that it is as the laboratory wrote it"
        return f"certificate {number} is as {self.signer} signed it; whether that is the laboratory, its paper tells"


def is_digital_certificate(path: Path) -> bool:
    """Whether a file is a digital certificate, by its name and its beginning; False where it cannot be read."""
    try:
        head = read_beginning(path, _HEAD_BYTES) if path.suffix.casefold() == SUFFIX else b""
    except RecoilDaqError:
        return False
    return ROOT.encode() in head.replace(b"\0", b"")  # UTF-16 as well


def read_digital_certificate(path: Path) -> DigitalCertificate:
    """Read a digital certificate.

    Raises
    ------
    ReadError
        As of `recoil_rigs.tables.signed_xml.read_signed_xml`.
    CorruptFileError
        If something that a certificate of a sensor states is missing in it, stands there more than once, or is none.
    """
    signed = read_signed_xml(path, WHAT)
    root = signed.root
    if root.tag != f"{_NAMESPACE}{ROOT}":
        raise CorruptFileError("it is no digital certificate", path=path, expected=WHAT, found=str(root.tag))
    items = root.findall(f"{_NAMESPACE}administrativeData/{_NAMESPACE}items/{_NAMESPACE}item")
    if len(items) != 1:
        raise _fault(path, "it does not say of which sensor it is", "one dcc:item", f"{len(items)}")
    core = root.find(f"{_NAMESPACE}administrativeData/{_NAMESPACE}coreData")
    number = _text(core, "uniqueIdentifier")
    if core is None or not number:
        raise _fault(path, "it has no number", "dcc:uniqueIdentifier", "none")
    cells: dict[str, Any] = {"serial": _serial(items[0], path), "certificate": number}
    if model := _text(items[0], "model"):
        cells["model"] = model
    cells["calibrated"] = _day(core, path)
    return DigitalCertificate(cells | _sensitivity_cells(root, path), signed.signer)


def _fault(path: Path, problem: str, expected: str, found: str) -> CorruptFileError:
    remedy = "write what its paper says of the sensor into a table of certificates (CSV)"
    return CorruptFileError(problem, path=path, expected=expected, found=found, remedy=remedy)


def _text(of: Any, name: str) -> str:
    found = None if of is None else of.find(f"{_NAMESPACE}{name}")
    return "" if found is None else " ".join((found.text or "").split())


def _serial(item: Any, path: Path) -> str:
    """Return the serial number: what is called so, else the one number that the manufacturer gave."""
    found = list(item.iterfind(f"{_NAMESPACE}identifications/{_NAMESPACE}identification"))
    called = [one for one in found if "basic_serialnumber" in (one.get("refType") or "").casefold().split()]
    of_maker = called or [one for one in found if _text(one, "issuer") == "manufacturer"]
    named = [one for one in of_maker if any("seri" in text.casefold() for text in one.itertext())]
    serials = {_text(one, "value") for one in (of_maker if len(of_maker) == 1 else named)} - {""}
    if len(serials) != 1:
        expected = "one dcc:identification of the manufacturer"
        raise _fault(
            path, "it does not say which serial number the sensor has", expected, ", ".join(sorted(serials)) or "none"
        )
    return serials.pop()


def _day(core: Any, path: Path) -> dt.date:
    text = _text(core, "endPerformanceDate") or _text(core, "beginPerformanceDate")
    try:
        return dt.date.fromisoformat(text[:10])
    except ValueError as error:
        raise _fault(path, "it has no date", "dcc:endPerformanceDate, as 2026-03-01", text or "none") from error


def _sensitivity_cells(root: Any, path: Path) -> dict[str, Any]:
    """Return the one sensitivity of the results with its unit and its uncertainty."""
    stated: dict[_Real, Sensitivity] = {}
    others: list[str] = []
    for result in root.iterfind(f"{_NAMESPACE}measurementResults/{_NAMESPACE}measurementResult/{_NAMESPACE}results"):
        for number in _reals(result, path):
            sensitivity = _sensitivity(number.unit)
            if sensitivity is None:
                others.append(number.unit)
            else:
                stated[number] = sensitivity
    if len(stated) != 1:
        units = ", ".join(dict.fromkeys(others)) or "none"
        found = f"{len(stated)} of them" if stated else f"results in {units}"
        expected = r"one, in a unit such as \milli\volt\per\mega\pascal"
        raise _fault(path, "it does not say what the sensor's sensitivity is", expected, found)
    ((number, sensitivity),) = stated.items()
    if not (math.isfinite(number.value) and number.value > 0 and math.isfinite(number.U) and number.U >= 0 < number.k):
        found = f"{number.value:g} with U {number.U:g}, k {number.k:g}"
        raise _fault(path, "its sensitivity is none", "a positive number with its expanded uncertainty and k", found)
    return {
        **({"quantity": min(sensitivity.per.quantities)} if len(sensitivity.per.quantities) == 1 else {}),
        "sensitivity": number.value,
        "sensitivity_unit": f"{sensitivity.output_name}/{sensitivity.per_name}",
        "U_percent": 100.0 * number.U / number.value,
        "k": number.k,
    }


class _Real(NamedTuple):
    value: float
    unit: str
    U: float
    k: float


def _reals(results: Any, path: Path) -> Iterator[_Real]:
    """Yield the numbers of results, of lists each, with their uncertainties; NaN where one states none."""
    for one in results.iter(f"{_SI}real", f"{_SI}realListXMLList"):
        several = "XMLList" if one.tag.endswith("XMLList") else ""
        if any(ancestor.tag == f"{_NAMESPACE}measurementMetaData" for ancestor in one.iterancestors()):
            continue  # limits and nominal values
        parent = one.getparent()
        if parent.tag == f"{_SI}hybrid" and parent.index(one):
            continue  # the same in another unit
        values, units = (_words(one, f"{name}{several}") for name in ("value", "unit"))
        U = _words(one, f"uncertainty{several}") or _words(one, f"valueExpandedMU{several}")
        k = _words(one, f"coverageFactor{several}")
        if not U and (u := _words(one, f"valueStandardMU{several}")):
            U, k = u, ["1"]
        try:
            for at, value in enumerate(values):
                at_U, at_k, unit = (_at(each, at) for each in (U, k, units))
                yield _Real(float(value), unit, float(at_U or "nan"), float(at_k or "nan"))
        except ValueError as error:
            raise _fault(path, "a number of its results is none", "numbers", str(error)) from error


def _words(of: Any, name: str) -> list[str]:
    return (next((one.text or "" for one in of.iter(f"{_SI}{name}")), "")).split()


def _at(words: list[str], at: int) -> str:
    """Return the word of a place; of a list of one word it is that of every place."""
    return "" if not words else words[0] if len(words) == 1 else words[at] if at < len(words) else ""


def _sensitivity(unit: str) -> Sensitivity | None:
    """Read a unit of the D-SI as that of a sensitivity; None if it is of something else."""
    powers: list[tuple[str, int]] = []
    prefix, sign = "", 1
    if _TOKEN.sub("", unit).strip():
        return None
    for word, argument in _TOKEN.findall(unit):
        if word == "per":
            sign = -1
        elif word in _PREFIXES:
            prefix = _PREFIXES[word]
        elif word in _UNITS:
            powers.append((f"{prefix}{_UNITS[word]}", sign))
            prefix, sign = "", 1
        elif word == "tothe" and powers and re.fullmatch(r"-?\d", argument):
            name, power = powers.pop()
            powers.append((name, power * int(argument)))
        else:
            return None
    (output, first), *rest = powers or [("", 0)]
    if first != 1 or not rest:
        return None
    above = [name if power == -1 else f"{name}{-power}" for name, power in rest if power < 0]
    if output.endswith("V") and above[:1] == ["V"]:  # a bridge, by its supply
        output, above = f"{output}/V", above[1:]
    below = [name if power == 1 else f"{name}{power}" for name, power in rest if power > 0]
    per = "/".join(["·".join(above), *below])
    if not above or find_unit(per) is None:
        return None
    try:
        return sensitivity_from_text(f"1 {output}/{per if not below else f'({per})'}")
    except ValueError:
        return None
