"""A part of a report explained: its numbers with their units, their formulas, and what entered these."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from recoil_acquisition.errors import nearest_first
from recoil_acquisition.shot.shot import Shot
from recoil_identification.report.document.formulas import Formula, formula_of
from recoil_identification.report.document.reproduction import parts_of, path_of
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.force_input import AREAS

EXPLAINED = ("mass", "rpe_percent", "conformity", "budget", "peaks", "alignment", "quantities")
"""Parts of a document that are explained where no key is given, as far as it has them."""
OTHER_NAMES = {"rpe": "rpe_percent"}
"""Key -> that of the report."""
_SUFFIXES = (
    ("_m_s2", "m/s^2"), ("_m_s", "m/s"), ("_n_s", "N s"), ("_percent", "%"), ("_hz", "Hz"), ("_kg", "kg"),
    ("_pa", "Pa"), ("_db", "dB"), ("_s", "s"), ("_m", "m"), ("_n", "N"),
)  # fmt: skip
"""Ends of keys -> unit; the longer first."""
_DIMENSIONLESS = frozenset({"E_n", "coverage_factor"})
"""Keys that have no unit, whatever they end with and wherever they stand."""
_OF_HOLDER = frozenset({"value", "u", "U95", "scatter", "offset", "noise", "at_rest", "amplitude", "largest_error"})
"""Keys whose unit stands beside them."""
_ROLES_OF_AREAS = dict(zip(AREAS, PRESSURE_ROLES, strict=True))
_RIG_UNITS = {"m3": "kg", "carried_mass": "kg", "friction": "N", "bore_friction": "1"}
"""Units of values of the mechanism; those of areas are m^2."""

_OTHER_NAMES = re.compile(rf"^({'|'.join(OTHER_NAMES)})(?![^.\[])")
_PLACE = re.compile(r"\[\d+\]")


@dataclass(frozen=True)
class Given:
    """An input of a number.

    Attributes
    ----------
    name
        A key path of the report, ``channel NAME``, or ``[mechanism] NAME``.
    value
        Value of JSON type; None where it has many.
    unit
        Unit of the value.
    u
        Standard uncertainty that the rig file states, in the value's unit, of a channel relative; None if none does.
    detail
        Description in words.
    """

    name: str
    value: Any = None
    unit: str = ""
    u: float | None = None
    detail: str = ""


@dataclass(frozen=True)
class Entry:
    """A part of a report: a value, or what has parts.

    Attributes
    ----------
    key
        Key path of the number.
    label
        Last piece of the key path.
    value
        Value of JSON type; None for what has parts.
    unit
        Unit of the value; empty where it has none.
    formula
        Formula of the number; None where it is no result of one.
    given
        Inputs of the formula.
    """

    key: str
    label: str
    value: Any = None
    unit: str = ""
    formula: Formula | None = None
    given: tuple[Given, ...] = ()
    parts: tuple[Entry, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types, without what it does not have."""
        stated: dict[str, Any] = {"key": self.key, "label": self.label}
        if not self.parts:
            stated |= {"value": self.value, "unit": self.unit or None}
        if self.formula is not None:
            stated |= {"formula": self.formula.text, "source": self.formula.source}
            stated["inputs"] = [asdict(one) for one in self.given]
        if self.parts:
            stated["parts"] = [one.to_json() for one in self.parts]
        return stated


def explained(document: Mapping[str, Any], key: str | None, fired: FiredShot | None) -> tuple[Entry, ...]:
    """Explain a part of a report, or what most ask for.

    Parameters
    ----------
    key
        A key path, such as ``mass.u`` or ``budget.packing friction``; quotes may be left out, and so may the end of a
        name that no other begins with. None for `EXPLAINED`.
    fired
        Shot and rig, for channels and values of the mechanism; None for a campaign, which has many.

    Raises
    ------
    LookupError
        If the report has no such key; with the nearest ones.
    """
    paths = EXPLAINED if key is None else (_OTHER_NAMES.sub(lambda name: OTHER_NAMES[name[0]], key),)
    given = _Sources(document, fired)
    found = [_found(document, path) for path in paths if key is not None or document.get(path) not in (None, [])]
    return tuple(_entry(path, path, plain, value, given) for path, plain, value in found)


