"""Every row of a camera's budget beside what moving its source by its uncertainty and estimating anew gives.

Rows of the accelerometer's budget are compared in tests/identification/test_causes.py.
"""

from __future__ import annotations

import pytest

from tests.identification.test_methods import RIGS, calibration_of, moves_of, row_and_refit_kg


@pytest.mark.parametrize("name", RIGS)
def test_rows_against_refits(capsys, name):
    estimate = calibration_of(name).estimate
    found = {source: row_and_refit_kg(name, source) for source in moves_of(name)}
    with capsys.disabled():
        print(f"\n{name}, by the camera: {estimate.mass_kg:.2f} kg, u {estimate.u_kg:.3f} kg")
        print(f"{'source':50} {'row, kg':>9} {'refit, kg':>10} {'apart, u':>9}")
        for source, (row, refit) in found.items():
            print(f"{source:50} {row:+9.4f} {refit:+10.4f} {abs(row - refit) / estimate.u_kg:9.4f}")
    assert all(abs(row - refit) < 0.02 * estimate.u_kg for row, refit in found.values())
