from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.errors import IdentificationError
from identification.default_estimator import Available, default_estimator

ALL = Available(forces=True, accelerometer=True, camera=True, silence=True)


@pytest.mark.parametrize(
    ("available", "name"),
    [
        (ALL, "joint"),
        (replace(ALL, accelerometer=False), "camera-gls"),
        (replace(ALL, camera=False), "ar-gls"),
        (replace(ALL, camera=False, silence=False), "weak"),
        (replace(ALL, camera=False, lost_share=0.05), "weak"),
    ],
)
def test_the_rule_is_the_documented_one(available, name):
    found = default_estimator(available)
    assert found.name == name
    assert str(found).startswith(f"{name}: ")


def test_lost_samples_are_named_in_the_reason():
    assert "5.0 % of the samples are lost" in default_estimator(replace(ALL, camera=False, lost_share=0.05)).reason
    assert "no silence" in default_estimator(replace(ALL, camera=False, silence=False)).reason


@pytest.mark.parametrize(
    ("available", "missing"),
    [(replace(ALL, forces=False), "forces"), (replace(ALL, accelerometer=False, camera=False), "motion")],
)
def test_without_forces_or_motion_there_is_no_mass(available, missing):
    with pytest.raises(IdentificationError, match=f"without the {missing}"):
        default_estimator(available)


@given(st.booleans(), st.booleans(), st.booleans(), st.floats(0, 1))
def test_every_shot_with_forces_and_a_motion_has_one_default_with_a_reason(accelerometer, camera, silence, lost):
    if accelerometer or camera:
        found = default_estimator(Available(True, accelerometer, camera, silence, lost))
        assert found.reason


def test_a_share_is_a_share():
    with pytest.raises(ValueError, match="lost_share"):
        Available(True, True, True, True, 1.5)
