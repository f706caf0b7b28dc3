"""Which sensors are named, and when it is the mass that changes."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np
import pytest

from recoil_identification.estimate.mass import ACCELERATION, GAUGES
from recoil_identification.rows.sensor_priors import CAMERA_SCALE
from recoil_identification.rows.unread_resistance import SHARE
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_identification.shot.sensor_doubts import doubted_sensors, doubted_sensors_or_mass, nearly_doubted
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.sensor_scales import BORE_FRICTION
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import virtual_shot, with_channels

BRAKE_DELAY = ErrorSource(SourceKind.DELAY, "brake_pressure")


@dataclass
class Doubted:
    """Normalised residuals and pulls."""

    normalised_residuals: dict[ErrorSource, float]
    pulls: dict[ErrorSource, float]

    def __post_init__(self) -> None:
        self.normalised_residuals = {_source(one): w for one, w in self.normalised_residuals.items()}
        self.pulls = {_source(one): pull for one, pull in self.pulls.items()}

    @property
    def judged_residuals(self) -> dict[ErrorSource, float]:
        """Those of what can be off: here of all."""
        return self.normalised_residuals

    @property
    def known_beforehand(self) -> dict[str, tuple[float, str]]:
        """Scales by 0.4 %, zeros and clocks by one of their units."""
        units = {"zero": (10.0, "Pa"), "clock": (1e-4, "s"), "delay": (1e-4, "s"), "droop": (1.0, "1")}
        return {
            source: next((known for word, known in units.items() if word in source), (0.004, "1"))
            for source in self.pulls
        }


CLOCK = ErrorSource(SourceKind.ALIGNMENT, "can")


def _source(name: str) -> ErrorSource:
    """Return a source, of a name that says nothing of its kind one that is no time."""
    return name if isinstance(name, ErrorSource) else ErrorSource(SourceKind.DECLARED, name)


def test_a_source_beyond_the_critical_value_is_named_with_its_size_and_direction() -> None:
    (reason,) = doubted_sensors(Doubted({"brake_pressure": 5.0, "x": 3.2}, {"brake_pressure": 4.0, "x": 1.0}))
    assert reason.startswith("brake_pressure contradicts the other sensors: it reads high by 6.25 of its standard")
    (reason,) = doubted_sensors(Doubted({CLOCK: -5.0}, {CLOCK: -4.0}))
    assert "alignment of clock can contradicts the other sensors: it is early by 6.25" in reason


def test_the_size_is_in_the_unit_of_the_source_with_its_own_uncertainty() -> None:
    # five standard deviations of what is off by 6.25 times 0.4 %
    assert "right, 2.5 % with u 0.51 % (5.0 standard deviations, limit 3.29)" in one_doubt("brake", 5.0, 4.0)
    # logarithms: what reads low by a factor does so by less of itself
    assert "it reads low by 62.5 of its standard uncertainties if they are right, 22 % with u" in one_doubt(
        "brake", -5.0, 0.4
    )
    assert "right, 62 Pa with u 12 Pa (5.0" in one_doubt("brake_pressure zero", 5.0, 4.0)
    assert "right, 0.00063 s with u 0.00013 s (5.0" in one_doubt(BRAKE_DELAY, 5.0, 4.0)
    assert "right (5.0 standard" in one_doubt("recoil_acceleration droop", 5.0, 4.0)


def one_doubt(source: str, w: float, pull: float) -> str:
    (reason,) = doubted_sensors(Doubted({source: w}, {source: math.copysign(pull, w)}))
    return reason


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
    assert pair.endswith(f", or {ACCELERATION} reads high by 16.8 of its own, 7 % with u 1.2 %")
    # the gauge alone, or all that is on its clock: late they are either way
    late = Doubted({BRAKE_DELAY: 9.0, CLOCK: 8.8}, {BRAKE_DELAY: 1.0, CLOCK: 0.6})
    (pair,) = doubted_sensors(late)
    assert "it is late by 81 of its standard uncertainties" in pair
    assert pair.endswith(", or alignment of clock can is late by 129 of its own, 0.013 s with u 0.0015 s")
    # a gauge, its area and its standard are one column
    column = {GAUGES[0]: 4.0, "bore_area": 4.0, "standard s": 4.0}
    assert named(column) == [f"{GAUGES[0]} or bore_area or standard s"]
    # and unread resistance looks like it, whichever of them is listed first
    first = {"bore_area": 4.0, GAUGES[0]: 4.0, SHARE: 3.4}
    (reason,) = doubted_sensors(Doubted(first, dict.fromkeys(first, 2.0)))
    assert reason.about == GAUGES[0]
    assert all(f", or {other} " in reason for other in (SHARE, "bore_area"))


def test_what_would_have_to_be_absurdly_wrong_stands_behind_what_need_not() -> None:
    residuals = {"brake_pressure zero": 4.2, GAUGES[0]: 4.0}
    # off by 441 and by 8 standard uncertainties: both are beyond the limit, and the likelier one stands first
    pulls = {"brake_pressure zero": 0.04, GAUGES[0]: 2.0}
    assert named(residuals, pulls) == [GAUGES[0], "brake_pressure zero"]
    first, second = doubted_sensors(Doubted(residuals, pulls))
    assert "too" not in first
    assert "too, but would have to be off by 441 of its standard uncertainties (4.2 standard deviations" in second
    # but where nothing else explains the shot as well it is
    assert named({**residuals, GAUGES[0]: 3.5}, {"brake_pressure zero": 0.04, GAUGES[0]: 2.0}) == [
        "brake_pressure zero", GAUGES[0]
    ]  # fmt: skip


def test_every_source_beyond_the_critical_value_is_in_a_reason() -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        sources = [*GAUGES, ACCELERATION, CAMERA_SCALE, "packing friction", "bore_area", CLOCK]
        residuals = dict(zip(sources, rng.normal(0.0, 4.0, len(sources)), strict=True))
        pulls = {source: w * rng.uniform(0.01, 1.0) for source, w in residuals.items()}
        said = " ".join(doubted_sensors(Doubted(residuals, pulls)))
        assert all((source in said) == (abs(w) > 3.29) for source, w in residuals.items())
        # what is within it by little is mentioned, and nothing else is
        noted = nearly_doubted(Doubted(residuals, pulls))
        assert len(noted) == sum(3.0 < abs(w) <= 3.29 for w in residuals.values())


def test_a_source_within_the_limit_by_little_is_mentioned() -> None:
    residuals = {GAUGES[0]: 3.1, GAUGES[1]: -2.9, CLOCK: -3.2}
    gauge, clock = nearly_doubted(Doubted(residuals, residuals))
    assert gauge.startswith(f"{GAUGES[0]} reads high by 3.1 standard deviations if the others are right")
    assert clock.startswith("alignment of clock can is early by 3.2")


def test_a_breech_gauge_within_the_limit_is_named_with_the_share_that_is_beyond_it() -> None:
    residuals = {GAUGES[0]: -3.2, SHARE: -3.5, BORE_FRICTION: -3.1, GAUGES[1]: 2.0}
    (reason,) = doubted_sensors(Doubted(residuals, dict.fromkeys(residuals, 2.0)))
    assert reason.about == GAUGES[0]
    assert reason.startswith(f"{GAUGES[0]} contradicts the other sensors: it reads low")
    assert "(3.5 standard deviations, limit 3.29)" in reason
    assert f", or {SHARE} is smaller by" in reason
    assert f", or {BORE_FRICTION} takes off less by" in reason
    # of a rig whose bore takes off nothing that is unknown there is no such row
    del residuals[BORE_FRICTION]
    (reason,) = doubted_sensors(Doubted(residuals, dict.fromkeys(residuals, 2.0)))
    assert BORE_FRICTION not in reason


OFF = {"brake_pressure": (1.09, "high"), "recuperator_pressure": (1.12, "high"), "breech_pressure": (0.95, "low")}


@pytest.mark.whole_way
@pytest.mark.parametrize("role", OFF)
@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_a_gauge_of_a_whole_shot_that_is_off_is_named_first(name: str, role: str) -> None:
    """The rig knows no more than is usual of what no gauge reads."""
    factor, sense = OFF[role]
    virtual = virtual_shot(name, 3, kind=False, unread_errors=False)
    channel = virtual.shot.by_role(role)
    assert channel is not None
    shot = with_channels(virtual.shot, **{channel.name: factor * np.asarray(channel.samples)})
    found = identify_shot(FiredShot(shot, virtual.rig), Options())
    assert not found.valid
    first = found.reasons[0]
    assert first.startswith(f"{role} sensitivity and area contradicts the other sensors: it reads {sense}"), first
    if role == "breech_pressure":
        assert f", or {SHARE} is smaller by" in first
        assert f", or {BORE_FRICTION} takes off less by" in first


@dataclass
class Change:
    """What a test of the mass's constancy says."""

    normalised_residual: float
    called: bool = True
    changed: Doubted = field(default_factory=lambda: Doubted({}, {}))
    what_changes: str = "mass, friction or the breech chain"

    @property
    def gain(self) -> float:
        return 0.5 * self.normalised_residual**2

    @property
    def constant(self) -> bool:
        return not self.called

    def __str__(self) -> str:
        return "Mass, friction or the breech chain changes in the shot."


