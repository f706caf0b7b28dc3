"""How far a gauge's zero may move in a shot."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_processing.shot.gauge_zero import moving_zero_pa, zero_moves
from tests.builders.bench_shots import bench_rig


@pytest.mark.parametrize(
    ("declared", "u_pa"),
    [("range = [-2e5, 4e7]", 4e4), ("range = [-5e7, 4e7]", 5e4), ("range = [0, 4e7], u_zero_rel = 0.002", 8e4)],
)
def test_a_zero_moves_by_a_share_of_the_farther_end_of_its_range(declared: str, u_pa: float) -> None:
    spec = bench_rig(p_brake=declared).channel("p_brake")
    assert moving_zero_pa(spec, np.array([1e9, np.nan])) == pytest.approx(u_pa)


def test_without_a_range_a_zero_moves_by_a_share_of_what_was_read() -> None:
    spec = bench_rig().channel("p_brake")
    assert moving_zero_pa(spec, np.array([2e6, -3e6, np.nan])) == pytest.approx(3e3)
    assert moving_zero_pa(spec, np.zeros(0)) == 0.0


def test_a_zero_is_never_more_uncertain_than_stated_and_holds_every_way_of_moving() -> None:
    times_s = np.linspace(0.0, 0.3, 3001)
    moves = zero_moves(times_s, 0.05)
    since = np.maximum(times_s - 0.05, 0.0)
    assert (np.sum(moves**2, axis=1) <= 1.0).all()
    assert (np.sum(moves**2, axis=1)[since > 6e-3] > 0.6).all()
    assert not moves[since == 0.0].any()
    for way in (
        np.clip((since - 2e-3) / 4e-3, 0.0, 1.0),
        -np.expm1(-since / 20e-3),
        -np.expm1(-since / 2e-3) * np.exp(-since / 0.3),
    ):
        sizes, *_ = np.linalg.lstsq(moves, way, rcond=None)
        assert np.sqrt(np.mean((moves @ sizes - way) ** 2)) < 0.07
