"""The certificates of a stand's sensors in one table, ``sensors.csv``: a row for each quantity of a sensor.

What a certificate states is kept as it states it: an expanded uncertainty in percent with its coverage factor, a
sensitivity with its unit. `Certificate.sensor` is what a rig file has of it: ``U_rel`` with its ``k``, shares
instead of percent.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from recoil_acquisition.errors import (
    Fault,
    FaultCode,
    RecoilDaqError,
    RigError,
    Row,
    did_you_mean,
    nearest_first,
    quoted,
)
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.shot_name import composed
from recoil_acquisition.quantities.quantity import SI_UNITS, UNITS, Unit, find_unit, normalise_unit
from recoil_acquisition.quantities.typed_quantity import TypedError, typed_quantity
from recoil_acquisition.store.spreadsheet import LARGEST_BYTES, Line, Spreadsheet
from recoil_acquisition.store.written_number import decimal_mark
from recoil_rigs.tables.channel_table import ChannelSpec
from recoil_rigs.tables.digital_certificate import is_digital_certificate, read_digital_certificate
from recoil_rigs.tables.sensitivity import sensitivity_from_text

USUAL_NAME = "sensors.csv"
"""Usual name of the table, beside the rig file."""

COLUMNS: Mapping[str, str] = {
    "serial": "serial number, by which a rig's sensor is known",
    "model": "the sensor's type",
    "signal": "the signal that it is recorded as, where it stays plugged in there; may be left out",
    "quantity": "quantity that it measures, such as pressure",
    "unit": "unit of the range, such as MPa",
    "sensitivity": "sensitivity as certified, without its unit, where the chain is recorded in volts",
    "sensitivity_unit": "its unit, such as mV/MPa, pC/bar or mV/g",
    "zero_volts": "output at zero, V, of a chain with a bias that is recorded in volts",
    "range_low": "lower end of the range",
    "range_high": "upper end of the range",
    "U_percent": "expanded uncertainty of the sensitivity, percent",
    "k": "coverage factor of U_percent, mostly 2",
    "nu": "degrees of freedom of U_percent / k, where the certificate states them",
    "certificate": "number of the certificate",
    "dcc": "file of the digital certificate (DCC), beside the table; what the row leaves out is as it says",
    "calibrated": "date of the certificate, such as 2026-03-01 or 01.03.2026",
    "due": "date by which it is to be calibrated again",
    "calibration": "static or dynamic: found at rest, or in pulses like a shot's",
    "reference": "name of the standard that it was calibrated against",
    "u_reference_percent": "standard uncertainty that the standard brings, percent; a part of U_percent / k",
    "zero_percent": "by how much its zero may move in a shot, percent of the range",
    "amplifier": "V per pC of a charge amplifier, V per mA, V per mV/V; the gain where the sensor gives out volts",
    "filter_hz": "cut-off of its anti-alias filter, Hz",
    "filter_type": "bessel or butterworth",
    "filter_order": "order of that filter",
    "delay_s": "delay of the whole chain, s",
    "u_delay_s": "standard uncertainty of the delay, s",
    "distortion_mm": "length by which a camera's optics may bend a travel, mm",
}
"""Column -> what stands in it; all but the first may be left out."""

_UNITS: Mapping[str, str] = {
    **dict.fromkeys(("U_percent", "u_reference_percent", "zero_percent"), "%"),
    "zero_volts": "V", "filter_hz": "Hz", "delay_s": "s", "u_delay_s": "s", "distortion_mm": "mm",
}  # fmt: skip
"""Column of numbers -> the numbers' unit, where it has one of its own."""
_UNIT_BESIDE: Mapping[str, str] = {
    "range_low": "unit", "range_high": "unit", "sensitivity": "sensitivity_unit",
}  # fmt: skip
"""Column of numbers -> the one that states their unit."""
_TEXTS = (
    "serial", "model", "signal", "quantity", "unit", "sensitivity_unit", "calibration", "reference", "filter_type",
    "certificate", "dcc",
)  # fmt: skip
_DATES = ("calibrated", "due")
_WHOLE = ("filter_order",)
_SIGNED = ("range_low", "range_high", "zero_volts")
_POSITIVE = ("sensitivity", "k", "nu", "amplifier", "filter_hz", "filter_order")
_DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})", re.ASCII)
"""Dates as German spreadsheets write them; with slashes nobody knows which number is the day."""
_CHOICES: Mapping[str, tuple[str, ...]] = {
    "calibration": ("static", "dynamic"), "filter_type": ("bessel", "butterworth"),
}  # fmt: skip
"""Column of texts -> what may stand there."""
SAME = 1e-6
"""Relative difference of two numbers that say the same, of which one may be rounded."""
MOST_LINES = 8
"""Number of further rows with the same fault that are named."""
_PAIRS = (
    ("U_percent", "k"), ("k", "U_percent"), ("nu", "U_percent"), ("range_low", "range_high"),
    ("range_high", "range_low"),
    ("sensitivity", "sensitivity_unit"), ("sensitivity_unit", "sensitivity"), ("range_high", "unit"),
    ("zero_volts", "sensitivity"),
    ("u_reference_percent", "reference"), ("filter_type", "filter_hz"), ("filter_order", "filter_type"),
    ("u_delay_s", "delay_s"),
)  # fmt: skip
"""Column that a row states -> the one that it must state with it."""


