"""When a mass that varies speaks against the result."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from recoil_identification.budget import BudgetRow
from recoil_identification.mass import MassEstimate
from recoil_identification.verdict import CERTAINLY_VARIES, varies


@dataclass
class Judged:
    """A test's probability and the change that it found."""

    p: float
    change_kg: float

    def constant(self, level: float = 0.05) -> bool:
        return self.p > level


ESTIMATE = MassEstimate("calibrated", 782.0, (BudgetRow("all", 3.0, "B"),), 100, 1.0)


@pytest.mark.parametrize(
    ("p", "change_kg", "expected"), [(1e-4, -8.0, True), (1e-4, 8.0, True), (1e-4, -0.4, False), (0.03, -8.0, False)]
)
def test_only_a_change_beyond_chance_and_beyond_the_uncertainty_counts(p, change_kg, expected):
    assert varies(Judged(p, change_kg), CERTAINLY_VARIES, ESTIMATE) is expected
