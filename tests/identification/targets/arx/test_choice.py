from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import IdentificationError
from recoil_identification.targets.arx.choice import ArxChoice, choose_model, compare_orders, order_grid
from recoil_identification.targets.arx.decimated_record import DecimatedRecord
from recoil_identification.targets.arx.mass import GainMass, mass_of_gain
from recoil_identification.targets.arx.model import ArxOrders, estimate_arx
from recoil_identification.targets.arx.verdict import notes_on_model, reasons_against_model
from tests.builders.arx_systems import PULSE_MASS_KG as MASS_KG
from tests.builders.arx_systems import arx_record
from tests.builders.arx_systems import pulse_record as record

GRID = order_grid(range(3), range(3), (0, 1))


def test_the_widest_band_is_kept_where_its_residuals_pass():
    choice = choose_model(lambda share: record(share=share), (1.0, 0.7), GRID)
    assert choice.share == 1.0
    assert choice.passed
    assert choice.model.orders == ArxOrders()
    assert reasons_against_model(choice, *masses(choice), 1e-6, 99.0) == ()
    assert notes_on_model(choice, *masses(choice)) == ()


def masses(choice: ArxChoice) -> tuple[GainMass, GainMass]:
    return tuple(mass_of_gain(choice.record, orders, (), 0.003) for orders in (choice.model.orders, ArxOrders()))


def with_leak(share: float) -> DecimatedRecord:
    """Stress waves of much the same size at every knock, in the wide band only."""
    one = record(2, share=share)
    if share < 1.0:
        return one
    rng, t = np.random.default_rng(3), one.times_s
    waves = sum(
        60.0 * np.exp(-(np.maximum(t - t0, 0)) / 0.02) * (t >= t0) * np.sin(rng.uniform(1.4, 2.6) * (t - t0) / 1e-3)
        for t0 in rng.uniform(0.02, 0.2, 12)
    )
    return DecimatedRecord(t, one.force_n, one.acceleration_m_s2 + waves, one.rows, 1e-3, 20, one.low_pass)


def test_the_band_is_narrowed_where_stress_waves_colour_the_residuals():
    choice = choose_model(with_leak, (1.0, 0.7, 0.5), GRID)
    assert choice.share == 0.7
    assert choice.passed
    (note,) = notes_on_model(choice, *masses(choice))
    assert "narrowed to 280 Hz" in note


def test_residuals_that_stay_coloured_are_a_reason():
    choice = choose_model(lambda _: with_leak(1.0), (1.0, 0.7), GRID)
    assert not choice.passed
    assert choice.share == 0.7
    reasons = reasons_against_model(choice, *masses(choice), 1e-6, 99.0)
    assert any("not white" in reason for reason in reasons)


def test_a_lag_that_the_orders_do_not_have_is_a_reason():
    choice = choose_model(lambda share: record(lag=0.05, share=share), (1.0,), [ArxOrders()])
    reasons = reasons_against_model(choice, *masses(choice), 1e-6, 99.0)
    assert any("follow the force" in reason for reason in reasons)


def test_past_samples_that_change_the_mass_are_a_note_and_beyond_its_interval_a_reason():
    choice = choose_model(lambda share: record(lag=0.2, share=share), (1.0,), [ArxOrders(0, 1)])
    mass, static = masses(choice)
    assert mass.mass_kg == pytest.approx(MASS_KG / 1.2, rel=0.01)
    little = GainMass(mass.mass_kg + 3.0 * mass.u_random_kg, 0.3, 0.0, static.u_other_kg)
    assert reasons_against_model(choice, mass, little, 1e-6, 99.0) == ()
    (note,) = notes_on_model(choice, mass, little)
    assert "without past samples" in note
    much = GainMass(mass.mass_kg + 2.0 * mass.u_kg, 0.3, 0.0, static.u_other_kg)
    (reason,) = reasons_against_model(choice, mass, much, 1e-6, 99.0)
    assert "no rigid mass alone" in reason


@pytest.mark.parametrize(
    ("attenuation", "fit", "word"),
    [(0.01, 99.0, "errors in variables"), (np.nan, 99.0, "baseline"), (1e-6, 60.0, "60 %"), (1e-6, np.nan, "nan %")],
)
def test_what_biases_the_gain_is_a_reason(attenuation, fit, word):
    choice = choose_model(lambda share: record(share=share), (1.0,), GRID)
    (reason,) = reasons_against_model(choice, *masses(choice), attenuation, fit)
    assert word in reason


