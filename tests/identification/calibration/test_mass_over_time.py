"""The mass over time beside the sensors' errors, and the test of its constancy."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_acquisition.numerics.normal_distribution import probability_text
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.mass_over_time import (
    BY_SCAN,
    MassConstancy,
    mass_constancy,
    mass_over_time,
    steps_behind,
)
from recoil_identification.calibration.methods import calibrated_mass
from recoil_identification.estimate.mass import GAUGES
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior
from recoil_identification.rows.equation_of_motion import MASS, change, ramps
from recoil_identification.rows.row_noise import RowNoise
from recoil_identification.shot.sensor_doubts import likeliest_sensor
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from tests.builders.bench_shots import MASS_KG, bench_regression
from tests.builders.virtual_shots import identified

SCALES = ScaleUncertainty(0.005, (0.006, 0.004, 0.004), 150.0)
NO_DOUBT = ScaleUncertainty(0.0, (0.0, 0.0, 0.0), 0.0)
SIGMA_M_S2 = 2.0


@cache
def recorded() -> Regression:
    return replace(bench_regression(), release_n_s=0.0)


def shot(
    seed: int, share: np.ndarray | float = 1.0, gauges: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> Regression:
    """Let a mass that is a share of the whole over time move as Newton's law has it; noise is white on the rows."""
    r = recorded()
    truth = replace(r, acceleration_m_s2=r.force_n / (MASS_KG * share)).filtered(LowPass(300.0))
    a, rows = truth.acceleration_m_s2.copy(), spaced_rows(truth)
    a[rows] += np.random.default_rng(seed).normal(0.0, SIGMA_M_S2, rows.size)
    forces = truth.forces_n.copy()
    forces[:, :3] *= gauges
    return replace(truth, acceleration_m_s2=a, forces_n=forces)


def calibrated(regression: Regression, scales: ScaleUncertainty = SCALES) -> Calibration:
    noise = RowNoise(np.full(regression.times_s.size, SIGMA_M_S2), 1.0, math.inf)
    return calibrated_mass(regression, scales, 0.2, noise=noise)


def stepping(at_s: float, by: float) -> np.ndarray:
    r = recorded()
    return np.where(r.times_s >= r.interval_s[0] + at_s, 1.0 + by, 1.0)


def drifting(by: float) -> np.ndarray:
    r = recorded()
    return 1.0 + by * ramps(r.times_s, r.interval_s, 1)[:, 0]


@pytest.mark.whole_way
def test_a_constant_mass_is_called_changing_as_often_as_the_level_says(monkeypatch: pytest.MonkeyPatch):
    # a probability of 5 % is known to a tenth
    monkeypatch.setattr("recoil_identification.calibration.mass_over_time.DRAWS", 2_000)
    rng = np.random.default_rng(20130901)
    found = [
        mass_constancy(calibrated(shot(seed, gauges=tuple(1.0 + rng.normal(0.0, SCALES.gauges)))))
        for seed in range(120)
    ]
    called = [0.0 if one is None else one.p_value < 0.05 for one in found]
    assert None not in found
    assert np.mean(called) <= 0.1
    # and what the drift is measured by is standard normal
    z = [one.normalised_drift for one in found if one is not None]
    assert np.std(z) == pytest.approx(1.0, abs=0.2)
    # probabilities of what chance alone brings are evenly spread
    for p_values in (
        [one.p_step for one in found if one is not None],
        [one.p_drift for one in found if one is not None],
    ):
        assert np.quantile(p_values, [0.25, 0.5, 0.75]) == pytest.approx([0.25, 0.5, 0.75], abs=0.15)


@pytest.mark.parametrize("seed", range(3))
def test_a_step_is_found_with_its_size_its_instant_and_both_masses(seed):
    one = mass_constancy(calibrated(shot(seed, stepping(0.06, -0.04))))
    assert one is not None
    assert one.kind == "step"
    assert one.p_value < 1e-3
    assert one.instant_s - one.onset_s == pytest.approx(0.06, abs=0.003)
    assert one.interval_s[0] <= one.instant_s <= one.interval_s[1]
    assert one.change_kg == pytest.approx(-0.04 * MASS_KG, abs=4 * one.u_change_kg)
    assert one.before_kg == pytest.approx(MASS_KG, abs=4 * one.u_before_kg)
    assert one.after_kg == pytest.approx(0.96 * MASS_KG, abs=4 * one.u_after_kg)
    # their common error does not touch the change
    assert one.u_change_kg < math.hypot(one.u_before_kg, one.u_after_kg)
    assert f"{one.change_kg:+.1f} kg" in str(one)


