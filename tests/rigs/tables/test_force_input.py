"""The measured forces of a gun and of a body on a line, in the order of every table of forces."""

from __future__ import annotations

import pytest

from recoil_rigs.rig import load_rig
from recoil_rigs.tables.rig_tables import GAUGE_ROLES
from tests.builders.line_rigs import line_rig


def test_a_gun_has_breech_brake_and_recuperator_with_their_areas() -> None:
    rig = load_rig("field-2013")
    assert tuple(force.name for force in rig.forces) == GAUGE_ROLES
    assert [force.sign for force in rig.forces] == [1.0, -1.0, -1.0]
    assert tuple(force.per_reading for force in rig.forces) == rig.mechanism.force_areas
    assert [force.unit for force in rig.forces] == ["Pa", "Pa", "Pa"]


def test_a_line_has_a_force_for_each_channel_that_reads_one_and_for_each_pressure() -> None:
    roles = ("resisting_force", "driving_force", "driving_force", "brake_pressure")
    rig = line_rig(*roles, brake_area=0.002, u_brake_area=0.0)
    assert [force.name for force in rig.forces] == [
        "driving_force",
        "driving_force_2",
        "resisting_force",
        "brake_pressure",
    ]
    assert [force.sign for force in rig.forces] == [1.0, 1.0, -1.0, -1.0]
    assert [force.per_reading for force in rig.forces] == [1.0, 1.0, 1.0, 0.002]
    assert [force.unit for force in rig.forces] == ["N", "N", "N", "Pa"]
    assert rig.force("brake_pressure").channels == (rig.channel("brake_pressure"),)
    with pytest.raises(KeyError):
        rig.force("breech_pressure")


def test_what_resists_is_larger_by_the_share_that_no_gauge_reads() -> None:
    rig = line_rig("driving_force", "resisting_force", unread_share=0.02)
    assert [force.per_reading for force in rig.forces] == [1.0, 1.02]
