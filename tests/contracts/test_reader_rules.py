"""Every reader keeps every rule."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition import conformance as rules
from recoil_acquisition.conformance import Case
from recoil_acquisition.readers.head import HEAD_BYTES, Head
from recoil_acquisition.readers.table import READERS, TableReader, surest_claim
from tests.builders.statements_too_many import with_statements
from tests.contracts import cases_text

FAMILIES: tuple[tuple[Case, ...], ...] = tuple(
    import_module(f"tests.contracts.{module.stem}").CASES for module in sorted(Path(__file__).parent.glob("cases_*.py"))
)
CASES: tuple[Case, ...] = tuple(with_statements(case) for family in FAMILIES for case in family)
DECLARED_CASES = tuple(map(with_statements, cases_text.DECLARED_CASES))
FIRST = {family[0].name for family in FAMILIES}
"""The case of each family of formats that is damaged at every run; the others are where all tests are run."""
KEPT = pytest.mark.indispensable("law")
DAMAGES = (rules.a_cut_file_is_refused_or_shorter_with_a_note, rules.flipped_bytes_are_refused_or_read)


def damaged(cases: Iterable[Case]) -> list[Any]:
    """Cases for a test that damages each file at many places."""
    return [
        pytest.param(case, id=case.name, marks=KEPT if case.name in FIRST else pytest.mark.exhaustive) for case in cases
    ]


def over(cases: Iterable[Case], *, without: Sequence[Callable[..., None]] = ()) -> list[Any]:
    """Rules and cases: each rule over each case."""
    return [
        pytest.param(rule, *of.values, id=f"{rule.__name__}-{of.id}", marks=of.marks if rule in DAMAGES else ())
        for rule in rules.RULES
        if rule not in without
        for of in damaged(cases)
    ]


WITHOUT_CASE: dict[str, str] = {
    "Dewesoft recording": "no file can be built from bytes, as its layout is not published: the rules run over"
    " a real one in tests/daq/readers/dewesoft/test_native.py",
}
"""Readers whose rules run elsewhere, each with its reason."""


def test_every_reader_has_a_case() -> None:
    assert {case.reader.name for case in CASES} | set(WITHOUT_CASE) == {reader.name for reader in READERS}
    assert not {case.reader.name for case in CASES} & set(WITHOUT_CASE)


def test_every_reader_is_given_one_of_each_statement_too_many() -> None:
    given = {case.reader.name for case in (*CASES, *DECLARED_CASES) if set(case.too_many) == set(rules.STATEMENTS)}
    wanted = {case.reader.name for case in (*CASES, *DECLARED_CASES)}
    where = "tests/builders/statements_too_many.py, a line of _WRITERS by the case's name"
    assert given == wanted, f"without a statement too many: {wanted - given}; add it in {where}"
    carried = [one for case in CASES for one in case.too_many.values() if not isinstance(one, str)]
    assert len(carried) > 4 * len(wanted)


@pytest.mark.parametrize(("rule", "case"), over(CASES))
def test_every_reader_keeps(rule: Callable[[Case, Path], None], case: Case, tmp_path: Path) -> None:
    rule(case, tmp_path)


@pytest.mark.parametrize(("rule", "case"), over(DECLARED_CASES, without=[rules.claims_its_own_file]))
def test_the_reader_of_declared_tables_keeps(rule: Callable[[Case, Path], None], case: Case, tmp_path: Path) -> None:
    rule(case, tmp_path)


@pytest.mark.parametrize("case", DECLARED_CASES, ids=lambda case: case.name)
def test_the_reader_of_declared_tables_claims_nothing(case: Case) -> None:
    assert not case.reader.claims(Head(case.content))
    assert case.reader.name not in {reader.name for reader in READERS}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_exactly_one_reader_claims_each_file(case: Case) -> None:
    claim, claiming = surest_claim(Head(case.content))
    assert claim
    assert [reader.name for reader in claiming] == [case.reader.name]


@pytest.mark.parametrize("case", damaged([*CASES, *DECLARED_CASES]))
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flips=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=6))
def test_flipped_bytes_never_give_another_exception(case: Case, tmp_path: Path, flips: list[tuple[float, int]]) -> None:
    rules.flipped_bytes_are_refused_or_read(case, tmp_path, [flips])


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_no_reader_claims_a_file_that_shows_none_of_its_signs(case: Case) -> None:
    head = Head(case.content[:HEAD_BYTES])
    for reader in READERS:
        assert isinstance(reader, TableReader)
        if reader.claim is None:
            assert reader.claims(head) == reader._loaded.claims(head), reader.name