def test_a_drift_is_called_a_drift():
    one = mass_constancy(calibrated(shot(1, drifting(-0.05))))
    assert one is not None
    assert (one.kind, one.constant) == ("drift", False)
    assert one.change_kg == pytest.approx(-0.05 * MASS_KG, abs=4 * one.u_change_kg)
    assert "over the travel" in str(one)


def test_what_a_departure_is_measured_by_is_its_size_in_a_new_fit_over_its_uncertainty():
    """A score is a new fit's size over its uncertainty, as long as the size is small."""
    calibration = calibrated(shot(2, drifting(-0.01)))
    one = mass_constancy(calibration)
    r = calibration.block.regression
    anew = calibration.with_changes(ramps(r.times_s, r.interval_s, 1)).inferred
    size = change(0).name
    assert one is not None
    assert one.normalised_drift == pytest.approx(anew.value(size) / anew.u(size), abs=0.05)
    assert one.p_drift == pytest.approx(math.erfc(abs(one.normalised_drift) / math.sqrt(2.0)), rel=1e-9)


@pytest.mark.parametrize(
    ("share", "gauges", "named"),
    [(-0.03, (1.0, 1.0, 1.0), "mass"), (0.0, (1.0, 1.06, 1.0), GAUGES[1]), (0.0, (1.04, 1.0, 1.0), GAUGES[0])],
)
def test_what_mass_and_likeliest_sensor_are_compared_by_is_what_new_fits_raise_the_log_likelihood_by(
    share: float, gauges: tuple[float, float, float], named: str
):
    calibration = calibrated(shot(3, drifting(share), gauges))
    one, sensor = mass_constancy(calibration), likeliest_sensor(calibration)
    assert one is not None
    r = calibration.block.regression
    shapes = ramps(r.times_s, r.interval_s, 1) if one.kind == "drift" else steps_behind(r, instants(r))
    anew = [calibration.with_changes(shape[:, np.newaxis]) for shape in shapes.T]
    sensor_anew = calibration.without_prior(sensor.source)
    # the step that was tried, and not the one between two of them
    left = {"mass": min(fit.inferred.misfit for fit in anew), sensor.source: sensor_anew.inferred.misfit}
    rises = {name: 0.5 * (calibration.inferred.misfit - misfit) for name, misfit in left.items()}
    by_chance = 0.5 * BY_SCAN**2 if one.kind == "step" else 0.0
    assert one.gain == pytest.approx(rises["mass"] - by_chance, rel=0.03)
    assert sensor.gain == pytest.approx(rises[sensor.source], rel=0.03)
    assert (sensor.source if sensor.gain > one.gain else "mass") == named == max(rises, key=rises.__getitem__)


@pytest.mark.parametrize("low_pass", [LowPass(300.0), None], ids=["filtered", "as recorded"])
def test_steps_are_tried_from_3_percent_of_the_travel_to_10_before_its_end_each_as_a_new_fit_would_tell(low_pass):
    r = shot(0) if low_pass else replace(recorded(), acceleration_m_s2=shot(0).acceleration_m_s2)
    calibration = calibrated(r)
    one = mass_constancy(calibration)
    assert one is not None
    onset_s, end_s = r.interval_s
    travel_s = end_s - onset_s
    sizes = []
    for instant_s in np.linspace(onset_s + 0.03 * travel_s, end_s - 0.1 * travel_s, 24):
        # half way up at the instant itself, which lies between two samples
        step = np.clip((r.times_s - instant_s) / r.step_s + 0.5, 0.0, 1.0)
        column = (low_pass.apply(step, r.rate_hz) if low_pass else r.times_s >= instant_s)[:, np.newaxis]
        anew = calibration.with_changes(column.astype(np.float64)).inferred
        sizes.append(anew.value(change(0).name) / anew.u(change(0).name))
    assert abs(one.normalised_step) == pytest.approx(np.abs(sizes).max(), rel=0.02)


