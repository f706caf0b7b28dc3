"""The page of what to do: each code of a finding has its row, and no row is of a code that is none."""

from __future__ import annotations

import re
from enum import StrEnum
from pathlib import Path

import pytest

from recoil_acquisition.remark import CautionCode, NoteCode, ReasonCode
from recoil_acquisition.shot.quality_check import Check

PAGE = Path(__file__).parents[1] / "docs" / "what-now.md"


def rows_of(codes: type[StrEnum]) -> list[list[str]]:
    table = PAGE.read_text(encoding="utf-8").partition(f"<!-- codes: {codes.__name__} -->\n")[2].partition("\n\n")[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


@pytest.mark.parametrize("codes", [ReasonCode, CautionCode, Check, NoteCode])
def test_each_code_has_its_row_in_the_order_of_the_codes(codes: type[StrEnum]) -> None:
    assert [row[0] for row in rows_of(codes)] == [f"`{code.value}`" for code in codes]


@pytest.mark.parametrize("codes", [ReasonCode, CautionCode, Check, NoteCode])
def test_each_row_says_what_the_code_means_and_what_to_do(codes: type[StrEnum]) -> None:
    rows = rows_of(codes)
    assert len({len(row) for row in rows}) == 1
    assert all(re.search(r"\w{2}", cell) for row in rows for cell in row[1:])
