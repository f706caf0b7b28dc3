"""What the forces should move: m3 of the rig file, oil and rods beside it, and what the shot log added."""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType

import pytest

from recoil_rigs.rig import Rig, load_rig
from recoil_rigs.tables.specification import Specification, mass_decimals


def rig(**u: float) -> Rig:
    bare = load_rig("field-2013")
    return replace(bare, mechanism=replace(bare.mechanism, carried_mass=6.0, u=MappingProxyType(u)))


def test_it_is_the_sum_of_what_rig_file_and_shot_log_state() -> None:
    found = rig(m3=1.2, carried_mass=0.9).with_added_mass(120.0, 0.3).specification
    assert (found.m3_kg, found.added_kg, found.carried_kg) == (782.0, 120.0, 6.0)
    assert (found.u_m3_kg, found.u_added_kg, found.u_carried_kg) == (pytest.approx(1.2), 0.3, 0.9)
    assert found.mass_kg == 908.0
    assert found.u_kg == pytest.approx(math.sqrt(1.2**2 + 0.3**2 + 0.9**2))
    # what nothing states is exact
    assert rig().with_added_mass(120.0, None).specification == Specification(782.0, added_kg=120.0, carried_kg=6.0)
    assert rig().specification == Specification(782.0, carried_kg=6.0)


def test_e_n_is_the_deviation_over_twice_the_root_of_the_squares() -> None:
    found = Specification(782.0, 0.0, 120.0, 0.3, 6.0, 0.4)
    assert found.normalised_error(913.0, 1.2) == pytest.approx(5.0 / (2 * math.sqrt(1.2**2 + 0.3**2 + 0.4**2)))
    assert math.isnan(Specification(782.0).normalised_error(783.0, 0.0))


@pytest.mark.parametrize(
    ("u_kg", "decimals"), [(4.2, 2), (0.05, 3), (0.0996, 2), (2e-5, 6), (0.0, 2), (None, 2), (math.nan, 2), (90.0, 2)]
)
def test_a_mass_has_the_decimals_of_its_uncertainty_and_never_less_than_a_gun_s(u_kg, decimals) -> None:
    assert mass_decimals(u_kg) == decimals