def test_the_largest_of_many_steps_is_likelier_by_chance_than_one_and_less_than_that_many_that_are_independent():
    one = mass_constancy(calibrated(shot(0, stepping(0.06, -0.02))))
    assert one is not None
    alone = math.erfc(abs(one.normalised_step) / math.sqrt(2.0))
    # of 24 instants, half as many as would find all there is to find
    assert 9 * alone < one.p_step < 18 * alone < 0.1


def test_a_gauge_that_may_be_off_explains_what_else_would_be_a_change():
    regression = shot(3, gauges=(1.013, 1.0, 1.0))
    sure, unsure = (mass_constancy(calibrated(regression, scales)) for scales in (NO_DOUBT, SCALES))
    assert sure is not None
    assert unsure is not None
    assert unsure.ln_bayes_factor < 0.0 < 3.0 < sure.ln_bayes_factor


def test_the_walk_holds_masses_that_drift_and_step():
    r = recorded()
    for share in (drifting(-0.03), stepping(0.05, -0.01), 1.0):
        found = mass_over_time(calibrated(shot(4, share)))
        true = np.broadcast_to(MASS_KG * share, r.times_s.shape)[r.inside]
        assert np.mean(np.abs(found.mass_kg - true) <= 2 * found.u_kg) > 0.9
        assert found.times_s.shape == found.mass_kg.shape == found.u_kg.shape


def test_the_walk_is_least_certain_at_its_end():
    found = mass_over_time(calibrated(shot(5)))
    assert found.u_kg[-1] > 1.5 * found.u_kg.min()


def test_the_walk_has_twelve_pieces_and_may_change_by_three_percent_over_the_travel():
    calibration = calibrated(shot(4, drifting(-0.03)))
    r, found = calibration.block.regression, mass_over_time(calibration)
    shapes = ramps(r.times_s, r.interval_s, 12)
    inferred = calibration.with_changes(shapes, 0.03 / math.sqrt(12)).inferred
    names = [MASS.name, *(change(i).name for i in range(12))]
    at = [[one.name for one in inferred.unknowns].index(name) for name in names]
    covariance, last = inferred.covariance[np.ix_(at, at)], np.append(1.0, shapes[r.inside][-1])
    assert found.mass_kg[-1] / found.mass_kg[0] == pytest.approx(math.exp(inferred.values[at[1:]] @ last[1:]), rel=1e-6)
    assert found.u_kg[0] == pytest.approx(found.mass_kg[0] * math.sqrt(covariance[0, 0]), rel=1e-6)
    assert found.u_kg[-1] == pytest.approx(found.mass_kg[-1] * math.sqrt(last @ covariance @ last), rel=1e-6)


@pytest.mark.whole_way
@pytest.mark.parametrize("at_s", [0.0585, 0.06, 0.0615])
def test_the_interval_of_a_steps_instant_is_the_one_that_new_fits_give_it(at_s):
    calibration = calibrated(shot(0, stepping(at_s, -0.05)))
    r, one = calibration.block.regression, mass_constancy(calibration)
    assert one is not None
    apart_s = (r.interval_s[1] - r.interval_s[0]) / 24
    instants = np.arange(one.instant_s - 2.5 * apart_s, one.instant_s + 2.5 * apart_s, 1e-4)
    log_likelihood = []
    for instant_s in instants:
        step = np.clip((r.times_s - instant_s) / r.step_s + 0.5, 0.0, 1.0)
        anew = calibration.with_changes(LowPass(300.0).apply(step, r.rate_hz)[:, np.newaxis]).inferred
        log_likelihood.append(0.5 * (anew.value(change(0).name) / anew.u(change(0).name)) ** 2)
    risen = np.cumsum(np.exp(np.array(log_likelihood) - max(log_likelihood)))
    low, high = np.interp([0.025, 0.975], risen / risen[-1], instants)
    assert one.instant_s == pytest.approx(instants[int(np.argmax(log_likelihood))], abs=2e-4)
    # beyond the instants about the likeliest one they lie farther apart
    assert one.interval_s == pytest.approx((low, high), abs=0.4 * apart_s)


