"""Every model of a mechanism, by the name that a rig file gives it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.mechanism.line import Line
from recoil_rigs.mechanism.mechanism_parameters import Mechanism, MechanismModel

MECHANISMS: Mapping[MechanismModel, type[Mechanism]] = MappingProxyType({one.model: one for one in (Gun, Line)})
