"""Two real records of one body on a line, as files that `ingest` reads; the data lie beside the checkout, or nowhere.

The carriage on a screw (A. Janot, M. Gautier, M. Brunot, "Data set and reference models of EMPS", Workshop on Nonlinear
System Identification Benchmarks 2019) has a drive's force and an encoder's travel; its speed and acceleration are the
encoder's, differentiated behind a low-pass without phase. The rocket (RocketPy's NDRT 2020) has an accelerometer; its
thrust is the curve of the motor's type, its drag is computed from the speed. Nothing else is added, no rest is put
before anything.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.builders.line_rigs import line_text
from tests.builders.shared_data import shared_file

Array = NDArray[np.float64]

EMPS_KG = 95.1089
"""Mass of the carriage with its rotor: published, identified from the same record with a calibrated drive."""
EMPS_VISCOUS_N_S_M, EMPS_COULOMB_N = 203.50, 20.39
"""Frictions of the same publication."""
ROCKET_KG = (20.85, 23.32)
"""Mass of the rocket at burn-out and at lift-off, weighed."""
G_M_S2 = 9.80665
_ENCODER_HZ = 100.0
"""Cut-off of the low-pass behind which the encoder's travel is differentiated."""
_THRUST_U_REL, _DRAG_U_REL = 0.03, 0.15
"""What a curve of a motor's type, and a computed drag, are worth."""


@dataclass(frozen=True)
class Carriage:
    """The carriage's record: times, drive's force, travel, its rates; shape (n,) each."""

    times_s: Array
    force_n: Array
    travel_m: Array
    speed_m_s: Array
    acceleration_m_s2: Array

    @classmethod
    def read(cls) -> Carriage:
        """Read the record, and differentiate its encoder."""
        from scipy.io import loadmat
        from scipy.signal import butter, filtfilt

        data = loadmat(shared_file("real/emps/DATA_EMPS.mat"))
        times, travel = data["t"].ravel(), data["qm"].ravel()
        step = float(times[1] - times[0])
        smooth = filtfilt(*butter(4, 2.0 * step * _ENCODER_HZ), travel)
        speed = np.gradient(smooth, step)
        force = float(data["gtau"].ravel()[0]) * data["vir"].ravel()
        return cls(times, force, travel, speed, np.gradient(speed, step))

    def part(self, first: int, stop: int) -> Carriage:
        """Return some samples; the travel goes on from where it is."""
        names = ("times_s", "force_n", "travel_m", "speed_m_s", "acceleration_m_s2")
        return Carriage(*(getattr(self, name)[first:stop] for name in names))

    def strokes(self, length_s: float = 1.331, from_m: float = 0.05, travel_m: float = 0.1) -> list[Carriage]:
        """Return the long strokes forward, each from where the force changes its sign as the carriage turns."""
        count = round(length_s / float(self.times_s[1] - self.times_s[0]))
        turns = np.flatnonzero((self.force_n[:-1] < 0) & (self.force_n[1:] >= 0) & (np.abs(self.speed_m_s[1:]) < 5e-3))
        begun = [
            first
            for first in (turns + 1).tolist()
            if first + count < self.times_s.size
            and self.travel_m[first] > from_m
            and self.travel_m[first + count] - self.travel_m[first] > travel_m
        ]
        return [self.part(first, first + count) for first in begun]

    def least_squares(self, cutoff_hz: float) -> Array:
        """Return mass, viscous and Coulomb friction and offset by plain least squares, both sides behind a low-pass."""
        from scipy.signal import butter, filtfilt

        low = butter(4, 2e-3 * cutoff_hz)
        columns = (self.acceleration_m_s2, self.speed_m_s, np.sign(self.speed_m_s), np.ones(self.times_s.size))
        design = np.column_stack([filtfilt(*low, column) for column in columns])
        return np.asarray(np.linalg.lstsq(design, filtfilt(*low, self.force_n), rcond=None)[0])


EMPS_SENSORS = {
    "driving_force": "u_rel = 0.01, u_zero_rel = 0.01, range = [-351.0, 351.0]",
    "recoil_acceleration": "u_rel = 0.001, range = [-5.0, 5.0]",
    "recoil_velocity": "u_rel = 0.001, range = [-1.0, 1.0]",
    "recoil_displacement": "u_rel = 0.0001, u_distortion_m = 1e-6",
}
"""Role -> what is stated of its sensor: a calibrated drive, and an encoder."""


def emps_rig(*roles: str) -> str:
    """Return the carriage's rig file with channels of some roles; frictions are stated to 25 %."""
    keys = {"u_slide_friction": 0.25 * EMPS_VISCOUS_N_S_M, "slide_friction": EMPS_VISCOUS_N_S_M, "carried_mass": 0.0}
    text = line_text(*roles, **keys, u_carried_mass=0.0).replace('name = "sled"', 'name = "emps"')
    text = text.replace("friction = 20.4\nu_friction = 5.0", f"friction = {EMPS_COULOMB_N}\nu_friction = 5.1")
    return _with_sensors(text, EMPS_SENSORS)


def _with_sensors(text: str, sensors: dict[str, str]) -> str:
    """Replace what is said of the sensors of some roles."""
    head, *channels = text.split("\n[[channel]]\n")
    for n, channel in enumerate(channels):
        role = channel.partition('role = "')[2].partition('"')[0]
        if role in sensors:
            channels[n] = f"{channel.partition('sensor = ')[0]}sensor = {{ {sensors[role]} }}\n"
    return "\n[[channel]]\n".join([head, *channels])


