"""Statements of a file, or of what describes it, on a signal's samples, and what becomes of those that nobody used.

A reader hands over with its samples all that stands beside them, and says which of it made them, their unit or their
instants. What the rest of it may do to a number is decided here alone, by what its name says in any reader's format:

    used      it made the samples, their unit or their instants: nothing to say
    noted     it may change what the samples mean, and they are taken as they are
    refused   the samples are stored integers, and it may scale or shift them: counts are no measurement

A range is held against the samples as they are read. A factor of 1 and an offset of 0 change nothing.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from math import isfinite, isnan, nan
from typing import Any
from unicodedata import normalize

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.time.wall_clock import about_unread_start, is_dated
from recoil_acquisition.remark import Note, NoteCode, Remark

MOST_SHOWN = 6
"""Signals that a note names."""
LONGEST_TEXT, LONGEST_LINE = 2000, 300
"""Signs of a text, and of a line, that are looked at."""
LONGEST = 80
"""Signs of a statement that a note quotes."""
_FEW = 16
"""Stored numbers for each that has a name, from which on the named ones are exceptions of a measurement."""
_USUAL = (999.0, 999.25, 999.9, 9999.0, 9999.9, 99999.0, 999999.0, 1e20, 1e30, 1e35, 9.96921e36, 3.4028235e38)
"""Sizes of numbers that programs write for a lost sample, of either sign."""
_LEAST_OTHERS = 8
"""Samples from which on one of these stands apart from them."""
_SCALES = (
    "scale", "scaling", "skal", "factor", "faktor", "facteur", "gain", "slope", "sensitiv", "calib", "kalib", "multipl",
    "conversion", "lsb", "coef", "perbit", "percount", "perdigit", "empfindlich", "amplif", "verstark", "verstaerk",
    "attenu", "massstab", "echelle", "escala", "exponent",
)  # fmt: skip
"""Parts of names of what may be a factor, or one of a polynomial's numbers."""
_SHIFTS = ("offset", "intercept", "bias", "zeropoint", "zerolevel", "nullpunkt", "baseline", "dclevel")
_SHIFT_WORDS = frozenset({"tare", "tara", "zero", "null"})
_TURNS = ("invert", "polarit")
_NOT_TURNED = frozenset({"", "0", "no", "none", "off", "false", "nein", "non", "normal", "positive", "+", "+1"})
"""Values of a sign that change no number, as of a polarity 1 does."""
_RANGES = ("range", "fullscale", "limit", "minimum", "maximum", "bereich")
_LOST = (
    "fillvalue",
    "missing",
    "nodata",
    "invalid",
    "undefined",
    "sentinel",
    "notavailable",
    "errorvalue",
    "flagvalue",
)
_INSTANTS = frozenset({"startoffset", "wfstartoffset", "timeoffset", "t0", "x0"})
"""Names of offsets of instants, which a unit may stand behind."""
_OF_TIME = (
    "start", "time", "trigger", "utc", "zone", "sync", "wfx", "bit", "byte", "xunit", "bandwidth", "frequency", "rate",
    "duration", "filter",
)  # fmt: skip
"""Parts of names of offsets, limits and units that are of instants, rates, or places in a file."""
_OF_PEOPLE = ("date", "day", "year", "due", "serial", "number", "ident", "type", "status", "name", "by")
"""Ends of names that say who calibrated what, and when: numbers of no factor."""
_OF_PLACES = frozenset((
    "channel", "kanal", "index", "length", "count", "size", "sample", "samples", "column", "row", "slot", "port",
    "node", "version", "address", "dimid", "coordinates", "id", "dt", "line", "bit", "bits", "log", "cutoff",
    "decimation",
))  # fmt: skip
"""Words in names of numbers that count and place, and measure nothing."""
_LEAST_WORDS, _MOST_WORDS = frozenset({"min", "low", "lower", "least"}), frozenset({"max", "high", "upper", "most"})
_STARTS = frozenset({"start", "starttime", "date", "datetime", "begin", "started", "timestamp", "datum"})
_RATES = frozenset({
    "fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "scanrate", "abtastrate",
})  # fmt: skip
"""Names, in small letters, of samples per second."""
_INTERVALS = frozenset({"dt", "deltat", "sampleinterval", "samplinginterval", "samplingperiod", "sampleperiod"})
"""Names of seconds from sample to sample."""
_PER = {"": 1.0, "hz": 1.0, "khz": 1e3, "mhz": 1e6, "s": 1.0, "ms": 1e-3, "us": 1e-6, "\u00b5s": 1e-6}
"""Units of rates and of intervals, in small letters."""
_SAME_RATE = 1e-3
"""Relative difference below which two rates are one, printed to three digits."""
_COUNTED_S = 3.5e8, 4.1e9
"""Seconds from 1970 to 1981 and to 2100."""
_NO_START = frozenset({"calibration", "cal", "due", "creation", "created", "modified", "version", "build"})
"""Words of dates that begin no record."""
_POLYNOMIAL = re.compile(r"[abckm]_?\d?", re.IGNORECASE)
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_EITHER = re.compile(r"\s*[+-]?[1-9]\d{0,2},\d{3}(?![\d,.])")
"""A number whose comma may part thousands or decimals."""
_NUMBER_AND_UNIT = re.compile(rf"\s*({_NUMBER})(?![\d.:-])\s*([^\d\s]\S*)?\s*")
_LINE = re.compile(
    rf"[\s#%/;*\"]*([^\W\d][^:=,;\t\"]{{0,60}}?)\"?\s*[:=,;\t]+\s*\"?({_NUMBER})(?![\d.:/-])\s*([^\d\s,;]*)"
)
_UNIT_LINE = re.compile(
    r"[\s#%/;*\"]*((?:[^\W\d_][\w ]{0,30}[ _])?(?:units?|einheit))\"?\s*[:=,;\t]\s*\"?([^\s\",;]{1,20})[\",;\s]*",
    re.IGNORECASE,
)
_IN_WORDS = re.compile(rf"(?i)\b\w{{0,20}}(?:{'|'.join(_SCALES + _SHIFTS)})\w{{0,20}}\W{{1,3}}(?:is |of |= )?{_NUMBER}")


