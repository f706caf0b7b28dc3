"""Identity of what is handed over: who issues a report, for whom, under which number, and with which tolerance.

It stands in the table ``[report]`` of a rig file, or in a file of its own that is given with ``--header`` and says what
the rig does not. All of it is input: a report that is made again says the same.
"""

from __future__ import annotations

import base64
import binascii
import datetime as dt
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from recoil_acquisition.errors import Fault, FaultCode, ReadError, RigError
from recoil_acquisition.files.bounded_toml import LARGEST_BYTES, parse_toml
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.quantities.declaration import DeclaredTable, Text, Texts, declared
from recoil_acquisition.quantities.quantity import find_unit

REPORT = "report"
"""Name of the table in a rig file, and in a header file where it is a table there."""
LARGEST_LOGO = 200_000
"""Bytes of a logo's picture, beyond which it is refused: it is in every report."""
DISPLAYED = ("acceleration", "angular_rate", "displacement", "force", "pressure", "velocity")
"""Quantities whose unit on pages and paper can be chosen."""
PICTURES = {"png": b"\x89PNG\r\n\x1a\n", "jpeg": b"\xff\xd8\xff"}
"""Kinds of pictures that a logo may be, and how their files begin."""

DecisionRule = str | float
"""`SIMPLE`, `GUARD_BAND`, or a probability of the customer's own."""
SIMPLE, GUARD_BAND = "simple", "guard band"
"""Names of decision rules: the measured value alone counts, or it keeps the distance U from a limit."""
USUAL_RULE = 0.95
"""Decision rule where none is stated: the probability from which on a mass is said to conform."""
OF_ONE_DOCUMENT = ("number", "issue", "date", "approval", "concession", "replaces", "fired_from", "fired_until")
"""Keys that are one document's: no other one takes them over."""
SHOT, CAMPAIGN = "{shot}", "{campaign}"
"""Words of a number that stand for the name of the shot, and of the campaign's folder."""

_WORD = re.compile(r"\{[^{}]*\}")
_DATA = re.compile(r"data:image/(png|jpeg);base64,([A-Za-z0-9+/=]+)")


def _open_sides(value: Any) -> Any:
    """Take a side without a limit, which JSON has no number for, as infinite."""
    if not isinstance(value, list | tuple) or len(value) != 2:
        return value
    return [open_side if one is None else one for one, open_side in zip(value, (-math.inf, math.inf), strict=True)]


def _date(value: Any) -> Any:
    """Take a date as documents have it, a text, for one."""
    with suppress(ValueError):
        return dt.date.fromisoformat(value) if isinstance(value, str) else value
    return value


_Date = Annotated[dt.date, BeforeValidator(_date)]
_Limit = Annotated[float, Field(allow_inf_nan=True)]
_Limits = Annotated[tuple[_Limit, _Limit], Field(strict=False), BeforeValidator(_open_sides)]


