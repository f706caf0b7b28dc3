"""A report against the same report made again: whether each of its numbers comes again, and what differs if not.

On the same kind of computer with the same versions numbers come again to the last bit. Elsewhere the order in which
sums are taken differs, and they come again

- within `ELSEWHERE` of themselves, of the largest number of the array or column that they stand in, and deviations in
  percent of 100 %: near zero they are the rounding of what they are the difference of;
- within `OF_RESIDUALS` where they are computed of residuals: standard uncertainties and what contributes to them,
  tests, what a shot says of others. A residual of 1 m/s^2 is what is left of 1000, and its rounding that of the whole.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from fnmatch import translate
from typing import Any, NamedTuple

import numpy as np

ELSEWHERE = 1e-9
"""Relative difference within which a number comes again on another computer, or with other versions."""
OF_RESIDUALS = 1e-6
"""Relative difference within which a number comes again that is computed of residuals."""
RESIDUALS = (
    "*.u", "*.u_*", "*U95*", "E_n", "budget.*", "uncertainty.*", "campaign.*", "constancy.*", "endogeneity.*",
    "mass_over_time.*", "sensors.*", "correlations.*", "conformity.*", "skew.*", "zero_shift.*", "fusion.*",
    "provenance.parameters.residual_*", "configurations.*", "shots.*", "common.*", "gauges.*", "signals.*", "charts.*",
    "repeatability.*", "agreement.*", "next.*", "quantities.*",
)  # fmt: skip
"""Key paths of what is computed of residuals."""
LARGEST_TRIANGLE = 1000
"""Numbers of R, which has some hundred: one that has more is compared as it stands."""
NAMED_BY = ("source", "clock", "name", "channel", "quantity", "key", "file")
"""Keys by which the rows of a table are told apart, the first that every row has another value of."""
IN_SIGMAS = ("_sigma", ".pull", ".normalised_residual", ".criterion", "E_n")
"""Ends of the key paths of numbers that count standard uncertainties."""
LONGEST_NUMBER, LARGEST_POWER = 300, 308
"""Limits of numbers in texts; beyond these they are no numbers that were printed."""
_PLACE = re.compile(r"\[\d+\]")
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_OF_RESIDUALS = re.compile("|".join(map(translate, RESIDUALS)))
_PLAIN = re.compile(r"[A-Za-z_][\w-]*")


class Leaf(NamedTuple):
    """A single value of a report.

    Attributes
    ----------
    value
        JSON type.
    scale
        Largest magnitude of the array that a number stands in, its own where it stands by itself; 0 for no number.
    """

    value: Any
    scale: float


@dataclass(frozen=True)
class Difference:
    """A number, or a word, that did not come about again.

    Attributes
    ----------
    key
        Path of the value in the report, or a cell of a file beside it.
    stored, again
        JSON types; None for what is not there.
    relative
        Difference of two numbers, relative as `ELSEWHERE` is; infinite for anything else.
    """

    key: str
    stored: Any
    again: Any
    relative: float = math.inf

    def __str__(self) -> str:
        by = f", relative {self.relative:.2g}" if math.isfinite(self.relative) else ""
        return f"{self.key}: {_shown(self.stored)} in the report, {_shown(self.again)} again{by}"

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types; the relative difference is None where it is infinite."""
        relative = self.relative if math.isfinite(self.relative) else None
        return {"key": self.key, "stored": self.stored, "again": self.again, "relative": relative}

    @classmethod
    def of_json(cls, stated: Mapping[str, Any]) -> Difference:
        """Return the difference that `to_json` stated."""
        relative = math.inf if stated["relative"] is None else stated["relative"]
        return cls(stated["key"], stated["stored"], stated["again"], relative)