class StatementKind(StrEnum):
    """Effect that a statement may have on numbers, by its name."""

    SCALE = "scale"
    SHIFT = "shift"
    RANGE = "range"
    LOST = "lost"
    UNIT = "unit"
    INSTANT = "instant"
    """An offset of the instants."""
    NUMBER = "number"
    """A number by a name that says nothing, of which integers alone may be the counts."""
    COEFFICIENT = "coefficient"
    """A number by the name of a polynomial's, which it is beside integers alone."""
    WORDS = "words"
    """A text in which a factor or an offset stands."""


_SCALING = frozenset({StatementKind.SCALE, StatementKind.SHIFT, StatementKind.COEFFICIENT})


@dataclass(frozen=True)
class Statement:
    """One statement that may change what samples mean.

    Attributes
    ----------
    name
        Name that it has in the file.
    numbers
        Numbers that it states; empty where it states none.
    text
        Words in which a note quotes its value.
    """

    kind: StatementKind
    name: str
    numbers: tuple[float, ...]
    text: str

    @property
    def is_neutral(self) -> bool:
        """Whether it changes no number: a factor of 1, an offset of 0, either of the two under an unknown name."""
        neutral = {StatementKind.SCALE: 1.0, StatementKind.SHIFT: 0.0, StatementKind.INSTANT: 0.0}.get(self.kind)
        if self.kind is StatementKind.LOST and not any(map(isfinite, self.numbers)):
            return True
        if self.kind is StatementKind.NUMBER:
            return self.numbers in ((0.0,), (1.0,))
        return neutral is not None and self.numbers == (neutral,)


