"""The mass by a camera and the forces: its budget against refits, and its rows against the double integral itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_acquisition.shot.shot import Shot
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.methods import by_camera
from recoil_identification.estimate.mass import FRICTION, GAUGES, RANDOM
from recoil_identification.rows.camera_rows import START
from recoil_identification.rows.causes import DISTORTIONS, moving_zero
from recoil_identification.rows.late_readings import GAS
from recoil_identification.rows.sensor_priors import CAMERA_SCALE, RELEASE
from recoil_identification.rows.tracked_recoil import TrackedRecoil
from recoil_processing.picture_bends import picture_bends
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.gauge_zero import MOVES_S, zero_moves
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_processing.shot.sensor_scales import dynamic_scale
from recoil_processing.shot.signals import Signals, collect_signals
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import virtual_shot, with_channels

BRAKE_DELAY = ErrorSource(SourceKind.DELAY, "brake_pressure")

RIGS = ["field-2013", "mixed"]
MOVING = 0.001
"""Share of their ranges by which the gauges' zeros move."""


@cache
def signals_of(name: str) -> Signals:
    virtual = virtual_shot(name, u_zero_rel=MOVING)
    return collect_signals(FiredShot(virtual.shot, virtual.rig), {one.clock: one for one in virtual.shot.alignments})


@cache
def tracked(name: str) -> TrackedRecoil:
    virtual = virtual_shot(name, u_zero_rel=MOVING)
    return TrackedRecoil.of(FiredShot(virtual.shot, virtual.rig), signals_of(name))


@cache
def calibration_of(name: str) -> Calibration:
    return by_camera(tracked(name))


def refitted_kg(name: str, shot: Shot, rig: Rig, signals: Signals) -> float:
    """Let the whole route run again, from the recorded columns on; the noise stays what it was."""
    again, was = TrackedRecoil.of(FiredShot(shot, rig), signals), tracked(name).found
    levels = {"marker_sigma_m": was.marker_sigma_m, "density": was.density}
    return by_camera(replace(again, found=replace(again.found, **levels))).estimate.mass_kg


Move = Callable[[float], tuple[Shot, Rig, Signals]]


def moves_of(name: str) -> dict[str, Move]:
    """What each source does to what was recorded, by one of its own standard uncertainty times a factor."""
    virtual, signals, clock = virtual_shot(name, u_zero_rel=MOVING), signals_of(name), tracked(name).clock
    shot, rig = virtual.shot, virtual.rig
    u = {row.source: row.u_source for row in calibration_of(name).estimate.budget}
    onset_s = tracked(name).forced.recorded.interval_s[0]
    positions_m = np.asarray(shot.channels["x_camera"].samples)
    bends = [np.where(np.isfinite(positions_m), bend, 0.0) for bend in picture_bends(np.nan_to_num(positions_m))]

    def of_series(change: Callable[[np.ndarray, float], np.ndarray], *roles: str) -> Move:
        def moved(factor: float) -> tuple[Shot, Rig, Signals]:
            series = {**signals.series, **{role: change(signals.series[role], factor) for role in roles}}
            return shot, rig, replace(signals, series=series)

        return moved

    def of_camera(change: Callable[[np.ndarray, float], np.ndarray]) -> Move:
        return lambda factor: (with_channels(shot, x_camera=change(positions_m, factor)), rig, signals)

    def of_clock(offset_s: float, drift: float) -> Move:
        middle_s = float(np.mean(tracked(name).forced.recorded.interval_s))

        def moved(factor: float) -> tuple[Shot, Rig, Signals]:
            by = factor * drift
            other = replace(
                clock,
                drift=clock.drift + by,
                offset_s=clock.offset_s + factor * offset_s - by * (middle_s - clock.offset_s) / (1.0 + clock.drift),
            )
            kept = tuple(one for one in shot.alignments if one.clock != clock.clock)
            return replace(shot, alignments=(*kept, other)), rig, signals

        return moved

    made: dict[str, Move] = {}
    for gauge, role in zip(GAUGES, PRESSURE_ROLES, strict=True):
        made[gauge] = of_series(lambda s, by, u=u[gauge]: (1.0 + by * np.expm1(u)) * s, role)
        if (pulse := dynamic_scale(role)) in u:
            made[pulse] = of_series(lambda s, by, u=u[pulse]: (1.0 + by * np.expm1(u)) * s, role)
        if (zero := f"{role} zero") in u:
            made[zero] = of_series(lambda s, by, u=u[zero]: s + by * u, role)
        for tau, shape in zip(MOVES_S, zero_moves(signals.times_s, onset_s).T, strict=True):
            source = moving_zero(role, tau)
            made[source] = of_series(lambda s, by, u=u[source], shape=shape: s + by * u * shape, role)

    def of_friction(factor: float) -> tuple[Shot, Rig, Signals]:
        friction_n = rig.mechanism.friction + factor * u[FRICTION]
        return shot, replace(rig, mechanism=replace(rig.mechanism, friction=friction_n)), signals

    made[FRICTION] = of_friction
    made[CAMERA_SCALE] = of_camera(lambda x, by: (1.0 + by * np.expm1(u[CAMERA_SCALE])) * x)
    for number, source in enumerate(DISTORTIONS):
        made[source] = of_camera(lambda x, by, bend=bends[number], u=u[source]: x + by * u * bend)
    made[f"alignment of clock {clock.clock}"] = of_clock(-clock.u_offset_s, 0.0)
    made[f"rate of clock {clock.clock}"] = of_clock(0.0, -clock.u_drift)
    clocks = {role: shot.by_role(role).time_base.clock for role in PRESSURE_ROLES}
    gauges_late = {BRAKE_DELAY: ["brake_pressure"]}
    for other in {*clocks.values()} - {shot.reference_clock}:
        gauges_late[f"alignment of clock {other}"] = [role for role in PRESSURE_ROLES if clocks[role] == other]
    for source, late in gauges_late.items():
        made[source] = of_series(
            lambda s, by, u=u[source]: np.interp(signals.times_s - by * u, signals.times_s, s), *late
        )
    for role in ("carriage_acceleration_x", "carriage_acceleration_y", "carriage_rate", "tipping_rate"):
        rest = rig.mechanism.at_rest.get(role, 0.0)
        if (source := f"{role} sensitivity") in u:
            made[source] = of_series(lambda s, by, u=u[source], rest=rest: s + by * u * (s - rest), role)
    return made


