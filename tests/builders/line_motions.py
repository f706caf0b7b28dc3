"""A body on a line whose motion is prescribed: to and fro without a rest, and the forces that this takes, by Newton."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.shot.shot import Shot
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.line_rigs import ROLES, line_rig

G_M_S2 = 9.80665
TURNING_M_S = 0.0015
"""Speed over which the friction turns here."""


@dataclass(frozen=True)
class LineBody:
    """One body and what acts on it; SI, forces along the line."""

    mass_kg: float = 95.0
    friction_n: float = 20.0
    slide_n_s_m: float = 200.0
    inclination_rad: float = 0.0
    rate_hz: float = 500.0
    length_s: float = 6.0
    start_s: float = 0.0
    rest_s: float = 0.0

    def readings(self, seed: int = 1, noise: float = 1.0) -> dict[str, np.ndarray]:
        """Return what sensors read by role, shape (n,) each: a motion of three frequencies, after a rest if any."""
        rng = np.random.default_rng(seed)
        t = np.arange(round(self.length_s * self.rate_hz)) / self.rate_hz - self.rest_s
        size, hz, phase = np.array([0.10, 0.05, 0.02]), np.array([0.45, 1.1, 2.6]), np.array([0.0, 0.0, 0.0])
        if not self.rest_s:
            phase = np.array([0.3, 1.1, 2.0])
        turns = 2.0 * np.pi * hz
        angle = np.multiply.outer(t, turns) + phase
        begins = 1.0 if not self.rest_s else np.where(t > 0, 1.0, 0.0)
        v, a = begins * (np.sin(angle) @ size), begins * (np.cos(angle) @ (size * turns))
        x = begins * ((np.cos(phase) - np.cos(angle)) @ (size / turns))
        felt = a + G_M_S2 * np.sin(self.inclination_rad)
        resists = 3.0 * np.sin(2.0 * np.pi * 0.8 * t) * (np.abs(v) > 0)
        rubs = self.friction_n * np.tanh(v / TURNING_M_S) + self.slide_n_s_m * v
        drives = np.where(begins > 0, self.mass_kg * felt + rubs + resists, 0.0)
        scale = self.mass_kg / 95.0
        return {
            "driving_force": drives + noise * scale * rng.normal(0.0, 0.3, t.size),
            "resisting_force": resists + noise * scale * rng.normal(0.0, 0.1, t.size),
            "recoil_acceleration": felt + noise * rng.normal(0.0, 0.01, t.size),
            "recoil_velocity": v + noise * rng.normal(0.0, 1e-4, t.size),
            "recoil_displacement": x + noise * rng.normal(0.0, 2e-6, t.size),
        }

    def fired(self, *roles: str, readings: Mapping[str, np.ndarray] | None = None, **mechanism: float) -> FiredShot:
        """Return a shot with channels of some roles, and its rig; readings by the channels' names."""
        rig = line_rig(*roles)
        own = {"m3": self.mass_kg, "phi20": self.inclination_rad, "friction": self.friction_n}
        own |= {"slide_friction": self.slide_n_s_m} | mechanism
        u = dict(rig.mechanism.u) | {key: 0.25 * own[key] for key in ("friction", "slide_friction")}
        rig = replace(rig, mechanism=replace(rig.mechanism, **own, u=MappingProxyType(u)))
        read = self.readings() if readings is None else readings
        size = next(iter(read.values())).size
        base = TimeBase.uniform("recorder", self.start_s, 1.0 / self.rate_hz, size)
        channels = {
            spec.name: Channel(
                spec.name, ROLES[spec.role][0], read[spec.name], base, spec.signal, spec.role, spec.sensor.u_rel
            )
            for spec in rig.channels
        }
        return FiredShot(Shot("1", rig.name, "", "recorder", channels), rig)