@dataclass(frozen=True, eq=False)
class Statements:
    """All that stands beside a signal's samples.

    Attributes
    ----------
    said
        Values by the names that they have in the file: JSON types.
    used
        Names of those that made the samples, their unit or their instants.
    of_integers
        Whether the samples are stored integers, which only such a statement can make a measurement of.
    """

    said: Mapping[str, Any]
    used: Collection[str] = ()
    of_integers: bool = False

    @cached_property
    def open(self) -> tuple[Statement, ...]:
        """Statements that nobody used and that may change what samples mean."""
        found: list[Statement | None] = []
        for name, value in self.said.items():
            if name in self.used:
                continue
            found.append(statement_of(name, value))
            if found[-1] is None and isinstance(value, str):
                lines = statements_in(value[:LONGEST_TEXT].splitlines())
                found += [statement_of(*one) for one in lines.items()] if lines else [_in_words(name, value)]
        return tuple(dict.fromkeys(one for one in found if one is not None and not one.is_neutral))

    @cached_property
    def unknown(self) -> tuple[Statement, ...]:
        """Numbers by names that say nothing, beside integers that nothing has scaled."""
        used = (statement_of(name, self.said[name]) for name in self.used if name in self.said)
        if not self.of_integers or any(one is not None and one.kind in _SCALING for one in used):
            return ()
        return tuple(one for one in self.open if one.kind is StatementKind.NUMBER)

    @cached_property
    def starts(self) -> tuple[tuple[str, str], ...]:
        """Texts and counts since 1970 that date the record, by their names, used or not."""
        dated = ((name, _dated(value)) for name, value in self.said.items() if _of_start(name))
        return tuple((name, text) for name, text in dated if text)

    @cached_property
    def rates_hz(self) -> tuple[tuple[str, float], ...]:
        """Rates that stand beside the samples, used or not, by the names of what states them."""
        stated = ((name, _rate_hz(name, *_numbers_of(value))) for name, value in self.said.items())
        return tuple((name, rate_hz) for name, rate_hz in stated if rate_hz is not None)

    @property
    def scaling(self) -> str:
        """Name of the first that may scale or shift the numbers; empty where none may."""
        return next((one.name for one in self.open if one.kind in _SCALING), "")

    @property
    def refusal(self) -> str:
        """Reason why the samples are no measurement; empty where they may be one."""
        open_one = self.scaling if self.of_integers else ""
        return f"integers with the attribute {open_one}, whose meaning is open" if open_one else ""

    @cached_property
    def limits(self) -> tuple[float, float] | None:
        """Least and largest sample that are stated; None where none is, or both are the same."""
        low, high = -np.inf, np.inf
        for one in self.open:
            if one.kind is not StatementKind.RANGE or any(map(isnan, one.numbers)):
                continue
            words = set(_words(one.name))
            if len(one.numbers) == 2:
                low, high = max(low, min(one.numbers)), min(high, max(one.numbers))
            elif (one.numbers and words & _LEAST_WORDS) or "minimum" in folded(one.name):
                low = max(low, *one.numbers)
            elif (one.numbers and words & _MOST_WORDS) or "maximum" in folded(one.name):
                high = min(high, *one.numbers)
            elif one.numbers:
                low, high = max(low, -abs(one.numbers[0])), min(high, abs(one.numbers[0]))
        return (float(low), float(high)) if low < high and (isfinite(low) or isfinite(high)) else None


NOTHING = Statements({})
"""Where a file says nothing beside the samples."""


def statement_of(name: str, value: Any) -> Statement | None:
    """Return what a name and a value may do to numbers; None where they do nothing to them."""
    numbers, unit = _numbers_of(value)
    text = f"{', '.join(f'{n:g}' for n in numbers[:4])}{' ..' if len(numbers) > 4 else ''} {unit}".strip()
    if isinstance(value, str) and any(map(isnan, numbers)):
        text = ""
    kind = _kind_of(name, value, numbers)
    return None if kind is None else Statement(kind, name, numbers, text or repr(_cut(str(value))))


def statements_in(lines: Sequence[str]) -> dict[str, Any]:
    """Return what the lines of a head state of numbers, each by the words before it."""
    found: dict[str, Any] = {}
    for line in lines:
        match, unit = _LINE.match(line[:LONGEST_LINE]), _UNIT_LINE.fullmatch(line[:LONGEST_LINE])
        if match is not None:
            found.setdefault(match[1].strip(), f"{match[2]} {match[3]}".strip())
        elif unit is not None:
            found.setdefault(unit[1].strip(), unit[2])
    return found


def about_open(statements: Mapping[str, Statements]) -> list[Remark]:
    """Return the notes on statements of some signals, by their names, that nobody used; of one of several, one note."""
    several: dict[Statement, list[str]] = {}
    unknown: dict[tuple[Statement, ...], list[str]] = {}
    passed_over = {StatementKind.RANGE, StatementKind.COEFFICIENT, StatementKind.NUMBER}
    for label, beside in statements.items():
        for one in beside.open:
            if one.kind not in passed_over:
                several.setdefault(one, []).append(label)
        if beside.unknown:
            unknown.setdefault(beside.unknown, []).append(label)
    return [
        *(_note(one, labels) for one, labels in several.items()),
        *(_about_numbers(numbers, labels) for numbers, labels in unknown.items()),
    ]


