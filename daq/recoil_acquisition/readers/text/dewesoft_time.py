"""Absolute time in a Dewesoft text export, and what it can and cannot say.

It is printed in whole milliseconds: at 20 kHz, twenty rows share one stamp. So a stamp is taken for
a printed number of limited resolution, from which a sample rate may be found, and not for an instant.
"""

from __future__ import annotations

import datetime as dt
import re

import numpy as np

from recoil_acquisition.readers.time.printed_time import PART_ROWS, Times
from recoil_acquisition.readers.time.wall_clock import Stamp, hour_of_day, nanoseconds

DECADE_RATES_HZ = tuple(m * 10.0**k for k in range(7) for m in (1.0, 2.0, 5.0))
"""The rates 1, 2 and 5 times a power of ten that nearly every record has."""

OTHER_RATES_HZ = tuple(
    sorted(
        {
            m * 10.0**k
            for k in range(1, 6)
            for m in (1.2, 1.25, 1.5, 1.6, 2.4, 2.5, 3.0, 3.2, 4.0, 4.8, 6.0, 6.4, 7.5, 8.0, 9.6)
        }
        | {m * 2.0**k * 100.0 for k in range(12) for m in (1.0, 1.28)}
        | {65536.0 * 2.0**k for k in range(-6, 4)}
    )
)
"""Other rates that recorders offer; taken only where no decade rate agrees."""

_NAMES = (
    "jan janv jän ene gen sty led oca ocak",
    "feb febr lut fev fév févr úno şub",
    "mar mär mrz mars mrt márc bře maart marts",
    "apr avr abr ápr kwi dub nis",
    "may mai mag maj mei máj mayo kvě mayıs",
    "jun juin giu jún juni čvn cze haz",
    "jul juil lug júl juli čvc tem",
    "aug août aou aoû ago avg sie ağu",
    "sep sept set szept wrz zář eyl",
    "oct okt ott out paź říj eki ekim",
    "nov novem kas",
    "dec déc dez dic des dis gru pro ara",
)
"""Short names of the months in English, German, French, Spanish, Italian, Portuguese, Dutch, the Scandinavian
languages, Polish, Czech, Slovene, Hungarian and Turkish; those that mean two months in two languages, such as ``lis``
and ``srp``, are left out."""
MONTHS = {name: number for number, names in enumerate(_NAMES, start=1) for name in names.split()}
FEWEST_STAMPS = 20
"""Rows below which no rate is sought in whole milliseconds."""

_FIRST_OF_1900 = 69
"""Year of two digits from which on they are of the 20th century, as POSIX has it."""
_STAMP = re.compile(
    r"(\d{1,2})-([^\W\d_]{3,5})\.?-(\d{2}|\d{4}) (\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9}))?(?:\s*([ap]\.?m\.?))?",
    re.IGNORECASE,
)


def is_absolute(cell: str) -> bool:
    """Return whether a cell is an absolute stamp ``dd-Mmm-yy hh:mm:ss.mmm``, whatever its month's language."""
    return _STAMP.fullmatch(cell.strip()) is not None


def parse_dewesoft_stamp(cell: str) -> Stamp:
    """Read an absolute stamp ``dd-Mmm-yy hh:mm:ss.mmm``, the month in any language in which it is unique.

    Raises
    ------
    ValueError
        If it is none, or names a month that is not known or is another month in another language.
    """
    match = _STAMP.fullmatch(cell.strip())
    if match is None:
        raise ValueError(f"{cell[:40]!r} is not a stamp dd-Mmm-yy hh:mm:ss.mmm")
    day, month, year, hour, minute, second, fraction, half = match.groups()
    number = MONTHS.get(month.casefold())
    if number is None:
        raise ValueError(f"{month!r} is not known as the name of one month")
    century = 0 if len(year) == 4 else 2000 if int(year) < _FIRST_OF_1900 else 1900
    instant = dt.datetime(century + int(year), number, int(day), hour_of_day(hour, half), int(minute), int(second))
    return Stamp(instant, nanoseconds(fraction), len(fraction or ""))


def spread_s(seconds: Times, rate_hz: float) -> float:
    """Return the range of what stamps are beyond the row number over a rate, seconds."""
    low, high = np.inf, -np.inf
    for at in range(0, seconds.size, PART_ROWS):
        part = seconds[at : at + PART_ROWS]
        beyond = part - np.arange(at, at + part.size) / rate_hz
        low, high = min(low, float(beyond.min())), max(high, float(beyond.max()))
    return high - low


def rate_from_stamps(seconds: Times, resolution_s: float) -> tuple[float, tuple[float, ...]]:
    """Find the nominal sample rate that stamps of coarse resolution agree with.

    Row ``i`` is stamped at ``t0 + i / rate``, cut or rounded to the resolution. A rate agrees if
    ``stamp - i / rate`` stays within one resolution over all rows.

    Returns
    -------
    rate_hz : float
        Only decade rate that agrees, or the only other rate where no decade rate does, Hz.
    others_hz : tuple of float
        Less usual rates that the record is too short to exclude.

    Raises
    ------
    ValueError
        If there are too few rows, no rate agrees, or more than one of equal standing does.
    """
    if seconds.size < FEWEST_STAMPS:
        raise ValueError(f"{seconds.size} rows are too few to find the sample rate from stamps of {resolution_s:g} s")
    few = seconds[:PART_ROWS]

    def agrees(rate_hz: float) -> bool:
        most_s = resolution_s * (1 + 1e-6) + 1e-9
        # most rates are far off already within the first rows
        return spread_s(few, rate_hz) <= most_s and spread_s(seconds, rate_hz) <= most_s

    decades = tuple(rate for rate in DECADE_RATES_HZ if agrees(rate))
    others = tuple(rate for rate in OTHER_RATES_HZ if rate not in DECADE_RATES_HZ and agrees(rate))
    agreeing = decades or others
    if not agreeing:
        raise ValueError("the stamps agree with no constant, usual sample rate")
    if len(agreeing) > 1:
        shown = ", ".join(f"{rate:g}" for rate in agreeing[:5])
        raise ValueError(f"the record is too short to decide between {shown} Hz{' ...' if len(agreeing) > 5 else ''}")
    return agreeing[0], others if decades else ()