@dataclass(frozen=True)
class Certificate:
    """Certificate of a sensor, or of one quantity of it.

    Attributes
    ----------
    line
        Line of the file in which it stands, from 1; 0 of a digital certificate.
    cells
        Stated values by their columns: texts, numbers and dates; what is left out has no key.
    file, said
        Name of its file, and what a digital certificate's signature says of it; empty of a row that names none.
    """

    line: int
    cells: Mapping[str, Any]
    file: str = ""
    said: str = ""

    @property
    def place(self) -> str:
        """Where it stands, in words."""
        return f"row {self.line} of the table" if self.line else self.file

    @property
    def serial(self) -> str:
        """Serial number of the sensor."""
        return str(self.cells["serial"])

    @property
    def quantity(self) -> str:
        """Quantity that is certified; empty if the table states none."""
        return str(self.cells.get("quantity", ""))

    @property
    def signal(self) -> str:
        """Signal that the sensor is recorded as; empty if the table states none."""
        return str(self.cells.get("signal", ""))

    def names_same(self, other: Certificate) -> bool:
        """Whether two rows name one quantity of one sensor; of several in a housing each names its signal."""
        return (self.serial, self.quantity, self.signal) == (other.serial, other.quantity, other.signal)

    def sensor(self, unit: str | None) -> dict[str, Any]:
        """Return the keys of a rig file's ``sensor``.

        Parameters
        ----------
        unit
            Unit in which the channel's range stands: that of its numbers; None if that is not known, and the range
            stays in the table's.
        """
        cells = self.cells
        found: dict[str, Any] = {key: cells[key] for key in ("model", "serial", "certificate", *_DATES) if key in cells}
        if "U_percent" in cells:
            found |= {"U_rel": _rounded(cells["U_percent"] / 100.0), "k": cells["k"]}
        found |= {key: cells[key] for key in ("nu", "calibration", "reference") if key in cells}
        for column, key in (("u_reference_percent", "u_reference_rel"), ("zero_percent", "u_zero_rel")):
            if column in cells:
                found[key] = _rounded(cells[column] / 100.0)
        if "range_low" in cells:
            units = find_unit(cells["unit"]), self._range_unit(unit)
            found["range"] = [_rounded(_turned(cells[key], *units)) for key in ("range_low", "range_high")]
        if "sensitivity" in cells:
            found["sensitivity"] = self.sensitivity
        if "zero_volts" in cells:
            found["zero"] = f"{cells['zero_volts']:.12g} V"
        same = ("amplifier", "filter_hz", "filter_type", "filter_order", "delay_s", "u_delay_s")
        found |= {key: cells[key] for key in same if key in cells}
        if "distortion_mm" in cells:
            found["u_distortion_m"] = _rounded(1e-3 * cells["distortion_mm"])
        return found

    @property
    def sensitivity(self) -> str:
        """Sensitivity with its unit, as a rig file has it; empty if the table states none."""
        if "sensitivity" not in self.cells:
            return ""
        return _sensitivity_text(self.cells)

    def _range_unit(self, unit: str | None) -> Unit | None:
        """Return the unit in which the rig reads the range: of the chain's volts, what its sensitivity is per."""
        own = None if unit is None else find_unit(unit)
        if self.sensitivity:
            stated = sensitivity_from_text(self.sensitivity)
            if own is None or stated.turned_into(own):
                return stated.per
        return own


