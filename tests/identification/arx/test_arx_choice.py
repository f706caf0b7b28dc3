from __future__ import annotations

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.arx.choice import ArxChoice, choose_model, count_of_lags
from recoil_identification.arx.decimated_record import DecimatedRecord
from recoil_identification.arx.mass import GainMass, mass_of_gain, refitted
from recoil_identification.arx.model import ArxOrders
from recoil_identification.arx.orders import order_grid
from recoil_identification.arx.verdict import notes_on_model, reasons_against_model
from tests.builders.arx_systems import PULSE_MASS_KG as MASS_KG
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
    return tuple(
        mass_of_gain(model, choice.record, (), 0.003) for model in (choice.model, refitted(choice.record, ArxOrders()))
    )


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
    [(0.01, 99.0, "errors in variables"), (np.nan, 99.0, "silence"), (1e-6, 60.0, "60 %"), (1e-6, np.nan, "nan %")],
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


def test_there_must_be_a_band():
    with pytest.raises(ValueError, match="no band"):
        choose_model(lambda share: record(share=share), (), GRID)


def test_a_test_looks_at_fewer_lags_of_a_short_record_but_at_more_than_na():
    assert count_of_lags(200, 2) == 20
    assert count_of_lags(40, 2) == 10
    assert count_of_lags(40, 12) == 13


def test_residuals_too_few_to_be_tested_are_refused():
    one = record()
    few = DecimatedRecord(
        one.times_s, one.force_n, one.acceleration_m_s2, np.isin(np.arange(250), [25, 30, 35]), 1e-3, 20, one.low_pass
    )
    with pytest.raises(IdentificationError, match="cannot be tested"):
        choose_model(lambda _: few, (1.0,), [ArxOrders(1, 0)])