def _found(document: Mapping[str, Any], key: str) -> tuple[str, str, Any]:
    """Return path, plain path and value of a key."""
    wanted = key.replace('"', "")
    found = list(_matches(document, wanted, "", "", whole=True)) or list(
        _matches(document, wanted, "", "", whole=False)
    )
    if len(found) == 1:
        return found[0]
    known = [plain for _, plain, _ in _all(document, "", "")]
    if len(found) > 1:
        several = ", ".join(plain for _, plain, _ in found[:6])
        raise LookupError(f"{key!r} may be {several}")
    raise LookupError(f"no key {key!r}; nearest names {', '.join(nearest_first(wanted, known)[:5])}")


def _matches(value: Any, rest: str, path: str, plain: str, *, whole: bool) -> list[tuple[str, str, Any]]:
    """List what a key leads to from here: piece by piece, a name as a whole or by its beginning."""
    found = []
    for label, part in parts_of(value):
        for written in [f"[{label}]", str(label)] if isinstance(label, int) else [label]:
            after = rest[len(written) :] if rest.startswith(written) else None
            if after == "" or (after is None and not whole and rest and written.startswith(rest)):
                found.append((path_of(path, label), _plain_path(plain, label), part))
            elif after and after[0] in ".[":
                there = path_of(path, label), _plain_path(plain, label)
                found += _matches(part, after.lstrip("."), *there, whole=whole)
    return found


def _all(value: Any, path: str, plain: str) -> list[tuple[str, str, Any]]:
    found = []
    for label, part in parts_of(value):
        there = path_of(path, label), _plain_path(plain, label), part
        # elements of an array have no names to confuse
        found += [] if isinstance(label, int) else [there, *_all(part, *there[:2])]
    return found


def _plain_path(parent: str, label: str | int) -> str:
    shown = f"[{label}]" if isinstance(label, int) else label
    return shown if not parent else parent + shown if isinstance(label, int) else f"{parent}.{shown}"


def _entry(label: str, path: str, plain: str, value: Any, sources: _Sources) -> Entry:
    parts = [(name, one) for name, one in parts_of(value) if not (isinstance(value, Mapping) and one == label)]
    if not parts or (isinstance(value, list) and not any(isinstance(one, Mapping) for one in value)):
        formula = formula_of(_PLACE.sub("", plain), sources.document)
        return Entry(path, label, value, unit_of(plain, sources.document), formula, sources.of(formula, plain))
    inside = [_entry(str(name), path_of(path, name), _plain_path(plain, name), one, sources) for name, one in parts]
    common = [(one.formula, one.given) for one in inside if one.formula is not None]
    if len(common) > 1 and all(one == common[0] for one in common):
        # what all have in common is said once, of the whole
        formula, given = common[0]
        inside = [replace(one, formula=None, given=()) for one in inside]
        return Entry(path, label, None, "", formula, given, tuple(inside))
    return Entry(path, label, parts=tuple(inside))


def unit_of(key: str, document: Mapping[str, Any]) -> str:
    """Return the unit of a number of a report; empty where its key and what stands beside it tell none.

    Parameters
    ----------
    key
        Key path of the number without quotes.
    """
    parent, _, name = _PLACE.sub("", key).rpartition(".")
    if name in _DIMENSIONLESS:
        return ""
    if parent == "mass" and name not in ("method", "unit", "configuration", "deviation_percent"):
        return str(document["mass"]["unit"])
    holder = _value_at(document, parent)
    if parent.startswith("budget.") and isinstance(holder, Mapping):
        per = holder.get("sensitivity_per")
        if name == "sensitivity_kg" and per:
            return f"kg per {per}" if per != "1" else "kg"
        if name in ("u_source", "estimate"):
            return "" if per in (None, "1") else str(per)
    if isinstance(holder, Mapping) and isinstance(holder.get("unit"), str) and name in _OF_HOLDER:
        return "" if holder["unit"] == "1" else str(holder["unit"])
    of_whom = parent.rpartition(".")[2] if name in ("value", "u", "U95") else name
    return next((unit for suffix, unit in _SUFFIXES if of_whom.endswith(suffix)), "")