def _turned(value: float, of: Unit | None, to: Unit | None) -> float:
    """Turn a value into another unit of the same quantity; leave it where either is not known, or they differ."""
    if of is None or to is None or not of.quantities & to.quantities:
        return value
    return value * (of.factor / to.factor) + (of.offset - to.offset) / to.factor


def _sensitivity_text(cells: Mapping[str, Any]) -> str:
    return f"{cells['sensitivity']:.12g} {cells['sensitivity_unit']}"


def _rounded(value: float) -> float:
    """Return a number without what binary fractions add behind its twelfth digit."""
    return float(f"{value:.12g}")


def read_certificates(path: Path) -> tuple[Certificate, ...]:
    """Read a table of certificates, or a digital one.

    Raises
    ------
    ReadError
        If it is no table of text with a column ``serial``; if a digital certificate is none, was changed or revoked.
    RigError
        With every fault of its cells: row, column, what is expected, what stands there.
    """
    if is_digital_certificate(path):
        found_there = read_digital_certificate(path)
        return (Certificate(0, found_there.cells, path.name, str(found_there)),)
    sheet = Spreadsheet.of(read_small(path, LARGEST_BYTES, "a table of certificates"), path, "serial")
    names = {name.casefold(): name for name in COLUMNS}
    columns = [names.get(name.casefold(), "") for name in sheet.names()]
    faults = [_unknown_column(name) for name, known in zip(sheet.names(), columns, strict=True) if name and not known]
    faults += [
        Fault((f"column {name}",), "stands there twice; leave one out", FaultCode.DUPLICATE)
        for name in COLUMNS
        if columns.count(name) > 1
    ]
    numbers = [at for at, name in enumerate(columns) if name and name not in (*_TEXTS, *_DATES)]
    rows = _Rows(columns, decimal_mark(sheet, numbers))
    found = [one for line in sheet.lines if (one := rows.read(line)) is not None]
    faults += rows.faults()
    found = [_with_digital(one, path.parent, faults) for one in found]
    faults += same_twice(found)
    if faults:
        raise RigError(path, faults)
    return tuple(found)


def same_twice(found: Sequence[Certificate]) -> list[Fault]:
    """Name the certificates of which another one is of the same quantity of the same sensor."""
    faults = []
    for k, one in enumerate(found):
        before = next((before for before in found[:k] if before.names_same(one)), None)
        if before is not None:
            where = f"row {before.line}" if before.line else before.file
            problem = f"{where} has the same sensor and quantity; leave the older certificate out"
            row = f"row {one.line}" if one.line else one.file
            faults.append(Fault((Row(row, one.serial), "serial"), problem, FaultCode.DUPLICATE))
    return faults


def _with_digital(row: Certificate, folder: Path, faults: list[Fault]) -> Certificate:
    """Fill in what a row leaves out by the digital certificate that it names; what differs is a fault."""
    if "dcc" not in row.cells:
        return row
    found = read_digital_certificate(folder / row.cells["dcc"])
    for column, value in found.cells.items():
        stated = row.cells.get(column, value)
        if not _same(column, stated, value):
            problem = f"{row.cells['dcc']} says {value}; found {stated}: correct it, or leave it out"
            faults.append(Fault((Row(f"row {row.line}", row.serial), column), problem, FaultCode.CONTRADICTION))
    return replace(row, cells={**found.cells, **row.cells}, file=str(row.cells["dcc"]), said=str(found))


def _same(column: str, one: Any, other: Any) -> bool:
    """Whether two cells of a column say the same."""
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=SAME)
    if column == "sensitivity_unit":
        return sensitivity_from_text(f"1 {one}").same_unit(sensitivity_from_text(f"1 {other}"))
    return bool(one == other)


def _unknown_column(name: str) -> Fault:
    problem = f"unknown column; {did_you_mean(name, tuple(COLUMNS), quote='`')}"
    return Fault((f"column {name}",), problem, FaultCode.UNKNOWN)


class _WrongCell(NamedTuple):
    """A cell that is at fault: its row with the row's line, and what stands there where that is told apart."""

    row: Row
    line: int
    column: str
    problem: str
    code: FaultCode
    found: str

    def fault(self, others: Sequence[int]) -> Fault:
        """Return its fault, with the lines of other rows that have the same."""
        shown = f"; found {self.found!r}" if self.found else ""
        if others:
            lines = ", ".join(map(str, others[:MOST_LINES])) + (", .." if len(others) > MOST_LINES else "")
            shown += f"; so in {len(others)} more: row{'s' * (len(others) > 1)} {lines}"
        return Fault((self.row, self.column), self.problem + shown, self.code)


