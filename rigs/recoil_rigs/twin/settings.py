"""The rig file's table ``[twin]`` of a gun: how the virtual rig moves, and how well its instruments measure.

Every key has a default, so that any rig with a complete ``[mechanism]`` can be simulated.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any

from pydantic import Field

from recoil_acquisition.errors import Fault, FaultCode, RigError
from recoil_acquisition.quantities.declaration import NotNegative, Positive, declared
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import ROLES, Rig
from recoil_rigs.tables.rig_tables import CARRIAGE_ACCELERATIONS, LINE_ROLES
from recoil_rigs.twin.recorder_settings import TWIN, RecorderSettings, contradiction, faults_of_recorders

_RECOIL_S = 0.25
"""Time from the first rise of the breech force within which recoils end."""


class TwinSettings(RecorderSettings):
    """Settings of a virtual gun, SI units; shares are relative to the full scale of the sensor.

    The mechanism's loads are those of a hydraulic brake with a throttle that narrows along the stroke,
    a gas recuperator, and a stop that holds the recoiling part in battery.
    """

    duration_s: Annotated[float, Field(gt=0, le=10)] = 0.5
    """Length of the record on the reference clock."""

    released_mass_kg: NotNegative = 0.0
    """Part of the recoiling mass that lets go while it moves, with the velocity that it has; its centre of mass is
    that of the recoiling part."""
    release_after_s: Positive = 0.02
    """Time from the first rise of the breech force to the instant at which it lets go."""
    peak_pressure_pa: Positive = 130e6
    """Peak of the breech pressure."""
    rise_s: Positive = 1.5e-3
    """Time constant of the breech pressure's rise."""
    decay_s: Positive = 5.5e-3
    """Time constant of its decay."""
    stroke_m: Positive = 0.9
    """Travel at which the brake's throttle is closed but for its leak."""
    orifice_m2: Positive = 6.0e-4
    """Area of the brake's throttle in battery."""
    leak_m2: Positive = 2.0e-5
    """Area of its leak."""
    oil_density_kg_m3: Positive = 870.0
    """Density of the brake's oil."""
    discharge: Positive = 0.7
    """Discharge coefficient of the throttle."""
    recuperator_pressure_pa: Positive = 1.65e6
    """Gas pressure of the recuperator in battery."""
    recuperator_volume_m3: Positive = 0.0165
    """Gas volume of the recuperator in battery."""
    polytropic: Positive = 1.3
    """Exponent of the gas."""
    counter_recoil_n_s2_m2: NotNegative = 8000.0
    """Throttling of the counter-recoil in a chamber that no gauge reads: force over squared velocity."""
    packing_stiffness_n_m: Positive = 5e7
    """Stiffness of the packing before it slides: what makes its friction hold at rest."""
    stop_stiffness_n_m: Positive = 5e9
    """Stiffness of the stop that holds the recoiling part in battery."""
    stop_damping_n_s_m: NotNegative = 5e5
    """Damping of the stop that holds the recoiling part in battery."""
    elevating_stiffness_n_m_rad: Positive = 2e6
    """Stiffness of the elevating gear between carriage and tipping part."""
    elevating_damping_n_m_s_rad: NotNegative = 2.5e4
    """Damping of the elevating gear between carriage and tipping part."""
    ground_stiffness_n_m: Positive = 3e7
    """Stiffness of the ground at C, in both directions, and at D."""
    ground_damping_n_s_m: NotNegative = 2e5
    """Damping of the ground at C, in both directions, and at D."""
    ground_slip_m_s: Positive = 5e-3
    """Velocity at which the friction at D is fully there."""
    tube_modes: Annotated[int, Field(ge=0, le=2)] = 0
    """Bending modes of the tube, a part of the recoiling part; 0 for a rigid one."""
    tube_length_m: Positive = 2.5
    """Length from its clamp to its free end."""
    tube_mass_kg: Positive = 160.0
    """Mass of the tube, a part of the recoiling one."""
    tube_bending_stiffness_n_m2: Positive = 2e6
    """Modulus of elasticity times second moment of area."""
    tube_damping: Annotated[float, Field(ge=0, lt=1)] = 0.01
    """Damping of each mode, share of the critical one."""
    tube_root_m: float = 0.0
    """Place of the clamp ahead of the recoiling part's centre of mass; the axis is that of the breech force."""
    ringing_carriage: NotNegative = 0.04
    """Stress waves on the carriage's accelerometers, relative to those on the recoil accelerometer."""
    ringing_rate_s_m: NotNegative = 1e-4
    """Stress waves on the gyros, rad/s per m/s^2 of those on the recoil accelerometer."""

    @property
    def telling_s(self) -> float:
        """Length of the record from its start that tells of the mass: what comes after the recoil does not."""
        return min(self.duration_s, self.pre_trigger_s + _RECOIL_S)

    def undrawn(self) -> dict[str, Any]:
        """Return the settings with which nothing of a shot is off, and nothing lets go."""
        return super().undrawn() | {"released_mass_kg": 0.0}

    def with_charge(self, factor: float) -> dict[str, Any]:
        """Return the settings of a charge that is so many times as strong."""
        return {"peak_pressure_pa": factor * self.peak_pressure_pa}

    def ringing_share(self, role: str) -> float:
        """Return the stress waves on a motion's sensor, SI, for each m/s^2 of those on the recoil accelerometer."""
        if role in CARRIAGE_ACCELERATIONS:
            return self.ringing_carriage
        return self.ringing_rate_s_m if ROLES.get(role) == "angular_rate" else super().ringing_share(role)

    def shift_share(self, role: str) -> float:
        """Return the step of a sensor's offset at the shot, share of full scale."""
        if role in CARRIAGE_ACCELERATIONS:
            return self.zero_shift * self.ringing_carriage
        return super().shift_share(role)


