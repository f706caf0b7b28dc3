"""Two real records with a known mass, end to end: files to a report; the numbers of docs/validation.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from recoil_identification.shot.identified import Identification
from recoil_rigs.rig import parse_rig
from tests.builders.line_shots import identified
from tests.builders.real_records import EMPS_KG, ROCKET_KG, Carriage, Rocket, emps_rig, rocket_rig, write_carriage

ALL = ("driving_force", "recoil_acceleration", "recoil_velocity", "recoil_displacement")
LARGEST_U = 0.025
"""Largest relative standard uncertainty with which a stroke is worth anything."""


@dataclass(frozen=True)
class Found:
    """Mass of one part of a record, and what plain least squares makes of the same samples, kg."""

    identification: Identification
    plain_kg: float

    @property
    def error_rel(self) -> float:
        """Relative deviation from the published mass."""
        return self.identification.chosen.estimate.mass_kg / EMPS_KG - 1.0


def carriage(part: Carriage, roles: Sequence[str], folder: Path) -> Found:
    rig = parse_rig(emps_rig(*roles), folder / "rig.toml")
    file = write_carriage(part, roles, folder / "0001_daq.csv")
    return Found(identified(rig, [file], folder / "shots"), float(part.least_squares(40.0)[0]))


def assert_holds(found: Found) -> None:
    e = found.identification.chosen.estimate
    low, high = e.interval_kg
    assert low <= EMPS_KG <= high, e
    assert e.u_kg <= LARGEST_U * e.mass_kg
    assert found.identification.valid, found.identification.reasons


@pytest.mark.parametrize("number", range(4))
def test_a_stroke_of_the_carriage_without_a_rest_holds_the_published_mass(number: int, tmp_path: Path) -> None:
    strokes = Carriage.read().strokes()
    assert len(strokes) == 4
    assert_holds(carriage(strokes[number], ALL, tmp_path))


def test_the_whole_record_of_the_carriage_holds_the_published_mass(tmp_path: Path) -> None:
    assert_holds(carriage(Carriage.read(), ALL, tmp_path))


@pytest.mark.parametrize("roles", [("driving_force", "recoil_displacement")])
def test_the_carriage_s_travel_alone_holds_the_mass_or_is_refused(roles: tuple[str, ...], tmp_path: Path) -> None:
    found = carriage(Carriage.read().strokes()[0], roles, tmp_path).identification
    low, high = found.chosen.estimate.interval_kg
    assert low <= EMPS_KG <= high or not found.valid


def test_the_rocket_s_ascent_is_held_or_refused_for_what_it_is(tmp_path: Path) -> None:
    rig = parse_rig(rocket_rig(), tmp_path / "rig.toml")
    rocket = Rocket.read()
    found = identified(rig, [rocket.write(tmp_path / "0001_daq.csv")], tmp_path / "shots")
    low, high = found.chosen.estimate.interval_kg
    mean_kg = float(np.mean(ROCKET_KG))
    assert low <= mean_kg <= high or not found.valid
