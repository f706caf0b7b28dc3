"""Every row of a budget beside what moving its source by its uncertainty and estimating anew gives."""

from __future__ import annotations

import pytest

from tests.builders.virtual_shots import identified
from tests.identification.calibration import test_methods
from tests.identification.rows import test_causes


def printed(capsys, title, estimate, found):
    """Print rows beside refits; refuse what is apart by more than 0.02 of the mass's uncertainty."""
    with capsys.disabled():
        print(f"\n{title}: {estimate.mass_kg:.2f} kg, u {estimate.u_kg:.3f} kg")
        print(f"{'source':50} {'row, kg':>9} {'refit, kg':>10} {'apart, u':>9}")
        for source, (row, refit) in found.items():
            print(f"{source:50} {row:+9.4f} {refit:+10.4f} {abs(row - refit) / estimate.u_kg:9.4f}")
        without = [row.source for row in estimate.budget if row.source not in found and row.u_kg > 0.02 * estimate.u_kg]
        print("not moved, and more than 0.02 u:", ", ".join(without) or "none")
    assert all(abs(row - refit) < 0.02 * estimate.u_kg for row, refit in found.values())


@pytest.mark.parametrize("name", test_methods.RIGS)
def test_rows_of_the_camera_against_refits(capsys, name):
    found = {source: test_methods.row_and_refit_kg(name, source) for source in test_methods.moves_of(name)}
    printed(capsys, f"{name}, by the camera", test_methods.calibration_of(name).estimate, found)


@pytest.mark.parametrize("name", test_causes.RIGS)
def test_rows_of_the_accelerometer_against_refits(capsys, name):
    found = test_causes.rows_and_refits_kg(name) | test_causes.rows_and_refits_of_frames_kg(name)
    estimate = identified(name, u_zero_rel=test_causes.MOVING).route.calibration.estimate
    printed(capsys, f"{name}, by the accelerometer", estimate, found)
