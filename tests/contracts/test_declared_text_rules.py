"""The reader of declared layouts keeps every rule but one: it claims no file, since the rig chooses it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition.readers.head import Head
from recoil_acquisition.readers.table import READERS
from tests.contracts import reader_rules as rules
from tests.contracts.cases_text import DECLARED_CASES
from tests.contracts.reader_rules import Case


@pytest.mark.parametrize("case", DECLARED_CASES, ids=lambda case: case.name)
@pytest.mark.parametrize(
    "rule", [rule for rule in rules.RULES if rule is not rules.claims_its_own_file], ids=lambda rule: rule.__name__
)
def test_a_declared_table_keeps(rule: Callable[[Case, Path], None], case: Case, tmp_path: Path) -> None:
    rule(case, tmp_path)


@pytest.mark.parametrize("case", DECLARED_CASES, ids=lambda case: case.name)
def test_the_reader_of_declared_tables_claims_nothing(case: Case) -> None:
    assert not case.reader.claims(Head(case.content))
    assert case.reader.name not in {reader.name for reader in READERS}


@pytest.mark.parametrize("case", DECLARED_CASES, ids=lambda case: case.name)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flips=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=6))
def test_flipped_bytes_never_give_another_exception(case: Case, tmp_path: Path, flips: list[tuple[float, int]]) -> None:
    rules.flipped_bytes_are_refused_or_read(case, tmp_path, flips)