@dataclass(frozen=True)
class NotCompared:
    """A file beside a document that was not compared.

    Attributes
    ----------
    file
        Name of the file in the document's folder.
    why
        Sentence on the reason.
    stated
        Whether the document says that the file was written with it: then the document does not come again as a whole.
    """

    file: str
    why: str
    stated: bool

    def __str__(self) -> str:
        return f"{self.file} was not compared: {self.why}"

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types."""
        return asdict(self)


@dataclass(frozen=True)
class Comparison:
    """The outcome of a comparison.

    Attributes
    ----------
    numbers
        Count of the numbers that were compared.
    differences
        Differences beyond the tolerance; the worst first, and what is no number before.
    largest
        Relative difference of any number that is not computed of residuals, within the tolerance or not.
    drawings
        Names of pages, paper copies, figures and scripts that hold what they should.
    not_compared
        Files that were not compared.
    """

    numbers: int = 0
    differences: tuple[Difference, ...] = ()
    largest: float = 0.0
    drawings: tuple[str, ...] = ()
    not_compared: tuple[NotCompared, ...] = ()

    @classmethod
    def of(cls, found: Iterable[Difference | NotCompared | str]) -> Comparison:
        """Return the outcome for files: each differs, was not compared, or by its name holds what it should."""
        every = list(found)
        return cls(
            differences=tuple(one for one in every if isinstance(one, Difference)),
            drawings=tuple(one for one in every if isinstance(one, str)),
            not_compared=tuple(one for one in every if isinstance(one, NotCompared)),
        )

    @property
    def again(self) -> bool:
        """Whether all that was written comes again: nothing differs, and nothing of it was left unlooked at."""
        return not self.differences and not any(one.stated for one in self.not_compared)

    def joined(self, other: Comparison) -> Comparison:
        """Return both as one."""
        found = sorted((*self.differences, *other.differences), key=lambda one: -one.relative)
        return Comparison(
            self.numbers + other.numbers,
            tuple(found),
            max(self.largest, other.largest),
            (*self.drawings, *other.drawings),
            (*self.not_compared, *other.not_compared),
        )


def path_of(parent: str, label: str | int) -> str:
    """Return the key path of a part of a report, quoted where it needs to be.

    >>> path_of("budget", "packing friction"), path_of("mass.U95", 0)
    ('budget."packing friction"', 'mass.U95[0]')
    """
    if isinstance(label, int):
        return f"{parent}[{label}]"
    shown = label if _PLAIN.fullmatch(label) else f'"{label}"'
    return f"{parent}.{shown}" if parent else shown


def parts_of(value: Any) -> list[tuple[str | int, Any]]:
    """Return the parts of a value with their labels; of a table's rows their names, none of a single value."""
    if isinstance(value, Mapping):
        return [(str(key), one) for key, one in value.items()]
    if not isinstance(value, list | tuple):
        return []
    if value and all(isinstance(one, Mapping) for one in value):
        for key in NAMED_BY:
            names = [one.get(key) for one in value]
            if all(isinstance(name, str) and name for name in names) and len(set(names)) == len(names):
                return list(zip(names, value, strict=True))
    return list(enumerate(value))


def leaves_of(document: Any, besides: Collection[str] = ()) -> dict[str, Leaf]:
    """Return all single values of a report by their key paths; not those of some paths, nor what is below them."""
    found: dict[str, Leaf] = {}
    _gather(found, document, "", None, 0.0, frozenset(besides))
    return found


def _gather(
    found: dict[str, Leaf], value: Any, key: str, of_array: float | None, beside: float, besides: Collection[str]
) -> None:
    """Put the single values below a key into a table: a report has ten thousand, and they are asked for often."""
    if key in besides:
        return
    if isinstance(value, float | int | str) or not isinstance(value, Mapping | list | tuple):
        found[key] = Leaf(value, max(_scale(key, value, of_array), beside))
        return
    parts = parts_of(value)
    if isinstance(value, Mapping):
        for label, part in parts:
            of_label = value.get(f"u_{label}", 0.0)
            largest = max(beside, abs(of_label)) if _is_number(of_label) else beside
            _gather(found, part, path_of(key, label), of_array, largest, besides)
        return
    if of_array is None and parts and not isinstance(parts[0][0], str):
        of_array = _largest(value)
    for label, part in parts:
        _gather(found, part, path_of(key, label), of_array, beside, besides)