class _Rows:
    """Rows of the table, read cell by cell."""

    def __init__(self, columns: list[str], mark: str) -> None:
        self._columns, self._mark = columns, mark
        self._wrong: list[_WrongCell] = []

    def read(self, line: Line) -> Certificate | None:
        """Return the certificate of a row; None if it has a fault."""
        before = len(self._wrong)
        texts = {
            name: cell.text for name, cell in zip(self._columns, line.cells, strict=False) if name and cell.text.strip()
        }
        self._row, self._line = Row(f"row {line.number}", texts.get("serial")), line.number
        if "serial" not in texts:
            self._fault("serial", "is missing: a sensor is known by it; write the number on its certificate")
            return None
        units = {**_UNITS, **{name: texts.get(beside) for name, beside in _UNIT_BESIDE.items()}}
        found = ((name, self._value(name, text, units.get(name))) for name, text in texts.items())
        cells = {name: value for name, value in found if value is not None}
        if len(self._wrong) == before:
            self._contradictions(cells)
        return Certificate(line.number, cells) if len(self._wrong) == before else None

    def _fault(self, column: str, problem: str, code: FaultCode = FaultCode.MISSING, found: str = "") -> None:
        self._wrong.append(_WrongCell(self._row, self._line, column, problem, code, found))

    def faults(self) -> list[Fault]:
        """Return a fault for each kind of fault of a column, in the row that has it first; the others are named."""
        kinds: dict[tuple[str, str], list[_WrongCell]] = {}
        for one in self._wrong:
            kinds.setdefault((one.column, one.problem), []).append(one)
        return [first.fault([one.line for one in others]) for first, *others in kinds.values()]

    def _value(self, column: str, text: str, unit: str | None) -> Any:
        """Return the value of a cell; None if it is none."""
        if column in _DATES:
            return self._date(column, text)
        if column in _TEXTS:
            return self._text(column, text)
        try:
            value = typed_quantity(text, unit, self._mark)
        except TypedError as error:
            problem = f"expected a number, {COLUMNS[column]}; what stands there {error}"
            self._fault(column, problem, FaultCode.TYPE, text)
            return None
        bound = "above 0" if column in _POSITIVE else "not below 0"
        if column not in _SIGNED and (value < 0 or (value == 0 and column in _POSITIVE)):
            self._fault(column, f"expected a number {bound}, {COLUMNS[column]}", FaultCode.RANGE, text)
            return None
        if column in _WHOLE:
            if value != int(value):
                self._fault(column, "expected a whole number", FaultCode.TYPE, text)
                return None
            return int(value)
        return value

    def _date(self, column: str, text: str) -> dt.date | None:
        day_first = _DAY_FIRST.fullmatch(text.strip())
        try:
            if day_first is not None:
                day, month, year = map(int, day_first.groups())
                return dt.date(year, month, day)
            return dt.date.fromisoformat(text.strip())
        except ValueError:
            problem = f"expected a date as 2026-03-01 or 01.03.2026, {COLUMNS[column]}"
            self._fault(column, problem, FaultCode.TYPE, text)
            return None

    def _text(self, column: str, text: str) -> str | None:
        folded = text.casefold() if column == "quantity" or column in _CHOICES else text
        expected = ""
        if column == "quantity" and folded not in SI_UNITS:
            expected = f"a quantity, such as {', '.join(nearest_first(text, list(SI_UNITS))[:3])}"
        elif column == "unit" and find_unit(text) is None:
            expected = f"a unit, nearest known {', '.join(nearest_first(normalise_unit(text), sorted(UNITS))[:3])}"
        elif column in _CHOICES and folded not in _CHOICES[column]:
            expected = " or ".join(_CHOICES[column])
        if expected:
            self._fault(column, f"expected {expected}", FaultCode.UNKNOWN, text)
            return None
        return folded

    def _contradictions(self, cells: Mapping[str, Any]) -> None:
        """Look for cells that are sound alone and do not go together."""
        for column, needed in _PAIRS:
            if column in cells and needed not in cells:
                self._fault(needed, f"is missing: `{column}` needs it: {COLUMNS[needed]}")
        unit = find_unit(cells.get("unit", ""))
        if "unit" in cells and "quantity" in cells and unit is not None and cells["quantity"] not in unit.quantities:
            fitting = ", ".join(name for name, one in UNITS.items() if cells["quantity"] in one.quantities)
            problem = f"{cells['unit']!r} is no unit of {cells['quantity']}; write one of {fitting}"
            self._fault("unit", problem, FaultCode.UNIT)
        if {"range_low", "range_high"} <= cells.keys() and not cells["range_low"] < cells["range_high"]:
            problem = f"expected more than `range_low`, {cells['range_low']:g}; found {cells['range_high']:g}"
            self._fault("range_high", problem, FaultCode.RANGE)
        if {"calibrated", "due"} <= cells.keys() and cells["due"] < cells["calibrated"]:
            problem = f"lies before `calibrated`, {cells['calibrated']}; found {cells['due']}"
            self._fault("due", problem, FaultCode.CONTRADICTION)
        if {"sensitivity", "sensitivity_unit"} <= cells.keys():
            self._sensitivity(cells)
        if {"U_percent", "k", "u_reference_percent"} <= cells.keys():
            whole = cells["U_percent"] / cells["k"]
            if cells["u_reference_percent"] > whole * (1 + 1e-9):
                problem = f"is more than U_percent / k, {whole:.3g}, of which it is a part"
                self._fault("u_reference_percent", problem, FaultCode.CONTRADICTION)

    def _sensitivity(self, cells: Mapping[str, Any]) -> None:
        text = _sensitivity_text(cells)
        try:
            stated = sensitivity_from_text(text)
        except ValueError as error:
            self._fault("sensitivity_unit", f"{text!r} {error}", FaultCode.UNIT)
            return
        if "quantity" in cells and cells["quantity"] not in stated.per.quantities:
            problem = f"is per {stated.per_name}, which is no unit of {cells['quantity']}"
            self._fault("sensitivity_unit", problem, FaultCode.UNIT)


