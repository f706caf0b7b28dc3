"""The table of a mechanism is read by what its model answers: a model of another kind needs no check of its own."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType

import pytest

from recoil_acquisition.errors import Fault, RigError
from recoil_rigs.checks.plausible import unusual_peak
from recoil_rigs.mechanism import mechanism_table
from recoil_rigs.mechanism.bounds import Bounds
from recoil_rigs.mechanism.line import Line
from recoil_rigs.mechanism.mechanisms import MECHANISMS
from recoil_rigs.rig import Rig, parse_rig
from tests.builders.line_rigs import line_text


class Sprung(Line):
    """A body on a spring, one load cell, light: what it answers is all that is known of it."""

    words = "a body on a spring"
    shared_roles = ()
    foreign_roles = MappingProxyType({"resisting_force": "a spring has no role 'resisting_force': it resists itself"})
    bounds = MappingProxyType({**Line.bounds, "m3": Bounds((1e-3, 2.0), (1e-2, 1.0), "kg")})
    bounds_of_role = MappingProxyType({"driving_force": Bounds((0.0, 10.0), (0.0, 1.0), "N")})


@pytest.fixture(autouse=True)
def _third_model(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mechanism_table, "MECHANISMS", {**MECHANISMS, "sprung": Sprung})


def sprung(*roles: str, m3: str = "0.5", more: str = "") -> Rig:
    text = line_text(*roles).replace('model = "line"', f'model = "sprung"\n{more}').replace("m3 = 95.1", f"m3 = {m3}")
    return parse_rig(text, Path("rig.toml"))


def faults_of(*roles: str, m3: str = "0.5", more: str = "") -> list[Fault]:
    with pytest.raises(RigError) as caught:
        sprung(*roles, m3=m3, more=more)
    return list(caught.value.faults)


def test_a_rig_of_a_third_model_is_read() -> None:
    rig = sprung("driving_force", "recoil_acceleration")
    assert type(rig.mechanism) is Sprung
    assert "unusual" in unusual_peak(rig.with_role("driving_force")[0], 5.0, rig.mechanism)


def test_its_values_are_held_to_its_own_bounds_and_words() -> None:
    assert [str(one) for one in faults_of("driving_force", "recoil_acceleration", m3="3.0")] == [
        "mechanism.m3: must lie between 0.001 and 2 kg, found 3"
    ]
    (fault,) = faults_of("driving_force", "recoil_acceleration", more="XA = 1.0")
    assert fault.problem.startswith("a body on a spring has no XA, ")


def test_its_channels_are_held_to_its_own_roles() -> None:
    told = [str(one) for one in faults_of("driving_force", "resisting_force", "recoil_acceleration")]
    assert any("it resists itself" in one for one in told)


def test_a_model_that_is_none_is_told_with_those_that_there_are() -> None:
    text = line_text("driving_force", "recoil_acceleration").replace('model = "line"', 'model = ["line"]')
    with pytest.raises(RigError, match=r"must be \"gun\" or \"line\" or \"sprung\", found \['line'\]"):
        parse_rig(text, Path("rig.toml"))
