"""Ranges of multiplexers' values cost what their text does, and say the same as their values."""

from __future__ import annotations

import random
from pathlib import Path

import cantools
import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.can.frames import EXTENDED
from recoil_acquisition.readers.can.messages import load_database
from recoil_acquisition.readers.can.multiplexing import MultiplexerRanges

HEAD = 'VERSION ""\nNS_ :\n SG_MUL_VAL_\nBS_:\nBU_: A\n'
PLACE = '1+ (1,0) [0|0] "" A\n'
KEY = EXTENDED | 700
MESSAGE = f"BO_ {KEY} M: 8 A\n SG_ x0 M : 0|32@{PLACE}"
ONE = f"{HEAD}{MESSAGE} SG_ x1 m0 : 32|16@{PLACE}"


def ranges_of(text: str) -> dict[str, list[range]]:
    (message,) = load_database(text, Path("a.log")).messages
    return {signal.name: signal.multiplexer_ids for signal in message.signals if signal.multiplexer_ids}


@pytest.mark.parametrize("last", [65535, 2**32 - 1])
def test_a_range_over_all_values_is_taken_as_it_stands(last: int) -> None:
    assert ranges_of(f"{ONE}SG_MUL_VAL_ {KEY} x1 x0 0-{last};\n") == {"x1": [range(last + 1)]}


def test_a_range_within_strings_and_remarks_is_none() -> None:
    text = f'{ONE}CM_ BO_ {KEY} "SG_MUL_VAL_ {KEY} x1 x0 9-1;";\n// SG_MUL_VAL_ {KEY} x1 x0 a;\n'
    assert ranges_of(f"{text}SG_MUL_VAL_ {KEY} x1 x0 2-3, // some\n 8-8;\n") == {
        "x1": [range(1), range(2, 4), range(8, 9)]
    }


def test_ranges_hold_the_values_that_the_library_lists() -> None:
    rng = random.Random(20240301)  # noqa: S311  test data, no secret
    for _ in range(20):
        text = HEAD + MESSAGE + "".join(f" SG_ s{k} m{rng.randrange(40)} : {32 + k}|1@{PLACE}" for k in range(5))
        for k in rng.sample(range(5), 4):
            starts = [rng.randrange(40) for _ in range(rng.randint(1, 3))]
            text += f"SG_MUL_VAL_ {KEY} s{k} x0 {', '.join(f'{one}-{one + rng.randrange(9)}' for one in starts)};\n"
        (theirs,) = cantools.database.load_string(text, "dbc").messages
        listed = {signal.name: sorted(signal.multiplexer_ids) for signal in theirs.signals if signal.multiplexer_ids}
        assert {name: [k for one in ranges for k in one] for name, ranges in ranges_of(text).items()} == listed


def test_signals_that_overlap_at_one_value_within_a_range_are_still_found() -> None:
    text = f"{ONE} SG_ x2 m500 : 40|16@{PLACE}SG_MUL_VAL_ {KEY} x1 x0 0-65535;\n"
    with pytest.raises(ReadError, match="overlapping"):
        load_database(text, Path("a.log"))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (f"{ONE}SG_MUL_VAL_ {KEY} x1 x0 5-3;", "SG_MUL_VAL_ .* 5-3: no ranges such as"),
        (f"{ONE}SG_MUL_VAL_ {KEY} x1 x0 0-1e9;", "SG_MUL_VAL_ .*: no ranges such as"),
        (
            f"{ONE}SG_MUL_VAL_ {KEY} x1 x0 0-1;SG_MUL_VAL_ {KEY} x0 x1 0-1;",
            "the multiplexer x[01] depends on itself",
        ),
        (
            f"{ONE}{''.join(f' SG_ y{k} m{k} : 48|8@{PLACE}' for k in range(4000))}",
            "4001 multiplexed signals, which is too many",
        ),
        (
            ONE + "".join(f"SG_MUL_VAL_ {KEY} x{k + 1} x{k} 0-0, 2-2, 4-4, 6-6, 8-8, 10-10;" for k in range(8)),
            "too many values of multiplexers",
        ),
        (f"{ONE}{f' SG_ y : 48|8@{PLACE}' * 10_000}", "has 10002 signals, where 10000 are the most"),
    ],
)
def test_what_would_be_listed_for_minutes_is_refused(text: str, problem: str) -> None:
    with pytest.raises(ReadError, match=problem):
        load_database(text, Path("a.log"))


def test_the_text_that_is_parsed_has_one_value_for_those_that_carry_the_same() -> None:
    text = f"{ONE} SG_ x2 m500 : 40|16@{PLACE}SG_MUL_VAL_ {KEY} x1 x0 0-65535;\n"
    assert MultiplexerRanges(text).short_text.endswith(f"SG_MUL_VAL_ {KEY} x1 x0 0-0, 1-1, 500-500, 501-501;\n")