def test_a_walk_that_may_not_move_is_the_constant_mass():
    calibration = calibrated(shot(6))
    r = calibration.block.regression
    held = calibration.with_changes(ramps(r.times_s, r.interval_s, 4), 1e-9)
    assert held.inferred.value(MASS.name) == pytest.approx(calibration.inferred.value(MASS.name), abs=1e-9)
    assert held.inferred.u(MASS.name) == pytest.approx(calibration.inferred.u(MASS.name), rel=1e-6)


@cache
def constancy_of_a_step() -> MassConstancy:
    one = mass_constancy(calibrated(shot(0, stepping(0.06, -0.2))))
    assert one is not None
    return one


def test_a_large_step_is_as_unlikely_as_a_draw_can_tell_and_its_instant_as_sure_as_its_interval_says():
    one = constancy_of_a_step()
    # one of 20001, the shot itself among the draws
    assert one.p_step == pytest.approx(1 / 20_001)
    low, high = one.interval_s
    assert low < one.onset_s + 0.06 < high
    assert high - low < 2e-3


def test_a_mass_after_a_change_is_the_one_before_and_the_change_of_which_each_has_its_uncertainty():
    one = constancy_of_a_step()
    assert one.after_kg == pytest.approx(one.before_kg + one.change_kg)
    inferred = one.changed.inferred
    at = [[unknown.name for unknown in inferred.unknowns].index(name) for name in (MASS.name, change(0).name)]
    logs = np.random.default_rng(1).multivariate_normal(
        inferred.values[at], inferred.covariance[np.ix_(at, at)], 40_000
    )
    before = np.exp(logs[:, 0])
    after = np.exp(logs.sum(axis=1))
    scale = one.before_kg / np.exp(inferred.value(MASS.name))
    assert one.u_before_kg == pytest.approx(scale * before.std(), rel=0.02)
    assert one.u_after_kg == pytest.approx(scale * after.std(), rel=0.02)
    # the change at the mass that was before
    assert one.u_change_kg == pytest.approx(one.before_kg * np.std(after / before), rel=0.02)


@pytest.mark.parametrize(
    ("step", "drift", "size"), [(2.9, 0.0, 2.30), (-2.9, 1.0, 2.30), (1.7, -0.5, 0.5), (2.0, 3.0, 3.0)]
)
def test_the_largest_of_many_steps_counts_for_less_than_what_was_known_before(step, drift, size):
    one = replace(constancy_of_a_step(), normalised_step=step, normalised_drift=drift)
    assert one.normalised_residual == pytest.approx(size, abs=0.005)


@pytest.mark.parametrize(
    ("p_step", "p_drift", "p_value"), [(0.004, 0.5, 0.008), (0.5, 0.004, 0.008), (0.7, 0.8, 1.0), (0.0105, 0.5, 0.021)]
)
def test_of_two_tests_the_rarer_counts_twice(p_step, p_drift, p_value):
    one = replace(constancy_of_a_step(), p_step=p_step, p_drift=p_drift)
    assert one.p_value == pytest.approx(p_value)


@pytest.mark.parametrize(("ln_bayes_factor", "constant"), [(-1.0, True), (2.99, True), (3.01, False)])
def test_the_mass_is_said_to_change_where_that_is_twenty_times_likelier(ln_bayes_factor, constant):
    one = replace(constancy_of_a_step(), ln_bayes_factor=ln_bayes_factor, sensor_residual=0.0, p_step=1e-9)
    assert one.constant is constant


@pytest.mark.parametrize(
    ("sensor", "step", "by_a_sensor"), [(5.0, 4.0, True), (5.0, 6.0, False), (3.2, 3.0, False), (3.3, 3.0, True)]
)
def test_a_sensor_that_contradicts_the_others_and_explains_more_is_blamed_before_the_mass(sensor, step, by_a_sensor):
    one = replace(
        constancy_of_a_step(), ln_bayes_factor=5.0, normalised_drift=step, normalised_step=0.0, sensor_residual=sensor
    )
    assert one.by_a_sensor is by_a_sensor is one.constant
    assert ("a sensor that is off explains the shot better" in str(one)) is by_a_sensor