def read_settings(rig: Rig) -> TwinSettings:
    """Validate a gun's table ``[twin]`` and what else a simulation needs of the rig.

    Raises
    ------
    RigError
        With every fault, keyed ``twin.<key>``, ``mechanism.<symbol>`` or by the source.
    """
    faults: list[Fault] = []
    settings = declared(TwinSettings, dict(rig.twin), (TWIN,), faults)
    if settings is None:
        raise RigError(rig.path, faults)
    missing = [s for s in Mechanism.symbols() if math.isnan(getattr(rig.mechanism, s))]
    needed = "is missing; a simulation needs all of the model"
    faults += [Fault(("mechanism", s), needed, FaultCode.MISSING) for s in missing]
    faults += faults_of_mass(replace(rig.mechanism, m3=settings.m3_true or rig.mechanism.m3), settings)
    swept = rig.mechanism.recuperator_area * settings.stroke_m * 1.2
    if settings.recuperator_volume_m3 <= swept:
        problem = f"must exceed {swept:.4g} m3, what the recuperator's piston sweeps in 1.2 strokes"
        faults.append(contradiction("recuperator_volume_m3", problem))
    faults += faults_of_recorders(rig, settings, (role for role in ROLES if role not in LINE_ROLES))
    if faults:
        raise RigError(rig.path, faults)
    return settings


def faults_of_mass(mechanism: Mechanism, settings: TwinSettings) -> list[Fault]:
    """Return why a mechanism's recoiling mass cannot lose or hold what the settings make a part of it, if it cannot."""
    released, gas = settings.released_mass_kg, settings.unread.leaving_gas_kg
    faults = []
    if released >= mechanism.m3:
        problem = f"must be less than the recoiling mass, {mechanism.m3:g} kg"
        faults.append(contradiction("released_mass_kg", problem))
    elif released + gas >= mechanism.m3:
        problem = f"must be less than what else is left of the recoiling mass, {mechanism.m3 - released:g} kg"
        faults.append(Fault((TWIN, "unread", "leaving_gas_kg"), problem, FaultCode.CONTRADICTION))
    if settings.tube_modes:
        faults += _faults_of_tube(mechanism, settings, mechanism.m3 - released - gas)
    return faults


def _faults_of_tube(mechanism: Mechanism, settings: TwinSettings, m3_kg: float) -> list[Fault]:
    """Return why the tube cannot be a part of the recoiling part, if it cannot."""
    if settings.tube_mass_kg >= m3_kg:
        problem = f"must be less than the recoiling mass of {m3_kg:g} kg, which it is a part of"
        return [contradiction("tube_mass_kg", problem)]
    root, length = settings.tube_root_m, settings.tube_length_m
    middle = math.hypot(root + 0.5 * length, mechanism.e)
    # about the centre of mass of both, the parts' own inertias and their masses' at its distances add up
    others = settings.tube_mass_kg * (length**2 / 12 + middle**2 * m3_kg / (m3_kg - settings.tube_mass_kg))
    if others >= mechanism.J3c:
        problem = f"such a tube alone would give the recoiling part {others:.0f} kg m2, more than J3c"
        return [contradiction("tube_length_m", problem)]
    return []