def compare(
    stored: Mapping[str, Any], again: Mapping[str, Any], *, exact: bool, besides: Sequence[str] = ()
) -> Comparison:
    """Compare a report with the same report made again.

    Parameters
    ----------
    exact
        Whether to compare to the last bit, else within `ELSEWHERE`. A text must be the same; the numbers in it may then
        differ by one in the last place that is printed.
    besides
        Key paths whose values are not compared, nor what is below them.
    """
    if not exact:
        stored, again = _determined(stored), _determined(again)
    ours, theirs = (leaves_of(one, besides) for one in (stored, again))
    scales = _scales(stored)
    found: list[Difference] = []
    largest, numbers = 0.0, 0
    for key in dict.fromkeys((*ours, *theirs)):
        one, other = ours.get(key), theirs.get(key)
        if one is None or other is None:
            # a number that is not there is one that does not come again; null stands for no number
            found.append(Difference(key, one and one.value, other and other.value))
            continue
        if _is_number(one.value) and _is_number(other.value):
            numbers += 1
            if one.value == other.value:
                continue
            scale = max(one.scale, other.scale, scales.get(_PLACE.sub("", key), 0.0))
            relative = _relative(one.value, other.value, scale)
            of_residuals = _OF_RESIDUALS.match(key) is not None
            largest = largest if of_residuals else max(largest, relative)
            if one.value != other.value if exact else relative > (OF_RESIDUALS if of_residuals else ELSEWHERE):
                found.append(Difference(key, one.value, other.value, relative))
        elif not _same(one.value, other.value, exact=exact):
            found.append(Difference(key, one.value, other.value))
    return Comparison(numbers, tuple(sorted(found, key=lambda one: -one.relative)), largest)


def compare_tables(name: str, stored: str, again: str, *, exact: bool) -> Comparison:
    """Compare a file beside a report, a table with commas, with the same file made again, cell by cell.

    Parameters
    ----------
    name
        Name of the file.
    exact
        Whether to compare to the last bit; else numbers may differ by `ELSEWHERE` and one in the last place that is
        printed.
    """
    # cells of a campaign's table may have commas in them
    ours, theirs = (list(csv.reader(io.StringIO(text, newline=""))) for text in (stored, again))
    columns = theirs[0]
    numbers = sum(bool(cell) for row in theirs[1:] for cell in row)
    if stored == again:
        return Comparison(numbers)
    if ours[:1] != theirs[:1] or len(ours) != len(theirs):
        return Comparison(numbers, (Difference(name, f"{len(ours)} lines", f"{len(theirs)} lines"),))
    found, largest = [], 0.0
    scales = [_largest_cell(column) for column in zip(*theirs[1:], strict=True)]
    for row, (cells, others) in enumerate(zip(ours, theirs, strict=True)):
        if cells == others:
            continue
        if len(cells) != len(others):
            found.append(Difference(f"{name}[{row - 1}]", ",".join(cells), ",".join(others)))
            continue
        for column, scale, one, two in zip(columns, scales, cells, others, strict=True):
            relative = _relative_text(one, two, scale)
            largest = max(largest, relative if math.isfinite(relative) else 0.0)
            if one != two and (exact or not (relative <= ELSEWHERE or _last_place(one, two))):
                found.append(Difference(f"{name}[{row - 1}].{column}", one, two, relative))
    if not found and exact:
        found.append(Difference(name, "its text", "another text"))
    return Comparison(numbers, tuple(sorted(found, key=lambda one: -one.relative)), largest)