def other_certificates(channels: Sequence[ChannelSpec], path: Path) -> list[Fault]:
    """Name the channels of a rig whose sensor has another certificate in the table than the rig states.

    Parameters
    ----------
    path
        Path of the table.

    Returns
    -------
    list of Fault
        A line for each; one for the table where that cannot be read.
    """
    try:
        certificates = read_certificates(path)
    except RecoilDaqError as error:
        return [Fault((path.name,), error.without_path(), FaultCode.FILE, path.name)]
    found = []
    for channel in channels:
        sensor, serial = channel.sensor, channel.sensor.serial
        one = certificate_for(certificates, serial=serial, signal=channel.signal, quantity=channel.quantity)
        if one is None or not serial:
            continue
        stated = {key: getattr(sensor, key) for key in ("calibrated", "due", "u_rel", "nu", "calibration")}
        table = one.sensor(channel.unit)
        if "U_rel" in table:
            table |= {"u_rel": table["U_rel"] / table["k"]}
        differing = [key for key, value in stated.items() if key in table and not _same(key, table[key], value)]
        if differing:
            values = ", ".join(f"{key} {table[key]} for {stated[key]}" for key in differing)
            remedy = f"take it over: `recoil-daq init FILES... --from RIG --sensors {quoted(path)}`"
            problem = f"{path.name}, row {one.line}, has another certificate of {serial}: {values}; {remedy}"
            found.append(Fault((Row("channel", channel.name), "sensor"), problem, FaultCode.CONTRADICTION))
    return found


def certificate_for(
    certificates: tuple[Certificate, ...], *, serial: str = "", signal: str = "", quantity: str = ""
) -> Certificate | None:
    """Return the one certificate of a channel's sensor; None if none or several may be meant.

    Parameters
    ----------
    serial
        Serial number of the sensor; empty if it is not known, and `signal` says which it is.
    signal
        Name of the channel's signal.
    quantity
        Quantity of the channel; empty if it is not known.
    """
    known = [one for one in certificates if not quantity or one.quantity in ("", quantity)]
    by_signal = [
        one for one in known if one.signal and composed(one.signal) == composed(signal) and serial in ("", one.serial)
    ]
    fitting = by_signal or [one for one in known if serial and one.serial == serial and not one.signal]
    # a row of the quantity itself says more than one that names none
    stating = [one for one in fitting if one.quantity] or fitting
    return stating[0] if len(stating) == 1 else None
