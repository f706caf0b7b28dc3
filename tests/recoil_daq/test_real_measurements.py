"""Two real records with a known mass, end to end, as docs/validation.md has them."""

from __future__ import annotations

import pytest

from tests.validation import BEGIN, END, HEAD, PAGE, Measured, cases

LARGEST_U = 0.025
"""Largest relative standard uncertainty with which a stroke is worth anything."""
HELD = [name for name in cases() if "rates" in name]
OTHERS = [name for name in cases() if name not in HELD]


@pytest.mark.whole_way
@pytest.mark.parametrize("name", HELD)
def test_the_carriage_without_a_rest_holds_its_published_mass(name: str) -> None:
    found: Measured = cases()[name]()
    assert found.covers, found.row()
    assert found.u_rel <= LARGEST_U
    assert found.valid, found.reasons


@pytest.mark.whole_way
@pytest.mark.parametrize("name", OTHERS)
def test_travel_alone_and_the_rocket_are_held_or_refused_with_a_reason(name: str) -> None:
    found: Measured = cases()[name]()
    assert found.covers or (not found.valid and found.reasons), found.row()


def test_the_page_has_a_row_of_each() -> None:
    page = PAGE.read_text(encoding="utf-8")
    table = page.partition(BEGIN)[2].partition(END)[0].strip().splitlines()
    assert tuple(table[:2]) == HEAD
    assert len(table) == 2 + len(cases())
