"""A body on a line moves on beyond its record, and stands where no gauge reads what holds it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_processing.filters import LowPass
from recoil_processing.shot.line_regression import LineRegression
from recoil_processing.shot.thinned import factor_of

TIMES_S = np.arange(2000) * 1e-3


def swinging() -> LineRegression:
    """Return a body of 1 kg that swings at 1 Hz from the first sample to the last."""
    force_n = np.sin(2 * np.pi * TIMES_S)
    return LineRegression(
        times_s=TIMES_S,
        step_s=1e-3,
        acceleration_m_s2=force_n,
        forces_n=np.column_stack([force_n, 0.0 * force_n]),
        released=np.ones(TIMES_S.size),
        friction_direction=np.zeros(TIMES_S.size),
        release_per_s=np.zeros(TIMES_S.size),
        trusted=np.ones(TIMES_S.size, dtype=np.bool_),
        interval_s=(0.0, 1.999),
        release_n_s=0.0,
        u_release_n_s=0.0,
        gauges=("push",),
        signs=(1.0,),
        speed_m_s=-np.cos(2 * np.pi * TIMES_S) / (2 * np.pi),
        travel_m=-np.sin(2 * np.pi * TIMES_S) / (2 * np.pi) ** 2,
    )


def test_a_period_of_the_cutoff_at_either_end_of_the_record_is_not_trusted() -> None:
    trusted = swinging().filtered(LowPass(50.0)).trusted
    assert not trusted[:20].any()
    assert not trusted[-20:].any()
    assert trusted[20:-20].all()


def test_a_stroke_is_the_time_between_two_stops_of_the_body() -> None:
    assert abs(swinging().stroke_s - 0.5) < 0.05


def test_its_force_may_need_any_rate() -> None:
    body = swinging()
    assert body.force_rate_hz == math.inf
    assert factor_of(TIMES_S * 1e-4, body.force_rate_hz) == 1 < factor_of(TIMES_S * 1e-4)


def test_its_velocity_counts_either_way_and_its_travel_from_where_it_is_furthest_back() -> None:
    velocity, travel = swinging().outward(np.array([-2.0, 1.0]), np.array([-0.5, 0.25]))
    assert velocity.tolist() == [2.0, 1.0]
    assert travel.tolist() == [0.0, 0.75]


def test_it_has_moved_as_is_told_whatever_its_acceleration_reads() -> None:
    body = swinging()
    velocity, travel = body.moved(np.full(TIMES_S.size, np.nan))
    assert np.array_equal(velocity, body.speed_m_s)
    assert travel.min() == 0.0
    assert np.ptp(travel) == pytest.approx(np.ptp(body.travel_m))


def test_what_no_gauge_reads_acts_beside_them_with_its_friction_or_as_a_spring() -> None:
    body = swinging()
    assert range(body.forces_n.shape[1])[body.unread_column] == len(body.gauges)
    turning, staying = body.unread_shapes(body.travel_m, 1.0)
    assert not turning.any()
    assert staying == pytest.approx(-math.sqrt(0.5))


def test_its_friction_tells_least_where_it_turns() -> None:
    turning = replace(swinging(), friction_direction=np.cos(2 * np.pi * TIMES_S), turning_n=8.0)
    left = turning.turning_m_s2(0.5, 2.0)
    assert left[0] == 0.0
    assert left[250] == pytest.approx(2.0)


def test_its_memory_is_a_share_of_a_stroke_and_its_record_may_begin_and_end_in_motion() -> None:
    body = swinging()
    assert body.memory_s == pytest.approx(0.25 * body.stroke_s)
    assert not body.cut_short
    assert body.begins_in_motion(rested=False)
    assert not body.begins_in_motion(rested=True)
