"""When a mass that varies speaks against the result."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from recoil_identification.budget import BudgetRow
from recoil_identification.mass import MassEstimate
from recoil_identification.verdict import CERTAINLY_VARIES, doubted_sensors, varies


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


@dataclass
class Doubted:
    """Normalised residuals and pulls."""

    normalised_residuals: dict[str, float]
    pulls: dict[str, float]


def test_a_source_beyond_the_critical_value_is_named_with_its_size_and_direction() -> None:
    (reason,) = doubted_sensors(Doubted({"brake_pressure": 5.0, "x": 3.2}, {"brake_pressure": 4.0, "x": 1.0}))
    assert reason.startswith("brake_pressure contradicts the other sensors: it reads high by 6.25 of its standard")
    (reason,) = doubted_sensors(Doubted({"alignment of clock can": -5.0}, {"alignment of clock can": -4.0}))
    assert "alignment of clock can contradicts the other sensors: it is early by 6.25" in reason


def test_sources_that_the_shot_cannot_tell_apart_are_named_together() -> None:
    residuals = {"camera scale": -6.0, "recoil_acceleration": 5.8, "breech_pressure": 5.6, "brake_pressure": -3.5}
    reasons = doubted_sensors(Doubted(residuals, dict.fromkeys(residuals, 2.0)))
    assert [reason.partition(" contradicts")[0] for reason in reasons] == [
        "camera scale or recoil_acceleration", "breech_pressure", "brake_pressure"
    ]  # fmt: skip
