"""Reasons against an ARX model from force to acceleration, and notes for its reader."""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.estimate.rounding import plain
from recoil_identification.targets.arx.choice import ArxChoice
from recoil_identification.targets.arx.mass import GainMass
from recoil_identification.targets.arx.model import ArxOrders
from recoil_identification.targets.arx.residual_tests import LEVEL, ResidualTest
from recoil_identification.targets.arx.response import poles

LEAST_FIT = 80.0
"""Per cent below which the simulated acceleration is not that of the recoiling part."""
LARGEST_ATTENUATION = 1.0 / 3.0
"""Share of the mass's standard uncertainty that the noise of the force may bias it by."""
LARGEST_CHANGE = 2.0
"""Standard uncertainties by the residuals that past samples may change the mass by; beyond that is a note."""


def reasons_against_model(
    choice: ArxChoice, mass: GainMass, static: GainMass, attenuation: float, fit: float
) -> tuple[Reason, ...]:
    """Say what speaks against the result.

    Parameters
    ----------
    mass, static
        Masses of the model, and of na = nb = d = 0.
    attenuation
        Share of the force's energy that is noise; NaN where it is not known.
    fit
        Fit of the simulation, %.

    Returns
    -------
    tuple of Reason
        One sentence each, with its limit; empty if nothing does.
    """
    reasons = []
    found = poles(choice.model)
    if not found.stable:
        worst = float(np.abs(found.values).max())
        text = f"the model is unstable: a pole at {worst:.4f} from the origin, limit 1; its gain has no meaning"
        reasons.append(Reason(ReasonCode.IMPLAUSIBLE, "poles", text))
    if not fit >= LEAST_FIT:
        text = (
            f"the force explains {fit:.3g} % of the acceleration in simulation, limit {LEAST_FIT:g} %: check that "
            "signals and units belong together"
        )
        reasons.append(Reason(ReasonCode.MODEL, "simulation", text))
    if not choice.white.passed:
        text = (
            f"residuals are not white in any band that was tried ({_test_text(choice.white)}): the standard errors of "
            "the coefficients and the bands of the responses are those of errors that these are not"
        )
        reasons.append(Reason(ReasonCode.RESIDUAL, "whiteness", text))
    if not choice.independent.passed:
        text = (
            f"residuals still follow the force ({_test_text(choice.independent)}): something acts on force or "
            "acceleration that no model of these orders describes"
        )
        reasons.append(Reason(ReasonCode.RESIDUAL, "independence", text))
    bias, limit = attenuation * mass.mass_kg, LARGEST_ATTENUATION * mass.u_kg
    if math.isnan(bias):
        text = "no pre-trigger baseline: the noise of the force, which biases the gain, is not known"
        reasons.append(Reason(ReasonCode.BASELINE, "force", text))
    elif abs(bias) > limit:
        text = (
            f"noise of the pressures is {attenuation:.1e} of the force's energy: the mass comes out high by "
            f"{bias:.2g} kg (errors in variables), limit {limit:.2g} kg"
        )
        reasons.append(Reason(ReasonCode.NOISE, "force", text))
    apart = abs(mass.mass_kg - static.mass_kg)
    if apart > COVERAGE_FACTOR * mass.u_kg:
        text = (
            f"past samples change the mass by {apart:.2g} kg, more than its interval: what relates force and "
            "acceleration is no rigid mass alone"
        )
        reasons.append(Reason(ReasonCode.AGREEMENT, "m_dc", text))
    return tuple(reasons)


def notes_on_model(choice: ArxChoice, mass: GainMass, static: GainMass) -> tuple[Note, ...]:
    """Say what a reader should know although it does not make the result invalid.

    Parameters
    ----------
    mass, static
        Masses of the model, and of na = nb = d = 0.
    """
    notes = []
    best, orders = choice.table.ranked[0][0].orders, choice.model.orders
    if orders != best:
        text = (
            f"the least BIC is that of {best}, which is unstable or leaves residuals that are not white; the next one "
            "that does neither was taken"
        )
        notes.append(Note(NoteCode.MODEL, "orders", text))
    if choice.share < 1.0 and choice.record.low_pass is not None:
        text = (
            f"the band was narrowed to {choice.record.low_pass.cutoff_hz:.0f} Hz, {100 * choice.share:.0f} % of the "
            "shot's cut-off: above it stress waves leak into the residuals"
        )
        notes.append(Note(NoteCode.FILTER, None, text))
    if orders != ArxOrders() and abs(mass.mass_kg - static.mass_kg) > LARGEST_CHANGE * mass.u_random_kg:
        text = f"without past samples (na = nb = d = 0) the mass is {plain(static.mass_kg)} kg"
        notes.append(Note(NoteCode.COMPARISON, "m_dc", text))
    return tuple(notes)


def _test_text(test: ResidualTest) -> str:
    lags = ", ".join(str(lag) for lag in test.outside) or "none alone"
    return f"p = {test.p_value:.1e}, limit {1.0 - LEVEL:.2g}; lags outside their bands: {lags}"