def judged(change: Change, **residuals: float) -> list[str]:
    return doubted_sensors_or_mass(Doubted(residuals, dict.fromkeys(residuals, 2.0)), change)


def test_a_mass_that_explains_more_than_any_sensor_is_blamed_and_compared() -> None:
    (reason,) = judged(Change(5.0), brake=4.2, breech=1.0)
    assert reason.startswith(
        "Mass, friction or the breech chain changes in the shot (the log likelihood rises by 8.8 if brake is off, by "
        "12.5 if mass, friction or the breech chain changes): see"
    )


def test_all_that_would_contradict_a_constant_mass_is_named_where_the_mass_is_blamed() -> None:
    (reason,) = judged(Change(6.0), brake=4.2, breech=-3.9, recuperator=1.0)
    assert reason.endswith(
        "one number does not describe it; if the mass does not change, breech would contradict the other sensors, too"
    )


def test_a_sensor_that_is_off_even_if_the_mass_changes_is_named_beside_it() -> None:
    reasons = judged(Change(5.0, changed=Doubted({"brake": 4.0}, {"brake": 3.0})), brake=4.8)
    assert reasons[0].startswith("Mass, friction")
    assert reasons[1].startswith("brake contradicts")


def test_a_sensor_that_explains_more_than_a_changing_mass_is_named_alone() -> None:
    # a mass that a sensor explains away is none that changes
    (reason,) = judged(Change(10.5, called=False), recuperator=13.8)
    assert reason.startswith("recuperator contradicts the other sensors")
    assert "changes" not in reason


def test_where_neither_is_beyond_doubt_both_are_named() -> None:
    (reason,) = judged(Change(2.5), brake=3.0)
    assert reason.startswith("either mass, friction or the breech chain changes or brake is off, the shot cannot tell")


def test_a_constant_mass_accuses_nobody() -> None:
    assert judged(Change(1.0, called=False), brake=3.0) == []
    assert doubted_sensors_or_mass(Doubted({}, {}), None) == []
