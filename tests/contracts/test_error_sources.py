"""Every source of error belongs to a group, and what many shots share is known by its source."""

from __future__ import annotations

import pytest

from recoil_identification.shot.shared_identity import OF_RIG, source_of
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from tests.builders.virtual_shots import identified


def test_a_group_says_what_a_better_mass_would_take() -> None:
    assert ErrorSource(SourceKind.SENSITIVITY, "p_breech").group == "sensors"
    assert ErrorSource(SourceKind.FRICTION).group == ErrorSource(SourceKind.BORE_FRICTION).group == "unread forces"
    assert ErrorSource(SourceKind.RANDOM).group == "motion noise"
    assert ErrorSource(SourceKind.AREA, "bore_area").group == "geometry"


@pytest.mark.parametrize("rig", ["field-2013", "mixed"])
def test_what_shots_of_a_rig_share_is_known_by_its_source(rig: str) -> None:
    listed = [name for one in identified(rig).summary.parameters for name, _ in one.influences]
    of_rig = [name.rpartition(":")[2] for name in listed if name.startswith(OF_RIG)]
    assert "bore_area" in of_rig
    assert [name for name in of_rig if source_of(f"{OF_RIG}{rig}:{name}").kind is SourceKind.DECLARED] == []
    # no two are one row of a budget
    assert len({source_of(name) for name in listed}) == len(set(listed))