def _value_at(document: Any, key: str) -> Any:
    found = _matches(document, key, "", "", whole=True) if key else []
    return found[0][2] if found else None


class _Sources:
    """Looks up what enters a formula.

    Parameters
    ----------
    document
        The report.
    fired
        Shot and rig, for channels and values of the mechanism; None where there are many.
    """

    def __init__(self, document: Mapping[str, Any], fired: FiredShot | None) -> None:
        self.document, self.fired = document, fired

    def of(self, formula: Formula | None, key: str) -> tuple[Given, ...]:
        """Return what entered a number with its values."""
        if formula is None:
            return ()
        stated = tuple(one for name in self._besides(key, formula.inputs) if (one := self._report(name)) is not None)
        if self.fired is None:
            return stated
        return (
            *stated,
            *(one for role in self._roles(key, formula.roles) for one in self._channels(role)),
            *(self._mechanism(symbol) for symbol in self._symbols(key, formula.rig)),
            *self._aligned(key),
        )

    @property
    def shot(self) -> Shot:
        """The shot, where there is one."""
        return self._one.shot

    @property
    def rig(self) -> Rig:
        """Its rig."""
        return self._one.rig

    @property
    def _one(self) -> FiredShot:
        if self.fired is None:
            raise ValueError("a campaign has no shot of its own")
        return self.fired

    def _besides(self, key: str, inputs: Sequence[str]) -> Sequence[str]:
        """Add what stands beside a number of the budget."""
        if key.startswith("budget.") and key.endswith(".u_kg"):
            row = key.removesuffix(".u_kg")
            return (*inputs, f"{row}.sensitivity_kg", f"{row}.u_source")
        return inputs

    def _roles(self, key: str, roles: Sequence[str]) -> Sequence[str]:
        """Leave those that a row of the budget, or a peak, is not about."""
        named = [role for role in roles if f".{role}" in key]
        return named or roles

    def _symbols(self, key: str, symbols: Sequence[str]) -> Sequence[str]:
        """Leave those that a row of the budget is not about, and those that the rig's model has not."""
        having = self.rig.mechanism.symbols_of({one.role for one in self.rig.channels})
        named = [one for one in symbols if one in _ROLES_OF_AREAS and f".{_ROLES_OF_AREAS[one]}" in key]
        return [one for one in named or symbols if one in having]

    def _report(self, name: str) -> Given | None:
        value = _value_at(self.document, name)
        if value is None:
            return None
        if isinstance(value, Mapping | list) and any(isinstance(one, Mapping | list) for one in value):
            return Given(name, detail=f"{len(value)} rows of the report")
        return Given(name, value, unit_of(name, self.document))

    def _channels(self, role: str) -> list[Given]:
        found = []
        for channel in self.shot.with_role(role):
            sensor = self.rig.channel(channel.name).sensor
            said = [
                f"{role}, clock {channel.time_base.clock}, {channel.time_base.count} samples",
                " ".join(word for word in ("sensor", sensor.model, sensor.serial) if word),
            ]
            if sensor.calibrated is not None:
                said.append(f"calibrated {sensor.calibrated.isoformat()}")
            found.append(Given(f"channel {channel.name}", None, channel.unit, sensor.u_scale_rel, ", ".join(said)))
        return found

    def _aligned(self, key: str) -> Iterator[Given]:
        """Say how the rig aligns the clock that a number of the alignment is of."""
        clock = key.removeprefix("alignment.").rpartition(".")[0]
        source = next((one for one in self.rig.sources if one.name == clock), None)
        if key.startswith("alignment.") and source is not None and source.align is not None:
            stated = source.align.model_dump(mode="json", exclude_unset=True)
            yield Given(f"[[source]] {clock}, align", stated)

    def _mechanism(self, symbol: str) -> Given:
        mechanism = self.rig.mechanism
        value, u = getattr(mechanism, symbol), mechanism.u.get(symbol)
        if symbol == "m3":  # as the rig file has it: what was added is the shot log's
            value, u = self.rig.specification.m3_kg, self.rig.specification.u_m3_kg or None
        unit = _RIG_UNITS.get(symbol, "m^2")
        exact = "" if u is not None else "taken as exact"
        return Given(f"[mechanism] {symbol}", value, unit, u, exact)