def row_and_refit_kg(name: str, source: str) -> tuple[float, float]:
    """Return what a row of the budget says, and half the difference of two masses with its source moved either way."""
    (row,) = [row for row in calibration_of(name).estimate.budget if row.source == source]
    up, down = (refitted_kg(name, *moves_of(name)[source](sign)) for sign in (1.0, -1.0))
    assert row.sensitivity is not None
    return row.sensitivity * row.u_source, (up - down) / 2


@pytest.mark.whole_way
def test_every_row_that_counts_has_a_source_that_can_be_moved() -> None:
    estimate = calibration_of("mixed").estimate
    counting = {row.source for row in estimate.budget if row.u_kg > 0.02 * estimate.u_kg}
    assert counting <= moves_of("mixed").keys() | {RANDOM, RELEASE, START.name, GAS.name}


@pytest.mark.whole_way
@pytest.mark.parametrize(
    "source",
    [
        GAUGES[0],
        dynamic_scale("breech_pressure"),
        FRICTION,
        CAMERA_SCALE,
        DISTORTIONS[0],
        "brake_pressure zero that moves in 2 ms",
        "alignment of clock camera",
        "rate of clock camera",
        "alignment of clock can",
        "carriage_acceleration_x sensitivity",
    ],
)
def test_a_row_is_what_moving_its_source_and_estimating_anew_gives(source: str) -> None:
    row_kg, refit_kg = row_and_refit_kg("mixed", source)
    assert row_kg == pytest.approx(refit_kg, abs=0.005 * calibration_of("mixed").estimate.u_kg)


@pytest.mark.whole_way
def test_how_the_stop_lets_go_is_known_to_its_impulse_over_the_mass() -> None:
    (row,) = [row for row in calibration_of("mixed").estimate.budget if row.source == RELEASE]
    forced = tracked("mixed").forced
    assert row.sensitivity is not None
    assert row.u_kg / abs(row.sensitivity) == pytest.approx(forced.recorded.u_release_n_s / forced.mass_kg)


@pytest.mark.whole_way
def test_each_row_of_the_camera_states_the_unit_of_its_source() -> None:
    units = {row.source: row.sensitivity_per for row in calibration_of("mixed").estimate.budget}
    assert units["alignment of clock camera"] == units["alignment of clock can"] == "s"
    assert units["rate of clock camera"] == units[CAMERA_SCALE] == "1"
    assert {units[source] for source in (START.name, *DISTORTIONS)} == {"m"}
    assert units[GAS.name] == "Pa"