def about_rates(statements: Mapping[str, tuple[Statements, float]]) -> list[Remark]:
    """Return the notes on rates that are stated beside samples which come at another one.

    Parameters
    ----------
    statements
        Statements of each signal, by its name, and the rate of its samples, Hz.
    """
    other: dict[tuple[str, float, float], list[str]] = {}
    for label, (beside, rate_hz) in statements.items():
        for name, stated_hz in beside.rates_hz:
            if abs(stated_hz / rate_hz - 1.0) > _SAME_RATE:
                other.setdefault((name, stated_hz, rate_hz), []).append(label)
    return [
        Note(
            NoteCode.CONTRADICTION,
            labels[0] if len(labels) == 1 else None,
            f"{_first_of(labels)}: the file states {name}, which makes {stated_hz:.6g} Hz, and dates the samples at "
            f"{rate_hz:.6g} Hz: they are taken as they are dated",
        )
        for (name, stated_hz, rate_hz), labels in other.items()
    ]


def about_starts(statements: Mapping[str, Statements]) -> list[Remark]:
    """Return the notes on texts that date a recording which has no start."""
    dated = dict.fromkeys(one for beside in statements.values() for one in beside.starts)
    return [about_unread_start(*one) for one in list(dated)[:MOST_SHOWN]]


def _in_words(name: str, text: str) -> Statement | None:
    """Return a text in which a factor or an offset stands among words."""
    found = _IN_WORDS.search(text[:LONGEST_TEXT])
    return None if found is None else Statement(StatementKind.WORDS, name, (), repr(_cut(text)))


def _first_of(shown: Sequence[str]) -> str:
    more = f" and {len(shown) - MOST_SHOWN} more" if len(shown) > MOST_SHOWN else ""
    return ", ".join(shown[:MOST_SHOWN]) + more


def _about_numbers(numbers: tuple[Statement, ...], labels: list[str]) -> Note:
    stated = _first_of([f"{one.name} = {one.text}" for one in numbers])
    text = f"{_first_of(labels)}: stored integers, and the file states {stated}: none of it is applied"
    return Note(NoteCode.UNITS, labels[0] if len(labels) == 1 else None, text)


def _note(one: Statement, labels: list[str]) -> Note:
    named, about = _first_of(labels), labels[0] if len(labels) == 1 else None
    what = {
        StatementKind.LOST: "samples that are it are not taken for lost",
        StatementKind.UNIT: "it is not taken for the unit",
        StatementKind.INSTANT: "it is not added to the instants",
        StatementKind.WORDS: "nothing of it is applied",
    }.get(one.kind, "it is not applied")
    code = NoteCode.LOST if one.kind is StatementKind.LOST else NoteCode.UNITS
    return Note(code, about, f"{named}: the file states {one.name} = {one.text}: {what}")


def outside(values: NDArray[np.float64], limits: tuple[float, float]) -> int:
    """Count the samples that lie outside of stated limits."""
    with np.errstate(invalid="ignore"):
        return int(np.count_nonzero((values < limits[0]) | (values > limits[1])))


def about_outside(label: str, count: int, of: int, limits: tuple[float, float]) -> Note:
    """Return the note on samples outside of the range that the file states."""
    text = (
        f"{label}: {count} of {of} samples lie outside of the range that the file states, "
        f"{limits[0]:.6g} to {limits[1]:.6g}: they are taken as they are"
    )
    return Note(NoteCode.CONTRADICTION, label, text)


def usual_code(values: NDArray[np.float64]) -> tuple[float, int] | None:
    """Return a number that often stands for a lost sample, and how many are it; None if there is none.

    It is the least or the largest of all, and farther from the others than these are from each other.
    """
    if values.size <= _LEAST_OTHERS:
        return None
    for code in (float(np.fmin.reduce(values)), float(np.fmax.reduce(values))):
        if not any(abs(abs(code) - usual) <= 1e-6 * usual for usual in _USUAL):
            continue
        others = values[np.isfinite(values) & (values != code)]
        if others.size >= _LEAST_OTHERS and np.abs(others - code).min() > np.ptp(others):
            return code, int(np.count_nonzero(values == code))
    return None


def about_usual_code(label: str, code: float, count: int, of: int) -> Note:
    """Return the note on a number that may stand for lost samples."""
    text = (
        f"{label}: {count} of {of} samples are {code:.7g}, far from all others: they are taken as they are; if it "
        "means a lost sample, declare it in `missing` of a layout, or export such samples empty"
    )
    return Note(NoteCode.LOST, label, text)


def last_of_all(named: Mapping[int, str], least: int, most: int) -> dict[int, str]:
    """Return which names of stored numbers are those of codes, where nothing else is said of the numbers.

    They are names of the largest numbers that can be stored, or of the smallest below 0, which follow one another to
    the end, and there are no others and few of all.

    Parameters
    ----------
    least, most
        Smallest and largest number that can be stored.
    """
    last = {}
    for end, step in ((most, -1), *([(least, 1)] if least < 0 else [])):
        raw = end
        while raw in named:
            last[raw] = named[raw]
            raw += step
    return last if len(named) == len(last) and _FEW * len(last) <= most else {}


