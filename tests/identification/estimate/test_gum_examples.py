"""Worked examples of the GUM, JCGM 100:2008, annex H, through the budget and the inference, beside GTC."""

from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_identification.estimate.budget import (
    BudgetRow,
    combined_u,
    coverage_factor,
    effective_degrees_of_freedom,
)
from recoil_identification.estimate.reliability import known_to
from recoil_identification.inference.block import LinearBlock
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown

gtc = pytest.importorskip("GTC", reason="GTC, the oracle of the budget, is not installed")


def test_h1_an_end_gauge_has_the_uncertainty_and_the_degrees_of_freedom_of_the_guide() -> None:
    # H.1.4 to H.1.6, nm; what is known to 10 % and to 50 % has 50 and 2 degrees of freedom by G.4.2
    parts = [(25.0, 18.0), (5.8, 24.0), (3.9, 5.0), (6.7, 8.0), (2.9, known_to(0.1)), (16.6, known_to(0.5))]
    assert (parts[4][1], parts[5][1]) == (pytest.approx(50.0), 2.0)
    rows = [BudgetRow(f"{k}", u, "B", degrees_of_freedom=nu) for k, (u, nu) in enumerate(parts)]
    assert round(combined_u(rows)) == 32
    assert effective_degrees_of_freedom(rows) == pytest.approx(16.7, abs=0.3)
    total = sum(gtc.ureal(0.0, u, nu) for u, nu in parts)
    assert combined_u(rows) == pytest.approx(gtc.uncertainty(total), rel=1e-12)
    assert effective_degrees_of_freedom(rows) == pytest.approx(gtc.dof(total), rel=1e-9)
    assert coverage_factor(gtc.dof(total)) == pytest.approx(gtc.rp.k_factor(gtc.dof(total), 95), rel=1e-6)


def test_h2_resistance_and_reactance_have_the_uncertainties_and_correlations_of_the_guide() -> None:
    # table H.2: V, A and rad of five simultaneous observations
    seen = np.array([
        [5.007, 19.663e-3, 1.0456], [4.994, 19.639e-3, 1.0438], [5.005, 19.640e-3, 1.0468], [4.990, 19.685e-3, 1.0428],
        [4.999, 19.678e-3, 1.0433],
    ])  # fmt: skip
    means, covariance = seen.mean(axis=0), np.cov(seen.T) / len(seen)
    u = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(u, u)
    assert correlation[np.triu_indices(3, 1)] == pytest.approx([-0.36, 0.86, -0.65], abs=5e-3)
    volts, amperes, phi = means
    impedance = volts / amperes
    jacobian = np.array([
        [math.cos(phi) / amperes, -impedance * math.cos(phi) / amperes, -impedance * math.sin(phi)],
        [math.sin(phi) / amperes, -impedance * math.sin(phi) / amperes, impedance * math.cos(phi)],
        [1.0 / amperes, -impedance / amperes, 0.0],
    ])  # fmt: skip
    inputs, outputs = ("V", "I", "phi"), ("R", "X", "Z")
    known = Prior(inputs, inputs, np.eye(3), np.zeros(3), covariance)
    definition = LinearBlock((*outputs, *inputs), np.hstack([np.eye(3), -jacobian]), np.zeros(3), 1e-9)
    found = solve([Unknown(name) for name in (*outputs, *inputs)], [definition], [known])
    assert [found.u(name) for name in outputs] == pytest.approx([0.071, 0.295, 0.236], abs=6e-4)
    at = found.covariance[:3, :3] / np.outer(*[np.sqrt(np.diag(found.covariance)[:3])] * 2)
    assert (at[0, 1], at[0, 2], at[1, 2]) == pytest.approx((-0.588, -0.485, 0.993), abs=5e-3)
    for name, row in zip(outputs, found.contributions[:3], strict=True):
        budget = [BudgetRow(f"{k}", abs(u_i), "A") for k, u_i in enumerate(row.tolist())]
        assert combined_u(budget) == pytest.approx(found.u(name), rel=1e-6)
    v, i, p = gtc.multiple_ureal(means.tolist(), u.tolist(), len(seen) - 1)
    for one, other, r in zip((v, v, i), (i, p, p), correlation[np.triu_indices(3, 1)].tolist(), strict=True):
        gtc.set_correlation(r, one, other)
    theirs = (v / i * gtc.cos(p), v / i * gtc.sin(p), v / i)
    assert [found.u(name) for name in outputs] == pytest.approx([gtc.uncertainty(y) for y in theirs], rel=1e-6)
    assert at[0, 1] == pytest.approx(gtc.get_correlation(theirs[0], theirs[1]), rel=1e-6)


def test_h3_a_thermometers_line_predicts_its_correction_as_in_the_guide() -> None:
    # table H.6: readings in degrees Celsius and observed corrections
    readings = np.array([21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511])
    corrections = -1e-3 * np.array([171.0, 169.0, 166.0, 159.0, 164.0, 165.0, 156.0, 157.0, 159.0, 161.0, 160.0])
    columns = np.column_stack([np.ones(11), readings - 20.0])
    names = ("y1", "y2")
    unknowns, free = [Unknown(name) for name in names], len(readings) - 2
    misfit = solve(unknowns, [LinearBlock(names, columns, corrections, 1.0)], []).misfit
    deviation = math.sqrt(misfit / free)
    found = solve(unknowns, [LinearBlock(names, columns, corrections, deviation)], [])
    assert (found.value("y1"), found.u("y1")) == (pytest.approx(-0.1712, abs=5e-5), pytest.approx(0.0029, abs=5e-5))
    assert (found.value("y2"), found.u("y2")) == (pytest.approx(0.00218, abs=5e-6), pytest.approx(0.00067, abs=5e-6))
    r = found.covariance[0, 1] / (found.u("y1") * found.u("y2"))
    assert (deviation, r) == (pytest.approx(0.0035, abs=5e-5), pytest.approx(-0.930, abs=5e-4))
    at_30 = np.array([1.0, 10.0])
    row = BudgetRow("line", math.sqrt(at_30 @ found.covariance @ at_30), "A", degrees_of_freedom=free)
    assert (at_30 @ found.values, combined_u([row])) == (
        pytest.approx(-0.1494, abs=5e-5),
        pytest.approx(4.1e-3, abs=5e-5),
    )
    assert coverage_factor(effective_degrees_of_freedom([row])) == pytest.approx(2.262, abs=5e-4)  # table G.2
    line = gtc.type_a.line_fit(readings - 20.0, corrections)
    theirs = line.intercept + 10.0 * line.slope
    assert combined_u([row]) == pytest.approx(gtc.uncertainty(theirs), rel=1e-9)
    assert effective_degrees_of_freedom([row]) == pytest.approx(gtc.dof(theirs), rel=1e-9)