@pytest.mark.whole_way
@pytest.mark.parametrize("share", [1.0, drifting(-0.01), stepping(0.06, -0.01)], ids=["constant", "drift", "step"])
def test_the_bayes_factor_is_the_likelihood_of_a_change_integrated_over_its_size(share):
    """Rows are fitted anew for each size of a change; nothing of the score test is used."""
    calibration = calibrated(shot(3, share))
    r, one = calibration.block.regression, mass_constancy(calibration)
    assert one is not None

    def odds(shape: np.ndarray, sd: float) -> float:
        tried = sd * np.array([-3.0, -1.0, 0.0, 1.0, 3.0])
        misfits = [with_size(calibration, shape, size) - calibration.inferred.misfit for size in tried]
        parabola = np.polynomial.Polynomial.fit(tried, misfits, 4)
        sizes = np.linspace(-3.0 * sd, 3.0 * sd, 20_001)
        density = np.exp(-0.5 * parabola(sizes) - 0.5 * (sizes / sd) ** 2) / (sd * math.sqrt(2.0 * math.pi))
        return float(np.trapezoid(density, sizes))

    of_drift = odds(ramps(r.times_s, r.interval_s, 1), 0.03)
    of_steps = np.mean([odds(step[:, np.newaxis], 0.02) for step in steps_behind(r, instants(r)).T])
    assert one.ln_bayes_factor == pytest.approx(math.log(0.5 * (of_drift + of_steps)), abs=0.1)


def instants(regression: Regression) -> np.ndarray:
    onset_s, end_s = regression.interval_s
    return np.linspace(onset_s + 0.03 * (end_s - onset_s), end_s - 0.1 * (end_s - onset_s), 24)


def with_size(calibration: Calibration, shape: np.ndarray, size: float) -> float:
    """Return the misfit of the shot if the mass's logarithm changes by a size that is given."""
    changing = replace(calibration, block=replace(calibration.block, changes=shape))
    given = Prior.of("given", change(0).name, 0.0, size)
    unknowns = [*calibration.inferred.unknowns, change(0)]
    priors = [*calibration.common, *calibration.own, given]
    return solve(unknowns, [changing.rows, *calibration.further], priors, calibration.values).misfit


def test_what_would_have_been_found_is_larger_than_what_is_told_by_its_standard_uncertainty():
    calibration = calibrated(shot(2))
    r, one = calibration.block.regression, mass_constancy(calibration)
    assert one is not None
    drift, *steps = (
        calibration.with_changes(shape[:, np.newaxis]).inferred.u(change(0).name)
        for shape in np.hstack([ramps(r.times_s, r.interval_s, 1), steps_behind(r, instants(r))]).T
    )
    assert one.u_drift_rel == pytest.approx(drift, rel=0.02)
    # the odds have to reach 20 to 1 in nineteen of twenty
    assert 3.0 < one.found_drift_rel / drift < 8.0
    assert 3.0 < one.found_step_rel / float(np.median(steps)) < 8.0


def test_a_constant_mass_is_never_said_alone():
    one = mass_constancy(calibrated(shot(2)))
    assert one is not None
    assert one.constant
    drift, step = one.could_hide_percent["drift"], one.could_hide_percent["step"]
    said = str(one)
    assert said.startswith("No change of the mass can be told (ln of the Bayes factor")
    assert f"in 19 shots of 20 one of {drift:.2g} % over the travel or {step:.2g} % at once would be" in said
    assert said.endswith(f"if there are none, a constant mass has {probability_text(one.p_value)}.")


def told(**changed: object) -> str:
    figures: dict[str, object] = {
        "ln_bayes_factor": 12.3, "sensor_residual": 0.0,
        "onset_s": 1.0, "instant_s": 1.0604, "interval_s": (1.059, 1.061), "p_step": 1e-4, "p_drift": 0.5,
        "before_kg": 780.0, "u_before_kg": 5.0, "after_kg": 630.0, "u_after_kg": 4.0,
        "change_kg": -150.0, "u_change_kg": 3.0,
    }  # fmt: skip
    return str(replace(constancy_of_a_step(), **{**figures, **changed}))


