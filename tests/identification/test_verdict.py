"""When a mass that varies speaks against the result."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

from recoil_identification.budget import BudgetRow
from recoil_identification.mass import ACCELERATION, GAUGES, MassEstimate
from recoil_identification.sensor_priors import CAMERA_SCALE
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


def named(residuals: dict[str, float], pulls: dict[str, float] | None = None) -> list[str]:
    reasons = doubted_sensors(Doubted(residuals, pulls or dict.fromkeys(residuals, 2.0)))
    return [
        " or ".join([reason.partition(" contradicts")[0], *re.findall(r", or (.+?) reads", reason)])
        for reason in reasons
    ]


def test_sources_that_the_shot_cannot_tell_apart_are_named_together() -> None:
    scales = {CAMERA_SCALE: -6.0, ACCELERATION: 5.8, GAUGES[0]: 5.6, GAUGES[1]: -3.5}
    assert named(scales) == [f"{CAMERA_SCALE} or {ACCELERATION}", GAUGES[0], GAUGES[1]]
    (pair, *_) = doubted_sensors(Doubted(scales, dict.fromkeys(scales, 2.0)))
    assert "it reads low by 18 of its standard uncertainties" in pair
    assert pair.endswith(f", or {ACCELERATION} reads high by 16.8 of its own")
    # a gauge, its area and its standard are one column
    assert named({GAUGES[0]: 4.0, "bore_area": 4.0, "standard s": 4.0}) == [f"{GAUGES[0]} or bore_area or standard s"]


def test_what_would_have_to_be_absurdly_wrong_is_no_explanation_beside_what_need_not() -> None:
    residuals = {"brake_pressure zero": 4.2, GAUGES[0]: 4.0}
    # off by 441 and by 8 standard uncertainties
    assert named(residuals, {"brake_pressure zero": 0.04, GAUGES[0]: 2.0}) == [GAUGES[0]]
    # but where nothing else explains the shot as well it is
    assert named({**residuals, GAUGES[0]: 3.5}, {"brake_pressure zero": 0.04, GAUGES[0]: 2.0}) == [
        "brake_pressure zero", GAUGES[0]
    ]  # fmt: skip
