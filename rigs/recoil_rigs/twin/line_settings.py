"""The rig file's table ``[twin]`` of one body on a line: what drives it, what holds it, and what measures.

Every key has a default. What drives is a push, or strokes that a servo follows, or both; without either the body falls,
or goes on with the speed that it has.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydantic import Field

from recoil_acquisition.errors import Fault, FaultCode, RigError, did_you_mean
from recoil_acquisition.quantities.declaration import Finite, NotNegative, Positive, declared
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import ROLES, Rig
from recoil_rigs.tables.rig_tables import CARRIED_ROLES, FORCE_ROLES, GAUGE_ROLES
from recoil_rigs.twin.readings import Readings
from recoil_rigs.twin.recorder_settings import TWIN, Count, RecorderSettings, contradiction, faults_of_recorders
from recoil_rigs.twin.unread_forces import UnreadForces

OF_GUN_FORCES = frozenset(
    {
        "back_pressure_pa", "back_pressure_reach_m", "rod_share", "floating_piston_pa", "bore_drag", "muzzle_brake",
        "projectile_mass_kg", "bore_length_m", "leaving_gas_kg", "leaving_s",
    }
)  # fmt: skip
"""Keys of ``[twin.unread]`` that act in a gun alone."""
OF_LINE_READINGS = frozenset(
    {
        "accelerometer_bracket_hz", "accelerometer_bracket_damping", "accelerometer_amplifier_s", "frame_rate",
        "frame_jitter_s", "marker_bracket_hz", "marker_bracket_damping", "rolling_shutter_s", "lens_m",
        "noise_of_acceleration", "noise_of_reading", "noise_of_speed_per_s", "gauge_noise_of_speed_s_m",
        "structure_borne_m_s2", "knocks", "knock_m_s2", "rest_noise",
    }
)  # fmt: skip
"""Keys of ``[twin.readings]`` that a line's sensors have."""


class LineSettings(RecorderSettings):
    """Settings of a virtual body on a line, SI units; shares are relative to the full scale of the sensor.

    What drives it is read by its driving sensors, what brakes it by its resisting ones; friction no sensor reads. A
    latch holds it until the push or the strokes begin, unless it has a speed from the start.
    """

    pre_trigger_s: NotNegative = 0.05
    """Time from the start of the motion to that of the push and of the strokes."""
    begins_s: NotNegative = 0.0
    """Time of the motion that is over as the record begins."""
    ringing: NotNegative = 0.1
    """Peak of the stress waves on the accelerometer, relative to the peak of the acceleration."""
    noise: NotNegative = 0.0005
    """Standard deviation of the white noise, share of full scale."""

    push_n: Finite = 12e3
    """Largest force of the push, which rises and falls as ``sin(pi t / push_s)^2``; 0 for none."""
    push_s: Positive = 0.08
    """Time that the push lasts."""
    start_m_s: Finite = 0.0
    """Speed at the start of the motion."""

    strokes: Count = 0
    """Strokes that a servo drives, to and fro in turn; 0 for none."""
    stroke_m: Positive = 0.5
    """Travel of a stroke."""
    stroke_s: Positive = 1.0
    """Time of a stroke, over which its acceleration is smooth."""
    pause_s: NotNegative = 0.2
    """Rest between two strokes."""
    servo_hz: Positive = 8.0
    """Frequency up to which the servo follows."""

    brake_n: NotNegative = 1500.0
    """Force of the brake against any motion."""
    brake_n_s_m: NotNegative = 400.0
    """Rise of that force with the speed."""
    brake_from_m: Finite = 0.15
    """Travel from which on the brake acts."""
    brake_over_m: Positive = 0.02
    """Travel over which it comes up."""
    buffer_n_m: NotNegative = 0.0
    """Stiffness of a buffer that stops the body; 0 for none."""
    buffer_n_s_m: NotNegative = 0.0
    """Damping of the buffer, which never pulls."""
    buffer_from_m: Finite = 0.5
    """Travel at which the body meets the buffer."""

    presliding_m: Positive = 1e-5
    """Travel over which the packing gives before it slides: what makes its friction hold at rest."""
    shares: dict[str, Positive] = Field(default_factory=dict)
    """Driving or resisting channel, or a pressure's role -> its part of the force, to be compared with 1 of those that
    are not named."""

    @property
    def rests(self) -> bool:
        """Whether the body rests before the push or the strokes begin."""
        return self.start_m_s == 0.0 and self.pre_trigger_s > 0.0

    def with_charge(self, factor: float) -> dict[str, Any]:
        """Return the settings of a drive that is so many times as strong."""
        return {"push_n": factor * self.push_n, "stroke_m": factor * self.stroke_m}


def devices_of(rig: Rig) -> Mapping[str, str]:
    """Return what drives and what resists on a line: a name -> its role.

    A load cell is one of its own, by the channel's name; all gauges of a pressure are one, by their role.
    """
    of_cells = {channel.name: channel.role for channel in rig.channels if channel.role in FORCE_ROLES}
    return of_cells | {role: role for role in GAUGE_ROLES if rig.by_role(role) is not None}


def read_line_settings(rig: Rig) -> LineSettings:
    """Validate a line's table ``[twin]`` and what else a simulation needs of the rig.

    Raises
    ------
    RigError
        With every fault, keyed ``twin.<key>``, ``mechanism.<symbol>`` or by the source.
    """
    faults: list[Fault] = []
    settings = declared(LineSettings, dict(rig.twin), (TWIN,), faults)
    if settings is None:
        raise RigError(rig.path, faults)
    known = {"unread": frozenset(UnreadForces.model_fields) - OF_GUN_FORCES, "readings": OF_LINE_READINGS}
    for table, keys in known.items():
        asked: UnreadForces | Readings = getattr(settings, table)
        problem = "a body on a line has nothing of the kind"
        unknown = sorted(asked.model_fields_set - keys)
        faults += [Fault((TWIN, table, key), problem, FaultCode.CONTRADICTION) for key in unknown]
    devices = devices_of(rig)
    for name in settings.shares:
        if name not in devices:
            problem = f"nothing of that name drives or resists; {did_you_mean(name, list(devices))}"
            faults.append(Fault((TWIN, "shares", name), problem, FaultCode.UNKNOWN))
    faults += faults_of_line(replace(rig.mechanism, m3=settings.m3_true or rig.mechanism.m3), settings)
    faults += faults_of_recorders(rig, settings, (role for role in ROLES if role not in CARRIED_ROLES))
    if faults:
        raise RigError(rig.path, faults)
    return settings


def faults_of_line(mechanism: Mechanism, settings: LineSettings) -> list[Fault]:
    """Return why a body on a line cannot be simulated as the settings have it, if it cannot."""
    faults = []
    if settings.begins_s >= settings.pre_trigger_s + settings.duration_s:
        faults.append(contradiction("begins_s", "the record must not begin after its length is over"))
    moved = settings.push_n or settings.strokes or settings.start_m_s or mechanism.g * math.sin(mechanism.phi20)
    if not moved:
        faults.append(contradiction("push_n", "nothing moves: give a push, strokes, a speed or an inclination"))
    return faults