def test_the_constancy_is_told_in_a_sentence():
    masses = "780.0 kg (u 5.0 kg) before, 630.0 kg (u 4.0 kg) after."
    odds = "ln of the Bayes factor +12.3, limit 3"
    assert told() == (
        f"Mass, friction or the breech chain changes in the shot ({odds}): as a mass a step of -150.0 kg (u 3.0 kg) "
        f"60.4 ms after the onset (95 %: 59.0 to 61.0 ms); {masses}"
    )
    assert told(kind="drift") == (
        f"Mass, friction or the breech chain changes in the shot ({odds}): as a mass a drift of -150.0 kg (u 3.0 kg) "
        f"over the travel; {masses}"
    )
    assert told(ln_bayes_factor=-0.5, p_step=0.1, found_drift_rel=0.016, found_step_rel=0.0082) == (
        "No change of the mass can be told (ln of the Bayes factor -0.5, limit 3): in 19 shots of 20 one of 1.6 % over "
        "the travel or 0.82 % at once would be, a smaller one may hide behind forces that no gauge reads; if there are "
        "none, a constant mass has p = 0.2."
    )


@pytest.mark.parametrize(("rows", "with_priors", "tells"), [(10, True, True), (10, False, False), (11, False, True)])
def test_three_rows_more_than_unknowns_without_a_prior_are_needed(rows, with_priors, tells):
    regression = shot(7)
    every = spaced_rows(regression)
    trusted = np.zeros(regression.times_s.size, dtype=bool)
    trusted[every[np.linspace(10, every.size - 20, rows).astype(int)]] = True
    calibration = calibrated(replace(regression, trusted=trusted))
    assert len(calibration.rows.unknowns) == 8
    if not with_priors:
        calibration = replace(calibration, common=(), own=())
    assert (mass_constancy(calibration) is not None) is tells


def test_too_few_rows_tell_nothing():
    regression = shot(7)
    few = spaced_rows(regression)[:10]
    trusted = np.zeros(regression.times_s.size, dtype=bool)
    trusted[few] = True
    unknown_zero = calibrated_mass(
        replace(regression, trusted=trusted), ScaleUncertainty(0.5, (0.5, 0.5, 0.5), 1e4), math.inf
    )
    assert mass_constancy(replace(unknown_zero, common=(), own=())) is None


def test_it_is_stated_at_the_ends_of_its_pieces_and_in_words_at_both_ends() -> None:
    found = mass_over_time(calibrated(shot(4, drifting(-0.03))))
    nodes = found.at_nodes
    step_s = found.times_s[1] - found.times_s[0]
    ends_s = np.linspace(found.times_s[0], found.times_s[-1], 13)
    np.testing.assert_allclose(nodes.times_s, ends_s, atol=0.51 * step_s)
    np.testing.assert_allclose(nodes.mass_kg, np.interp(nodes.times_s, found.times_s, found.mass_kg), rtol=1e-12)
    first, last = (f"{nodes.mass_kg[at]:.{d}f} kg (u {nodes.u_kg[at]:.{d}f} kg)" for at, d in ((0, 1), (-1, 0)))
    length_ms = round(1000 * (found.times_s[-1] - found.times_s[0]))
    assert str(found) == f"{first} at the onset, {last} {length_ms} ms later, a random walk between"


def test_a_step_is_sharp_in_recorded_signals_and_half_way_up_at_its_instant_behind_a_filter():
    found = identified()
    times_s, filtered = found.route.recorded.times_s, found.route.filtered
    at = int(np.searchsorted(times_s, found.route.recorded.interval_s[0] + 0.1))
    (sharp,) = steps_behind(found.route.recorded, times_s[[at]]).T
    np.testing.assert_array_equal(sharp, np.arange(times_s.size) >= at)
    (smooth,) = steps_behind(filtered, times_s[[at]]).T
    reach = filtered.low_pass.reach_samples(filtered.rate_hz)
    assert smooth[at] == pytest.approx(0.5, abs=1e-6)
    assert np.abs(smooth[: at - reach]).max() < 0.02
    assert np.abs(smooth[at + reach :] - 1.0).max() < 0.02
    np.testing.assert_allclose(
        smooth, filtered.low_pass.apply(0.5 * (1 + np.sign(times_s - times_s[at])), filtered.rate_hz), atol=1e-6
    )
