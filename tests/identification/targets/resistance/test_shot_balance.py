from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.targets.resistance.shot_balance import (
    BalancePoint,
    Conserved,
    Terms,
    Until,
    energy_balance,
    momentum_balance,
)
from recoil_processing.double_integral import integrate

STEP = 1e-5


def closed(mass: float = 800.0, slope: float = 2.0) -> Terms:
    """Newton's law holds at every sample."""
    times = np.arange(0.0, 0.1, STEP)
    breech = 1e6 * np.exp(-times / 5e-3) * (times > 0)
    brake, friction = -30e3 * np.ones_like(times), -1500.0 * np.ones_like(times)
    carried = np.full(times.size, slope)
    velocity = integrate((breech + brake + friction) / mass - carried, STEP)
    return Terms(
        step_s=STEP,
        forces_n={"breech": breech, "brake": brake, "friction": friction},
        carried_m_s2=carried,
        velocity_m_s=velocity,
        u_velocity_m_s=np.full(times.size, 1e-3),
        mass_kg=mass,
        force_errors_n={"breech gauge": 0.005 * breech, "brake gauge": 0.004 * brake},
        noise_n=0.0,
        u_mass_kg=0.0,
        u_velocity_scale=0.001,
        u_clock_s=0.0,
    )


@settings(max_examples=25)
@given(st.floats(100.0, 5000.0), st.floats(-5.0, 5.0))
def test_balances_close_where_newtons_law_holds(mass, slope):
    terms = closed(mass, slope)
    energy, momentum = energy_balance(terms), momentum_balance(terms)
    assert np.max(np.abs(momentum.left)) < 1e-9 * np.max(np.abs(momentum.parts["breech"]))
    assert np.max(np.abs(energy.left)) < 1e-4 * np.max(np.abs(energy.parts["breech"]))


@pytest.mark.parametrize("balance", [energy_balance, momentum_balance])
def test_what_one_cause_leaves_is_what_the_balance_says_of_it(balance):
    terms = closed()
    off = replace(terms, forces_n={**terms.forces_n, "breech": 1.005 * terms.forces_n["breech"]})
    change = balance(off).left - balance(terms).left
    np.testing.assert_allclose(change, balance(terms).errors["breech gauge"], atol=1e-9)
    heavier = balance(replace(terms, mass_kg=terms.mass_kg + 8.0)).left - balance(terms).left
    np.testing.assert_allclose(heavier, balance(replace(terms, u_mass_kg=8.0)).errors["mass"], rtol=1e-9, atol=1e-9)
    faster = balance(replace(terms, velocity_m_s=1.001 * terms.velocity_m_s)).left - balance(terms).left
    np.testing.assert_allclose(faster, balance(terms).errors["scale of the velocity"], rtol=2e-3, atol=0.05)


def test_a_gauge_that_is_far_off_violates_both_balances():
    terms = closed()
    off = replace(terms, forces_n={**terms.forces_n, "breech": 1.1 * terms.forces_n["breech"]})
    for balance in (energy_balance, momentum_balance):
        right, wrong = (balance(one).at(-1, Until.END) for one in (terms, off))
        assert right.verdict == "closed"
        assert right.ratio < 1
        assert wrong.violated
        assert wrong.verdict == "violated"


def test_the_verdict_between_tolerance_and_violation_is_doubt():
    point = BalancePoint(Conserved.ENERGY, "J", Until.END, 2.5, 1.0, 100.0)
    assert point.ratio == pytest.approx(2.5 / 1.96, rel=1e-3)
    assert not point.violated
    assert "once in twenty" in point.verdict
    assert BalancePoint(Conserved.ENERGY, "J", Until.END, 1.0, 0.0, 1.0).ratio == np.inf