def write_carriage(part: Carriage, roles: Iterable[str], path: Path) -> Path:
    """Write a part of the record as a recorder's text, its times from 0."""
    columns = {
        "driving_force": ("driving_force (N)", part.force_n),
        "recoil_acceleration": ("recoil_acceleration (m/s2)", part.acceleration_m_s2),
        "recoil_velocity": ("recoil_velocity (m/s)", part.speed_m_s),
        "recoil_displacement": ("recoil_displacement (mm)", 1e3 * part.travel_m),
    }
    step = float(part.times_s[1] - part.times_s[0])
    return _write(path, np.arange(part.times_s.size) * step, dict(columns[role] for role in roles))


def _write(path: Path, times_s: Array, columns: dict[str, Array]) -> Path:
    rows = np.column_stack([times_s, *columns.values()])
    body = "".join(",".join([f"{row[0]:.4f}", *(f"{one:.9g}" for one in row[1:])]) + "\n" for row in rows.tolist())
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(",".join(["time (s)", *columns]) + "\n" + body, encoding="utf-8")
    return path


@dataclass(frozen=True)
class Rocket:
    """The rocket's ascent: times, specific force, thrust, drag and what is left of its mass; shape (n,) each."""

    times_s: Array
    specific_m_s2: Array
    thrust_n: Array
    drag_n: Array
    mass_kg: Array

    @property
    def known_kg(self) -> float:
        """Mean mass, by the share of the motor's impulse that is spent."""
        return float(self.mass_kg.mean())

    @classmethod
    def read(cls, until_s: float = 3.6) -> Rocket:
        """Read the ascent, with the ignition at which thrust and acceleration go together best."""
        lines = shared_file("real/ndrt-2020/ndrt_2020_flight_data.csv").read_text().splitlines()[1:]
        motor = shared_file("real/ndrt-2020/Cesaroni_4895L1395-P.eng")
        cells = [line.split(",")[:2] for line in lines]
        recorded = np.array([[float(a), float(b)] for a, b in cells if a.strip() and b.strip()])
        times = np.arange(0.0, until_s, 0.0025)
        on_pad = float(recorded[recorded[:, 0] < 0.075, 1].mean())
        # on the pad, standing upright, it reads 1 g
        specific = (np.interp(times, *recorded.T) + 1.0 - on_pad) * G_M_S2
        rows = [line.split() for line in motor.read_text().splitlines()]
        curve = np.array([[0.0, 0.0], *([float(a), float(b)] for a, b in (row for row in rows if len(row) == 2))])
        speed = np.maximum(np.cumsum(specific - G_M_S2) * 0.0025, 0.0)
        drag = 0.5 * 1.22 * 0.44 * np.pi * 0.1015**2 * speed**2
        delays_s = np.arange(0.0, 0.25, 0.0025)
        alike = [np.dot(np.interp(times - one, *curve.T, left=0.0, right=0.0), specific) for one in delays_s]
        ignition_s = float(delays_s[int(np.argmax(alike))])
        thrust = np.interp(times - ignition_s, *curve.T, left=0.0, right=0.0)
        whole = np.arange(0.0, float(curve[-1, 0]), 0.0025)
        impulse = 0.0025 * float(np.interp(whole, *curve.T).sum())
        burnt = np.minimum(0.0025 * np.cumsum(thrust) / impulse, 1.0)
        return cls(times, specific, thrust, drag, ROCKET_KG[1] - burnt * (ROCKET_KG[1] - ROCKET_KG[0]))

    def part(self, from_s: float, to_s: float) -> Rocket:
        """Return what lies between two instants."""
        within = (self.times_s >= from_s) & (self.times_s < to_s)
        names = ("times_s", "specific_m_s2", "thrust_n", "drag_n", "mass_kg")
        return Rocket(*(getattr(self, name)[within] for name in names))

    def least_squares_kg(self) -> float:
        """Return the mass by plain least squares of force on acceleration."""
        force = self.thrust_n - self.drag_n
        return float(np.dot(force, self.specific_m_s2) / np.dot(self.specific_m_s2, self.specific_m_s2))

    def write(self, path: Path) -> Path:
        """Write it as a recorder's text, its times from 0."""
        columns = {
            "driving_force (N)": self.thrust_n,
            "resisting_force (N)": self.drag_n,
            "recoil_acceleration (m/s2)": self.specific_m_s2,
        }
        return _write(path, np.arange(self.times_s.size) * 0.0025, columns)


ROCKET_SENSORS = {
    "driving_force": f"u_rel = {_THRUST_U_REL}, u_zero_rel = 0.0, range = [-2000.0, 2000.0]",
    "resisting_force": f"u_rel = {_DRAG_U_REL}, u_zero_rel = 0.0, range = [-300.0, 300.0]",
    "recoil_acceleration": "u_rel = 0.02, range = [-700.0, 700.0]",
}


def rocket_rig() -> str:
    """Return the rocket's rig file: upright, without friction once it has left the rail."""
    text = line_text("driving_force", "resisting_force", "recoil_acceleration", carried_mass=0.0, u_carried_mass=0.0)
    text = text.replace('name = "sled"', 'name = "rocket"').replace("m3 = 95.1", "m3 = 22.1")
    text = text.replace("phi20 = 0.0", "phi20 = 1.5708").replace(
        "friction = 20.4\nu_friction = 5.0", "friction = 0.0\nu_friction = 0.0"
    )
    return _with_sensors(text, ROCKET_SENSORS)