def test_an_unstable_model_is_a_reason_and_is_passed_over_where_it_can_be():
    one = record()
    growing = 1.03 ** np.arange(250.0)
    unstable = DecimatedRecord(one.times_s, one.force_n, growing, one.rows, 1e-3, 20, one.low_pass)
    choice = choose_model(lambda _: unstable, (1.0,), [ArxOrders(1, 0)])
    reasons = reasons_against_model(choice, *masses(choice), 1e-6, 99.0)
    assert any("unstable" in reason for reason in reasons)


def test_residuals_too_few_to_be_tested_are_refused():
    one = record()
    few = DecimatedRecord(
        one.times_s, one.force_n, one.acceleration_m_s2, np.isin(np.arange(250), [25, 30, 35]), 1e-3, 20, one.low_pass
    )
    with pytest.raises(IdentificationError, match="cannot be tested"):
        choose_model(lambda _: few, (1.0,), [ArxOrders(1, 0)])


# ---------------------------------------------------------------------------------------------- orders

WIDE = order_grid(range(4), range(3), range(4))


def of_system(n_samples: int, seed: int, **system: object) -> DecimatedRecord:
    """Take a record of a known system as force and acceleration, all rows of the interval."""
    u, y = arx_record(n_samples, seed, **system)
    return DecimatedRecord(np.arange(n_samples) * 0.01, u, y, np.ones(n_samples, dtype=bool), 0.01, 1, None)


@pytest.mark.whole_way
def test_the_orders_and_the_delay_of_a_known_system_are_recovered():
    found = [compare_orders(of_system(400, 50 + seed, noise=0.3), WIDE).ranked[0][0].orders for seed in range(20)]
    assert found.count(ArxOrders(2, 1, 1)) >= 16


@settings(max_examples=20)
@given(st.integers(0, 5), st.integers(0, 2**31))
def test_a_delay_is_recovered(delay, seed):
    table = compare_orders(of_system(300, seed, system=((-0.6,), (1.0,), delay)), order_grid([1], [0], range(6)))
    assert table.ranked[0][0].orders.delay == delay


def test_every_candidate_is_fitted_to_the_rows_that_the_largest_can_use():
    one = of_system(200, 1)
    u, y = one.force_n.copy(), one.acceleration_m_s2.copy()
    u[50], y[120] = np.nan, np.nan
    table = compare_orders(replace(one, force_n=u, acceleration_m_s2=y), WIDE)
    # the largest candidate needs y to k - 3 and u to k - 5
    expected = np.arange(200) >= 5
    expected[50:56] = False
    expected[120:124] = False
    np.testing.assert_array_equal(table.rows, expected)
    assert {model.n_rows for model, _ in table.ranked} == {int(expected.sum())}
    model = next(model for model, _ in table.ranked if model.orders == ArxOrders(2, 1, 1))
    alone = estimate_arx(u, y, ArxOrders(2, 1, 1), step_s=0.01, rows=expected)
    np.testing.assert_array_equal(model.parameters, alone.parameters)


def test_the_ranking_ascends_and_near_models_are_within_the_margin():
    table = compare_orders(of_system(300, 3), WIDE)
    scores = [model.bic for model, _ in table.ranked]
    assert scores == sorted(scores)
    assert len(table.near(4.0)) == sum(score <= scores[0] + 4.0 for score in scores) > 0


def test_a_model_that_is_too_small_leaves_residuals_that_are_not_white():
    table = compare_orders(of_system(400, 6), [ArxOrders(0, 0, 1), ArxOrders(2, 1, 1)])
    small, large = table.candidates
    assert small.white.p_value < 1e-6
    assert large.white.p_value > 0.01


def test_a_candidate_that_cannot_be_estimated_stays_in_the_table_with_its_reason():
    one = replace(of_system(60, 1), force_n=np.ones(60))
    table = compare_orders(one, [ArxOrders(0, 0, 0), ArxOrders(0, 1, 0)])
    assert table.candidates[1].model is None
    assert "told apart" in table.candidates[1].refusal
    assert [model.orders for model, _ in table.ranked] == [ArxOrders()]


def test_a_record_that_no_candidate_fits_is_refused_with_the_cause():
    with pytest.raises(IdentificationError, match="no model of any order"):
        compare_orders(replace(of_system(40, 1), force_n=np.zeros(40)), WIDE)


def test_a_perfect_fit_has_no_whiteness_but_wins():
    one = of_system(60, 1)
    table = compare_orders(replace(one, acceleration_m_s2=0.5 * one.force_n), [ArxOrders(0, 1), ArxOrders()])
    assert table.ranked[0][0].b[0] == pytest.approx(0.5)