def about_codes(label: str, codes: Mapping[str, int], of: int, samples: str = "samples") -> Note:
    """Return the note on samples that hold a code, which is no measurement.

    Parameters
    ----------
    codes
        Number of samples that hold each, by what it is called.
    samples
        Name of what the signal's numbers come in.
    """
    shown = _first_of([f"{code} x{count}" for code, count in codes.items()])
    text = f"{label}: {sum(codes.values())} of {of} {samples} hold a code that is no measurement ({shown})"
    return Note(NoteCode.LOST, label, f"{text}: lost samples")


def _kind_of(name: str, value: Any, numbers: tuple[float, ...]) -> StatementKind | None:
    short = folded(name)
    words = _words(name)
    if words and words[-1] in ("unit", "units", "einheit", "unitstring") and isinstance(value, str) and value.strip():
        return None if _has(short, _OF_TIME) else StatementKind.UNIT
    if _has(short, _TURNS):
        plain = str(value).strip().casefold()
        is_one = "polarit" in short and numbers == (1.0,)
        return None if is_one or plain in _NOT_TURNED or numbers == (0.0,) else StatementKind.WORDS
    if not numbers or short.endswith(_OF_PEOPLE):
        return None
    if short in _INSTANTS or short.rstrip("muns") in _INSTANTS:
        return StatementKind.INSTANT
    if "fullscale" not in short and _has(short, _SCALES):
        return StatementKind.SCALE
    if _has(short, _OF_TIME):
        return None
    least_or_most = _LEAST_WORDS | _MOST_WORDS
    if _has(short, _RANGES) or (least_or_most & set(words) and len(words) < 4):
        return StatementKind.RANGE
    if _has(short, _LOST):
        return StatementKind.LOST
    if _has(short, _SHIFTS) or _SHIFT_WORDS & set(words):
        return StatementKind.SHIFT
    if _POLYNOMIAL.fullmatch(name):
        return StatementKind.COEFFICIENT
    return None if _OF_PLACES & set(words) else StatementKind.NUMBER


def _rate_hz(name: str, numbers: Sequence[float], unit: str) -> float | None:
    """Return the rate that a number with its unit states by its name, in Hz; None where it states none."""
    short, per = folded(name).removeprefix("ni").removesuffix("hz"), _PER.get(unit.casefold())
    if len(numbers) != 1 or per is None or not (isfinite(numbers[0]) and numbers[0] > 0):
        return None
    if short in _RATES:
        return numbers[0] * per
    return 1.0 / (numbers[0] * per) if short.removesuffix("s") in _INTERVALS else None


def _dated(value: Any) -> str:
    """Return a text that dates, or a number that counts s, ms, us or ns from 1970 to a day since 1981; else nothing."""
    if isinstance(value, str):
        return value.strip() if is_dated(value) else ""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return ""
    counts = any(_COUNTED_S[0] <= value / per_s <= _COUNTED_S[1] for per_s in (1.0, 1e3, 1e6, 1e9))
    return f"{value:.0f}" if counts else ""


def _of_start(name: str) -> bool:
    words = set(_words(name))
    return bool(words & _STARTS) and not words & _NO_START


def _numbers_of(value: Any) -> tuple[tuple[float, ...], str]:
    """Return the numbers of a value and the unit behind them; none where it holds anything else.

    A number whose comma may part thousands or decimals is NaN.
    """
    if isinstance(value, str):
        if _EITHER.match(value) is not None:
            return (nan,), ""
        match = _NUMBER_AND_UNIT.fullmatch(value if value.count(",") != 1 else value.replace(",", "."))
        return ((float(match[1]),), match[2] or "") if match and isfinite(float(match[1])) else ((), "")
    values = value if isinstance(value, (list, tuple)) else [value]
    if not all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in values):
        return (), ""
    sound = all(isinstance(one, float) or abs(one) < 1e300 for one in values)
    return (tuple(float(one) for one in values), "") if sound else ((), "")


def folded(name: str) -> str:
    """Return a name in small letters, letters and digits alone, without their accents."""
    return "".join(c for c in normalize("NFKD", name.casefold()) if c.isalnum())


def _words(name: str) -> list[str]:
    return re.findall(r"[a-zäöüßéè]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).casefold())


def _has(short: str, parts: Sequence[str]) -> bool:
    return any(part in short for part in parts)


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} .."