class Issue(DeclaredTable):
    """Identity of a report, and the tolerance of the mass; what is left out is not on the report."""

    laboratory: Text | None = None
    """Laboratory that issues the report, with its address."""
    country: Text | None = None
    """Country of the laboratory, two letters of ISO 3166-1 such as "DE"; `certificate --dcc` asks for it."""
    customer: Text | None = None
    """Customer for whom the mass was found."""
    order: Text | None = None
    """Order under which it was found."""
    number: Text | None = None
    """Number of the report; ``{shot}`` in it is the shot's name, ``{campaign}`` that of the campaign's folder."""
    issue: Text | None = None
    """Issue of the report, and its date: "1, 2026-11-26"."""
    date: _Date | None = None
    """Date of issue, such as 2026-11-26."""
    replaces: Text | None = None
    """Number and issue of what this one replaces, and why: "TR-41, issue 1: customer's name corrected"."""
    approval: Text | None = None
    """Name of who approves the report, and when."""
    operator: Text | None = None
    """Name of who carried the test out."""
    place: Text | None = None
    """Place of the test."""
    item: Text | None = None
    """Item that was tested: what it is, its number, and its condition."""
    received: _Date | None = None
    """Date of receipt of the item, such as 2026-11-20."""
    fired_from: _Date | None = None
    """First day of firing, such as 2026-11-24, where the files of the shots do not state it."""
    fired_until: _Date | None = None
    """Last day of firing; the first one if left out."""
    remark: Text | None = None
    """Sentence that the reader should see."""
    logo: Text | None = None
    """Picture of the laboratory, PNG or JPEG: ``data:image/png;base64,..``; in a header file also the name of a file
    beside it."""
    concession: Text | None = None
    """Sentence on who accepts a result that is not valid or does not conform, and why: "accepted by .. because .."."""
    tolerance_kg: _Limits | None = None
    """Tolerance ``[lower, upper]`` of the mass about the specification, kg; ``-inf`` or ``inf`` for a side without a
    limit."""
    decision_rule: float | str | None = None
    """Rule, agreed with the customer, by which the mass conforms: ``"simple"``, ``"guard band"`` or a probability; 0.95
    if left out."""
    units: Texts | None = None
    """Units of figures, peaks and sentences, one of each quantity: ``["bar", "g", "lbf"]``; SI of the others. Documents
    and tables for machines stay in SI, and masses in kg."""

    def contradictions(self) -> Sequence[Fault]:
        """Return what is wrong with a tolerance or a logo."""
        found: list[tuple[str, str]] = []
        limits = self.tolerance_kg
        if limits is not None and not (limits[0] < limits[1] and any(map(math.isfinite, limits))):
            example = "such as [-4.0, 4.0], or [-inf, 4.0] with one limit"
            found.append(("tolerance_kg", f"must be [lower, upper] about the specification, {example}"))
        found += [("decision_rule", problem) for problem in _faults_of_rule(self.decision_rule)]
        found += [("number", problem) for problem in _faults_of_number(self.number)]
        if self.country is not None and not re.fullmatch("[A-Z]{2}", self.country):
            found.append(("country", f'must be two letters of ISO 3166-1 such as "DE"; found {self.country!r}'))
        if self.fired_until is not None and not (self.fired_from and self.fired_from <= self.fired_until):
            found.append(("fired_until", "must be a day on or after `fired_from`, which is stated with it"))
        found += [("units", problem) for problem in _faults_of_units(self.units or ())]
        if self.logo is not None and (problem := _fault_of_logo(self.logo)):
            found.append(("logo", problem))
        return [Fault((key,), problem, FaultCode.CONTRADICTION) for key, problem in found]

    @property
    def shared_number(self) -> tuple[Fault, ...]:
        """Number that would be that of every document."""
        if self.number is None or _WORD.search(self.number):
            return ()
        problem = f"would stand on the report of every shot: write {SHOT} in it, or give it with --header"
        return (Fault(("number",), problem, FaultCode.UNUSUAL),)

    def over(self, other: Issue) -> Issue:
        """Return both as one: what this one leaves out is the other's."""
        return Issue.model_validate(other.to_json() | self.to_json())

    def of_another(self) -> Issue:
        """Return what another document may take over: not what is one document's."""
        return self.model_copy(update=dict.fromkeys(OF_ONE_DOCUMENT))

    def named(self, word: str, name: str) -> Issue:
        """Return it with the name of its document in the number.

        Parameters
        ----------
        word
            `SHOT` or `CAMPAIGN`.
        name
            Name of what the document is of.

        Raises
        ------
        ReadError
            If the number is that of another kind of document.
        """
        other = CAMPAIGN if word == SHOT else SHOT
        if self.number is None or not _WORD.search(self.number):
            return self
        if other in self.number:
            raise ReadError(
                f"the number of [report] or of the header has {other}, and this document is of a "
                f"{'shot' if word == SHOT else 'campaign'}",
                expected=word, found=self.number, remedy=f"write {word} there, or give another --header",
            )  # fmt: skip
        return self.model_copy(update={"number": self.number.replace(word, name)})

    def to_json(self) -> dict[str, Any]:
        """Return what is stated, in JSON types; a side without a limit is infinite."""
        return self.model_dump(mode="json", exclude_none=True)