def _scales(document: Mapping[str, Any]) -> dict[str, float]:
    """Return the sizes that numbers near zero are compared with: u of the mass, and over each source's u, by key."""
    try:
        u_kg, rows = float(document["mass"]["u"]), parts_of(document["budget"])
        keys = [(path_of("budget", label), row.get("u_source")) for label, row in rows]
    except (KeyError, TypeError, ValueError, AttributeError):
        return {}
    scales = {path_of(key, "u_kg"): u_kg for key, _ in keys}
    scales |= {path_of(key, "sensitivity_kg"): u_kg / abs(u) for key, u in keys if _is_number(u) and u}
    return scales | {"uncertainty.monte_carlo.difference_kg": u_kg}


def _determined(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """Put a shot's information R'R and R'y for R and y: where R is singular these are told but for a rotation."""
    campaign: Any = document.get("campaign")
    try:
        triangle, seen = (np.array(campaign[key], dtype=np.float64) for key in ("R", "y"))
        if triangle.size > LARGEST_TRIANGLE:
            return document
        products = {"R'R": (triangle.T @ triangle).tolist(), "R'y": (triangle.T @ seen).tolist()}
    except (KeyError, TypeError, ValueError):
        return document
    return {**document, "campaign": {**{k: v for k, v in campaign.items() if k not in ("R", "y")}, **products}}


def _scale(key: str, value: Any, of_array: float | None) -> float:
    if not _is_number(value):
        return 0.0
    size = abs(value) if of_array is None else of_array
    if key.startswith("rpe_percent.") or key.endswith("_percent"):
        return max(size, 100.0)
    return max(size, 1.0) if key.endswith(IN_SIGMAS) else size


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _largest(value: Any) -> float | None:
    """Return the largest magnitude in an array of numbers; None for a list of anything else."""
    if isinstance(value, list | tuple):
        found = [_largest(one) for one in value]
        sizes = [one for one in found if one is not None]
        return max(sizes) if len(sizes) == len(found) and sizes else None
    if value is None:
        return 0.0
    return abs(value) if _is_number(value) else None


def _relative(one: float, other: float, scale: float) -> float:
    return 0.0 if one == other else abs(one - other) / scale


def _same(one: Any, other: Any, *, exact: bool) -> bool:
    if exact or not (isinstance(one, str) and isinstance(other, str)):
        return type(one) is type(other) and bool(one == other)
    return _NUMBER.sub("0", one) == _NUMBER.sub("0", other) and all(
        _last_place(a, b) for a, b in zip(_NUMBER.findall(one), _NUMBER.findall(other), strict=True)
    )


def _last_place(one: str, other: str) -> bool:
    """Return whether two printed numbers differ by no more than one in their last place."""
    if one == other:
        return True
    if max(len(one), len(other)) > LONGEST_NUMBER:
        return False
    places = [len(text.partition("e")[0].partition(".")[2]) for text in (one, other)]
    powers = [int(text.partition("e")[2] or 0) for text in (one, other)]
    if max(powers) > LARGEST_POWER:
        return False
    unit = max(10.0 ** (power - place) for power, place in zip(powers, places, strict=True))
    return bool(one and other) and abs(float(one) - float(other)) <= 1.5 * unit


def _relative_text(one: str, other: str, scale: float) -> float:
    """Return by how much two cells differ; infinite where either is blank or no number."""
    try:
        a, b = float(one), float(other)
    except ValueError:
        return 0.0 if one == other else math.inf
    return _relative(a, b, max(abs(a), abs(b), scale))


def _largest_cell(column: Sequence[str]) -> float:
    sizes = (_magnitude(cell) for cell in column)
    return max((size for size in sizes if math.isfinite(size)), default=0.0)


def _magnitude(cell: str) -> float:
    """Magnitude of a cell's number; 0 for a text."""
    try:
        return abs(float(cell))
    except ValueError:
        return 0.0


def _shown(value: Any) -> str:
    return "nothing" if value is None else repr(value) if isinstance(value, float) else str(value)
