"""A mechanism of a third kind is a class that answers: nothing on the way to its mass asks which kind it is."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.mechanism.line import Line
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.channel_table import ChannelSpec
from recoil_rigs.tables.force_input import ForceInput
from tests.builders.line_motions import LineBody

STIFFNESS_N_M = 3000.0
BODY = LineBody()


@dataclass(frozen=True)
class Sprung(Line):
    """A body that a spring pulls to where it rests, whose force no cell reads: its displacement tells it, N/m."""

    stiffness: float = 0.0

    def forces(self, channels: Sequence[ChannelSpec]) -> tuple[ForceInput, ...]:
        place = tuple(one for one in channels if one.role == "recoil_displacement")
        return (*super().forces(channels), ForceInput("spring", "recoil_displacement", -1.0, self.stiffness, place))


def on_a_spring(fired: FiredShot) -> FiredShot:
    plain = {one.name: getattr(fired.rig.mechanism, one.name) for one in dataclasses.fields(fired.rig.mechanism)}
    return FiredShot(fired.shot, dataclasses.replace(fired.rig, mechanism=Sprung(**plain, stiffness=STIFFNESS_N_M)))


@pytest.mark.indispensable("a third model")
def test_the_mass_of_a_body_on_a_spring_is_found_by_a_class_of_its_own() -> None:
    read = BODY.readings()
    read["driving_force"] = read["driving_force"] + STIFFNESS_N_M * read["recoil_displacement"]
    plain = BODY.fired("driving_force", "resisting_force", "recoil_acceleration", "recoil_displacement", readings=read)
    found = identify_shot(on_a_spring(plain), Options(cutoff_hz=20.0))
    mass = found.chosen.estimate
    assert found.valid, found.reasons
    assert abs(mass.mass_kg - BODY.mass_kg) < 2.0 * mass.u_kg < 0.03 * BODY.mass_kg
    assert any(str(row.source).startswith("spring") for row in mass.budget)
    # without the spring the same record tells of no mass
    with pytest.raises(IdentificationError, match="no positive mass"):
        identify_shot(plain, Options(cutoff_hz=20.0))