NOTHING_STATED = Issue()
"""Identity of a report of which nothing is stated."""


def read_header(path: Path) -> Issue:
    """Read a header file: the keys of ``[report]``, with the table's name above them or without.

    Raises
    ------
    ReadError
        If there is no such file, or its logo cannot be read.
    RigError
        With every fault of the file.
    """
    if not path.exists():
        raise ReadError("no such header file", path=path, expected="a TOML file with the keys of a rig's [report]")
    try:
        tables = parse_toml(read_small(path, LARGEST_BYTES, "a header file").decode("utf-8-sig"))
    except ValueError as error:
        raise RigError(path, [Fault(("TOML",), str(error), FaultCode.SYNTAX)]) from error
    table = tables.get(REPORT, {}) if set(tables) == {REPORT} else dict(tables)
    if not isinstance(table, dict):
        raise RigError(path, [Fault((REPORT,), "must be a table", FaultCode.TYPE)])
    faults: list[Fault] = []
    logo = table.get("logo")
    if isinstance(logo, str) and _DATA.fullmatch(logo) is None:
        table["logo"] = _picture(path.parent / logo)
    found = declared(Issue, table, (REPORT,), faults)
    if found is None:
        raise RigError(path, faults)
    return found


def _picture(path: Path) -> str:
    """Return a picture's file as ``data:``."""
    try:
        there = path.is_file()
    except OSError:  # no system has a file of such a name
        there = False
    if not there:
        raise ReadError("no such picture", path=path, expected="a PNG or JPEG file beside the header file")
    content = read_small(path, LARGEST_LOGO, "a logo")
    kind = next((kind for kind, head in PICTURES.items() if content.startswith(head)), None)
    if kind is None:
        raise ReadError("is no picture of a logo", path=path, expected="PNG or JPEG", remedy="save it as PNG")
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"


def _faults_of_rule(rule: DecisionRule | None) -> Iterator[str]:
    """Say what is wrong with a decision rule."""
    if rule in (None, SIMPLE, GUARD_BAND) or (isinstance(rule, float | int) and 0.5 < rule < 1.0):
        return
    yield f'must be "{SIMPLE}", "{GUARD_BAND}", or a probability between 0.5 and 1 such as 0.95; found {rule!r}'


def _faults_of_number(number: str | None) -> Iterator[str]:
    """Say what is wrong with the words in braces of a number."""
    for word in _WORD.findall(number or ""):
        if word not in (SHOT, CAMPAIGN):
            yield f"may have {SHOT} or {CAMPAIGN} in it, and no other word in braces; found {word}"


def _faults_of_units(units: Sequence[str]) -> Iterator[str]:
    """Say what is wrong with units that were chosen."""
    known = [(name, find_unit(name)) for name in units]
    of: dict[str, str] = {}
    for name, unit in known:
        quantity = next((one for one in DISPLAYED if unit is not None and unit.quantities == {one}), None)
        if quantity is None:
            yield f'must be units of {", ".join(DISPLAYED)}, such as "bar"; found {name!r}'
        elif of.setdefault(quantity, name) != name:
            yield f"must be one unit of each quantity; of {quantity} there are {of[quantity]!r} and {name!r}"


def _fault_of_logo(logo: str) -> str:
    found = _DATA.fullmatch(logo)
    if found is None:
        return 'must be "data:image/png;base64,..", or the name of a PNG or JPEG file in a file given with --header'
    try:
        content = base64.b64decode(found[2], validate=True)
    except binascii.Error:
        return "is no base64"
    if len(content) > LARGEST_LOGO:
        return f"has {len(content):,} bytes, more than {LARGEST_LOGO:,}: make the picture smaller"
    return "" if content.startswith(PICTURES[found[1]]) else f"is no {found[1].upper()} picture"
