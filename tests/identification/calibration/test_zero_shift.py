"""A zero that shifts at the shot is found with the force, and only where the shot demands it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.methods import calibrated_mass, calibrated_with_zero_shift
from recoil_identification.calibration.zero_shift import MARGIN, ZeroShift, shift_columns, with_zero_shift
from recoil_identification.rows.row_noise import row_noise
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.filters import LowPass
from recoil_processing.shot.clocks.estimator_inputs import BaselineNoise
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import MASS_KG, bench_regression
from tests.builders.virtual_shots import identified, virtual_shot, with_channels

SCALES = ScaleUncertainty(0.005, (0.005, 0.004, 0.004), 150.0)
U_BIAS = 0.1
LOW_PASS = LowPass(300.0)
BASELINE = BaselineNoise(slow_acceleration=20.0, slow_force=0.0)
"""Of the bench shot, which is as noisy in motion as at rest."""


def measured(
    seed: int, *, step: float = 0.0, decaying: float = 0.0, tau_s: float = 0.02, late_s: float | None = None
) -> Regression:
    """The bench shot as an accelerometer with noise reads it whose zero shifts."""
    truth = bench_regression()
    rng = np.random.default_rng(seed)
    since = np.maximum(truth.times_s - truth.times_s[int(np.argmax(truth.released > 0.5))], 0.0)
    begun = truth.released if late_s is None else truth.times_s >= truth.interval_s[0] + late_s
    shift = (step + decaying * np.exp(-since / tau_s)) * begun
    a = truth.force_n / MASS_KG + shift + rng.normal(0.0, 20.0, truth.times_s.size)
    forces = truth.forces_n.copy()
    forces[:, :3] *= 1.0 + rng.normal(0.0, 1.0, 3) * SCALES.gauges
    return replace(truth, acceleration_m_s2=a, forces_n=forces)


def judged(regression: Regression, u_bias: float = U_BIAS) -> tuple[Regression, Regression, Calibration, ZeroShift]:
    """The shot as recorded and behind the filter, with all shapes to choose from."""
    recorded = replace(regression, shifts=shift_columns(regression))
    return calibrated_with_zero_shift(recorded, recorded.filtered(LOW_PASS), SCALES, u_bias, BASELINE)


def found(regression: Regression, u_bias: float = U_BIAS) -> tuple[Regression, float, float, ZeroShift]:
    _, filtered, calibration, shift = judged(regression, u_bias)
    return filtered, calibration.estimate.mass_kg, calibration.estimate.u_kg, shift


@pytest.mark.whole_way
def test_without_a_shift_none_is_demanded() -> None:
    demanded = sum(found(measured(seed))[3].demanded for seed in range(40))
    assert demanded <= 2


@pytest.mark.whole_way
@pytest.mark.parametrize("step", [-15.0, 25.0])
def test_a_step_is_found_and_the_mass_is_right_all_the_same(step: float) -> None:
    for seed in range(5):
        filtered, mass, u, shift = found(measured(seed, step=step))
        assert shift.demanded
        assert filtered.shifts is not None
        assert abs(mass - MASS_KG) < 3 * u
        assert u < 0.02 * MASS_KG


@pytest.mark.whole_way
def test_a_shift_that_decays_is_found_with_its_size_and_time() -> None:
    _, mass, u, shift = found(measured(1, decaying=60.0, tau_s=0.02))
    assert shift.demanded
    assert shift.time_constant_s in (0.01, 0.02, 0.05)
    assert shift.decaying_m_s2 == pytest.approx(60.0, rel=0.3)
    assert abs(mass - MASS_KG) < 3 * u


@pytest.mark.whole_way
@pytest.mark.parametrize("late_s", [-4e-4, 6e-4])
def test_a_step_that_came_earlier_or_later_than_the_onset_leaves_a_kick(late_s: float) -> None:
    _, mass, u, shift = found(measured(1, step=150.0, late_s=late_s))
    assert shift.step_m_s2 == pytest.approx(150.0, abs=4 * shift.u_step_m_s2)
    assert shift.kick_m_s == pytest.approx(-150.0 * late_s, rel=0.3)
    assert "kick" in str(shift)
    assert abs(mass - MASS_KG) < 3 * u


@pytest.mark.parametrize(("step", "kicks"), [(1.7, False), (2.3, True)])
def test_a_kick_is_told_only_beside_a_step_of_four_standard_uncertainties(step: float, kicks: bool) -> None:
    regression = measured(1, step=step)
    kicked = regression.acceleration_m_s2 + 0.3 * shapes_by_hand(regression)[:, 1]
    regression = replace(regression, acceleration_m_s2=kicked)
    _, filtered, calibration, shift = judged(regression)
    both = filtered.with_shifts(shapes_by_hand(regression)).shifts
    assert both is not None
    free = fitted(filtered, calibration, both)
    assert bool(abs(free.shifts_m_s2[0]) > 4.0 * free.u_shifts_m_s2[0]) is kicks
    assert (shift.u_kick_m_s > 0.0) is kicks
    assert shift.demanded


def test_a_gauge_that_explains_the_shot_as_well_is_no_shift_to_the_force_alone() -> None:
    regression = measured(1)
    forces = regression.forces_n.copy()
    forces[:, 2] *= 1.15
    filtered, _, _, shift = found(replace(regression, forces_n=forces))
    assert filtered.shifts is None
    assert not shift.demanded
    # though the rows alone would have it
    assert shift.criterion == MARGIN


def test_corrected_both_sides_agree_where_the_shift_was() -> None:
    regression = measured(2, step=25.0)
    _, filtered, calibration, _ = judged(regression)
    a, force = calibration.correct(filtered)
    late = filtered.used & (filtered.times_s > filtered.interval_s[0] + 0.03)
    assert abs(np.mean(a[late] - force[late] / calibration.estimate.mass_kg)) < 0.5


def test_a_shift_costs_certainty() -> None:
    _, _, without, _ = found(measured(3))
    _, _, with_shift, _ = found(measured(3, step=25.0))
    assert with_shift > without


def test_without_a_baseline_no_shift_is_told_from_a_zero_that_was_never_known() -> None:
    filtered, _, _, shift = found(measured(4, step=25.0), u_bias=math.inf)
    assert filtered.shifts is None
    assert shift == ZeroShift()


def test_a_zero_that_does_not_shift_has_no_size_and_no_uncertainty() -> None:
    sound = ZeroShift()
    assert (sound.step_m_s2, sound.decaying_m_s2, sound.kick_m_s) == (0.0, 0.0, 0.0)
    assert (sound.u_step_m_s2, sound.u_decaying_m_s2, sound.u_kick_m_s) == (0.0, 0.0, 0.0)
    assert math.isinf(sound.time_constant_s)
    assert sound.criterion == 0.0
    assert not sound.demanded
    assert not sound.confirmed


def test_a_shift_is_demanded_where_the_criterion_falls_by_more_than_ten() -> None:
    assert not ZeroShift(criterion=10.0).demanded
    assert ZeroShift(criterion=10.1).demanded


def shapes_by_hand(regression: Regression, *taus_s: float) -> np.ndarray:
    """Step and kick at the onset, and decays from it."""
    since = regression.times_s - regression.interval_s[0]
    begun = since >= 0.0
    kick = np.diff(begun, prepend=False) / regression.step_s
    return np.column_stack([begun, kick, *(np.where(begun, np.exp(-since / tau), 0.0) for tau in taus_s)])


def fitted(filtered: Regression, calibration: Calibration, shifts: np.ndarray | None) -> Calibration:
    """The shot anew with other shapes of a shift and the noise that was taken."""
    return calibrated_mass(replace(filtered, shifts=shifts), SCALES, U_BIAS, noise=calibration.noise)


def test_a_zero_may_shift_by_a_step_a_kick_and_decays_of_10_to_100_ms() -> None:
    regression = bench_regression()
    columns = shift_columns(regression)
    np.testing.assert_allclose(columns, shapes_by_hand(regression, 0.01, 0.02, 0.05, 0.1), atol=1e-12)
    # what a kick adds to the velocity is one
    assert columns[:, 1].sum() * regression.step_s == pytest.approx(1.0)


SHIFTED = {
    "to stay": {"step": 25.0},
    "late": {"step": 150.0, "late_s": 6e-4},
    "10 ms": {"decaying": 90.0, "tau_s": 0.01},
    "20 ms": {"decaying": 60.0, "tau_s": 0.02},
    "50 ms": {"decaying": 60.0, "tau_s": 0.05},
    "100 ms": {"decaying": 60.0, "tau_s": 0.1},
    "both": {"step": 20.0, "decaying": 80.0, "tau_s": 0.01},
}


@pytest.mark.whole_way
@pytest.mark.parametrize("shifted", SHIFTED.values(), ids=SHIFTED)
def test_the_parts_that_are_told_add_up_to_the_shift_that_is_taken_off(shifted: dict[str, float]) -> None:
    recorded, filtered, calibration, shift = judged(measured(1, **shifted))
    assert recorded.shifts is not None
    assert filtered.shifts is not None
    taken = recorded.shifts @ calibration.shifts_m_s2
    told = shapes_by_hand(recorded, shift.time_constant_s) @ [shift.step_m_s2, shift.kick_m_s, shift.decaying_m_s2]
    np.testing.assert_allclose(told, taken, atol=1e-9)
    np.testing.assert_allclose(recorded.filtered(LOW_PASS).shifts, filtered.shifts, atol=1e-9)
    parts = [
        (size, u)
        for size, u in (
            (shift.step_m_s2, shift.u_step_m_s2),
            (shift.kick_m_s, shift.u_kick_m_s),
            (shift.decaying_m_s2, shift.u_decaying_m_s2),
        )
        if (size, u) != (0.0, 0.0)
    ]
    assert parts == list(zip(calibration.shifts_m_s2, calibration.u_shifts_m_s2, strict=True))
    assert math.isinf(shift.time_constant_s) == (shift.u_decaying_m_s2 == 0.0)


@pytest.mark.parametrize("shifted", SHIFTED.values(), ids=SHIFTED)
def test_the_criterion_is_what_the_misfit_falls_by_less_a_logarithm_of_the_rows_for_each_shape(
    shifted: dict[str, float],
) -> None:
    regression = measured(1, **shifted)
    full = replace(regression, shifts=shift_columns(regression)).filtered(LOW_PASS)
    plain = replace(full, shifts=None)
    without = calibrated_mass(plain, SCALES, U_BIAS, noise=row_noise(plain, MASS_KG, BASELINE))
    chosen, calibration, shift = with_zero_shift(without, full, None)
    assert full.shifts is not None
    anew = fitted(full, without, full.shifts[:, chosen])
    penalty = len(chosen) * math.log(calibration.estimate.rows)
    assert shift.criterion == pytest.approx(without.inferred.misfit - anew.inferred.misfit - penalty, rel=1e-9)
    assert anew.shifts_m_s2 == pytest.approx(calibration.shifts_m_s2)


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_the_criterion_of_a_shift_that_is_not_demanded_is_what_the_best_fit_would_give(seed: int) -> None:
    regression = measured(seed, step=1.5)
    _, filtered, calibration, shift = judged(regression)
    assert filtered.shifts is None
    every = filtered.with_shifts(shapes_by_hand(regression, 0.01, 0.02, 0.05, 0.1)).shifts
    assert every is not None
    criteria = [
        calibration.inferred.misfit
        - fitted(filtered, calibration, every[:, shape]).inferred.misfit
        - len(shape) * math.log(calibration.estimate.rows)
        for shape in ([0], [2], [3], [4], [5], [0, 1], [0, 2], [0, 3], [0, 4], [0, 5])
    ]
    assert 0.0 < shift.criterion < MARGIN
    assert shift.criterion == pytest.approx(max(criteria), abs=0.05)


@pytest.mark.parametrize(
    ("shift", "sentence"),
    [
        (ZeroShift(), "not at all"),
        (ZeroShift(step_m_s2=-12.0, u_step_m_s2=0.5), "by -12 m/s^2 (u 0.5 m/s^2) to stay"),
        (
            ZeroShift(decaying_m_s2=60.0, u_decaying_m_s2=3.0, time_constant_s=0.02),
            "by +60 m/s^2 (u 3 m/s^2) that decay in 20 ms",
        ),
        (
            ZeroShift(step_m_s2=25.0, u_step_m_s2=0.6, kick_m_s=-0.02, u_kick_m_s=0.006),
            "by +25 m/s^2 (u 0.6 m/s^2) to stay and with a kick of -0.02 m/s (u 0.006 m/s)",
        ),
    ],
)
def test_a_shift_is_told_by_its_parts(shift: ZeroShift, sentence: str) -> None:
    assert str(shift) == sentence


@pytest.mark.whole_way
@pytest.mark.parametrize("step_m_s2", [8.0, -25.0])
def test_with_a_camera_a_step_is_confirmed_and_costs_the_mass_nothing(step_m_s2: float) -> None:
    virtual, sound = virtual_shot("mixed"), identified("mixed").chosen.estimate
    accelerometer = virtual.shot.by_role("recoil_acceleration")
    after = accelerometer.time_base.times_s >= virtual.truth["t_fire"]
    shot = with_channels(virtual.shot, **{accelerometer.name: accelerometer.samples + step_m_s2 * after})
    found = identify_shot(
        FiredShot(replace(shot, alignments=align_clocks(FiredShot(shot, virtual.rig))), virtual.rig), Options()
    )
    shift, estimate = found.inertial.zero_shift, found.chosen.estimate
    assert shift.demanded
    assert shift.confirmed
    assert shift.step_m_s2 == pytest.approx(step_m_s2, abs=4 * shift.u_step_m_s2)
    assert found.valid
    assert estimate.mass_kg == pytest.approx(sound.mass_kg, abs=0.3 * sound.u_kg)
    assert estimate.u_kg == pytest.approx(sound.u_kg, rel=0.02)


@pytest.mark.whole_way
@pytest.mark.parametrize("kick_m_s", [0.2, -0.2])
@pytest.mark.parametrize("anew", [False, True], ids=["clock known otherwise", "clock by the motion"])
def test_a_false_velocity_at_the_release_makes_no_valid_mass_whatever_it_is_taken_for(kick_m_s: float, anew: bool):
    found = identified_with_a_kick(kick_m_s, anew)
    assert not found.valid
    if kick_m_s > 0:  # one to the other side is taken for noise that goes with the acceleration, and for a late clock
        assert found.inertial.zero_shift.demanded


@pytest.mark.whole_way
def test_a_small_false_velocity_at_the_release_is_found_and_costs_the_mass_nothing() -> None:
    found = identified_with_a_kick(0.1, anew=False)
    shift, estimate = found.inertial.zero_shift, found.chosen.estimate
    assert shift.kick_m_s == pytest.approx(0.1, abs=4 * shift.u_kick_m_s)
    assert found.valid
    assert abs(estimate.mass_kg - 782.0) < 2 * estimate.u_kg


def identified_with_a_kick(kick_m_s: float, anew: bool) -> Identification:
    """A whole shot whose accelerometer reads, at the release, a velocity that was not there."""
    virtual = virtual_shot("mixed")
    accelerometer = virtual.shot.by_role("recoil_acceleration")
    times_s = accelerometer.time_base.times_s
    samples = np.array(accelerometer.samples)
    first = int(np.argmax(times_s >= virtual.truth["t_fire"]))
    # one sample alone would be a spike, which is taken out
    samples[first : first + 2] += 0.5 * kick_m_s * accelerometer.time_base.rate_hz
    shot = with_channels(virtual.shot, **{accelerometer.name: samples})
    alignments = align_clocks(FiredShot(shot, virtual.rig)) if anew else shot.alignments
    return identify_shot(FiredShot(replace(shot, alignments=alignments), virtual.rig), Options())


@pytest.mark.whole_way
def test_a_gauge_that_is_off_is_no_shift_of_the_zero() -> None:
    virtual = virtual_shot("mixed")
    gauge = virtual.shot.by_role("recuperator_pressure")
    found = identify_shot(
        FiredShot(with_channels(virtual.shot, **{gauge.name: 1.15 * np.asarray(gauge.samples)}), virtual.rig), Options()
    )
    assert not found.inertial.zero_shift.demanded
    assert found.reasons[0].startswith("recuperator_pressure sensitivity and area contradicts")
