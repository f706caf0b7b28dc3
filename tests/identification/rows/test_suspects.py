"""What a shot is asked for that its rig does not state: which, and the shapes against their equations."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lsim

from recoil_identification.rows.suspects import (
    BESIDE,
    BREAKAWAY,
    HANGING,
    MOTION,
    Suspect,
    droop_of,
    followed,
    suspects,
)
from recoil_processing.shot.error_source import SourceKind
from recoil_rigs.rig import Rig
from tests.builders.bench_shots import bench_motion, bench_regression, bench_rig, bench_shot, bench_signals
from tests.identification.rows.test_breech_chain import (
    AHEAD,
    AT_MOUTH,
    BRAKE,
    BREECH,
    LINEARITY,
    LOW_PASS,
    MUZZLE_BRAKE,
    errors_n,
    stated,
)


def suspected(rig: Rig) -> dict[str, Suspect]:
    recorded = bench_regression(rig=rig)
    found = suspects(recorded.filtered(LOW_PASS), recorded, bench_signals(rig=rig), rig, ())
    return {one.source: one for one in found}


def test_what_a_rig_does_not_state_is_suspected_and_what_it_states_is_not() -> None:
    plain = bench_rig()
    assert [*suspected(plain)] == [
        LINEARITY, AHEAD, MUZZLE_BRAKE, "tube along its axis", HANGING, BREAKAWAY, droop_of(BREECH), droop_of(BRAKE),
        droop_of("recoil_acceleration"),
    ]  # fmt: skip
    assert LINEARITY not in suspected(stated("u_linearity_rel = 0"))
    assert AHEAD not in suspected(stated(AT_MOUTH))
    assert SourceKind.TUBE not in [one.source.kind for one in suspected(stated(tube_hz=900.0)).values()]
    said = replace(plain, mechanism=replace(plain.mechanism, unstated=frozenset()))
    assert MUZZLE_BRAKE not in suspected(said)


def test_among_the_suspected_variants_is_one_near_to_the_true_shape() -> None:
    recorded, found = bench_regression(), suspected(stated("range = [0.0, 250e6]"))
    for source in (LINEARITY, AHEAD, MUZZLE_BRAKE):
        true, shapes = LOW_PASS.apply(errors_n(recorded)[source], recorded.rate_hz), found[source].shapes
        alike = shapes @ true / (np.linalg.norm(shapes, axis=1) * np.linalg.norm(true))
        assert alike.max() > 0.95, source
        assert len(found[source].variants) == len(shapes)


@pytest.mark.parametrize(("hz", "damping"), [(9.0, 0.05), (20.0, 0.2), (45.0, 0.4)])
def test_a_part_that_hangs_follows_as_its_equation_of_motion_says(hz: float, damping: float) -> None:
    recorded, w = bench_regression(), 2.0 * math.pi * hz
    since_s = recorded.times_s - recorded.times_s[0]
    _, expected, _ = lsim(([2 * damping * w, w**2], [1.0, 2 * damping * w, w**2]), recorded.force_n, since_s)
    found = followed(recorded.force_n, recorded.step_s, hz, damping)
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())


def test_what_a_part_that_hangs_does_acts_beside_the_forces_and_can_only_be_there() -> None:
    recorded, hanging = bench_regression().filtered(LOW_PASS), suspected(bench_rig())[HANGING]
    assert (hanging.where, hanging.positive) == (BESIDE, True)
    cause = hanging.cause(recorded, 0)
    assert cause.beside_n is not None
    assert not cause.forces_n.any()
    assert not cause.acceleration_m_s2.any()
    # held by a spring that is stiff against the motion it goes along
    stiff = recorded.force_n - followed(recorded.force_n, recorded.step_s, 2000.0, 0.5)
    assert np.linalg.norm(stiff) < 0.05 * np.linalg.norm(cause.beside_n)


def test_friction_that_breaks_away_acts_where_the_part_is_slow() -> None:
    recorded, breaking = bench_regression().filtered(LOW_PASS), suspected(bench_rig())[BREAKAWAY]
    assert (breaking.unit, breaking.positive) == ("N", True)
    for variant in range(3):
        cause = breaking.cause(recorded, variant)
        assert cause.beside_n is not None
        assert cause.beside_n.min() < -0.9  # it holds back what begins to move
    speed_m_s = cumulative_trapezoid(recorded.acceleration_m_s2, dx=recorded.step_s, initial=0.0)
    assert np.abs(breaking.shapes[0][recorded.inside & (speed_m_s > 1.0)]).max() < 0.1


def test_an_amplifier_that_droops_lacks_the_integral_of_what_it_reads() -> None:
    recorded, found = bench_regression(), suspected(bench_rig())
    filtered = recorded.filtered(LOW_PASS)
    gauge, motion = found[droop_of(BRAKE)], found[droop_of("recoil_acceleration")]
    expected = cumulative_trapezoid(filtered.forces_n[:, 1], dx=recorded.step_s, initial=0.0)
    np.testing.assert_allclose(gauge.cause(filtered, 0).forces_n[:, 1], expected)
    assert (gauge.unit, gauge.positive, motion.where) == ("1/s", True, MOTION)
    expected = -cumulative_trapezoid(filtered.acceleration_m_s2, dx=recorded.step_s, initial=0.0)
    np.testing.assert_allclose(motion.cause(filtered, 0).acceleration_m_s2, expected)
    assert bench_motion().brake_pa.any()


def test_a_shot_without_a_breech_gauge_is_asked_for_nothing() -> None:
    recorded, signals = bench_regression(), bench_signals()
    other = replace(signals, series={role: one for role, one in signals.series.items() if role != BREECH})
    assert suspects(recorded.filtered(LOW_PASS), recorded, other, bench_rig(), ()) == ()
    assert bench_shot().by_role(BREECH) is not None
