"""A campaign of the virtual rig: what happens from shot to shot, planned before the first one is fired."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from recoil_acquisition.errors import Fault, FaultCode, KeyPath, RigError, did_you_mean
from recoil_acquisition.quantities.declaration import Finite, NotNegative, Positive
from recoil_rigs.rig import Rig
from recoil_rigs.tables.rig_tables import FORCE_SENSOR_ROLES
from recoil_rigs.twin.instruments import generator
from recoil_rigs.twin.line_settings import LineSettings, faults_of_line
from recoil_rigs.twin.loads import check_statics
from recoil_rigs.twin.recorder_settings import measured_roles
from recoil_rigs.twin.settings import TwinSettings, faults_of_mass
from recoil_rigs.twin.virtual_settings import virtual_settings


def _in_one_line(name: str) -> str:
    """Refuse a name that a cell of a table would not give back as it is."""
    if not name or not name.isprintable() or name != name.strip():
        raise ValueError("must be a printable text without spaces around it")
    return name


Charge = Annotated[float, Field(gt=0, le=2, allow_inf_nan=False)]
Change = Annotated[float, Field(ge=-0.5, le=0.5, allow_inf_nan=False)]
Configuration = Annotated[str, AfterValidator(_in_one_line)]
ShotNumber = Annotated[int, Field(ge=1, le=9999)]

LARGEST_U_OF_ADDED_MASS = 0.2
"""Share of the added mass: beyond it, a draw could leave none of it."""
_REPEATING = (*FORCE_SENSOR_ROLES, "recoil_acceleration")
"""Roles whose sensors' gains scatter from shot to shot: what reads a force, and the recoil accelerometer."""


class CampaignPlan(BaseModel):
    """Plan of a campaign: what happens over its shots. Shots are counted from 1, shares are relative.

    The added mass is on every second shot: the first is bare, the second has it, and so on. Charges go by the shot
    as well: an even number of them ties each to the added mass or to its absence, unless each is named twice in a row.

    Raises
    ------
    ValueError
        With every fault of the values, and of those that contradict each other.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    added_mass_kg: Positive | None = None
    """Mass that every second shot carries in addition, as weighed. It sits on the line of the centre of mass: the
    recoiling mass grows by it, and nothing else changes."""
    u_added_mass_kg: NotNegative = 0.05
    """Standard uncertainty of that weight: all shots that carry it are off by the same draw."""
    charges: tuple[Charge, ...] = ()
    """Factors of the drive, a gun's peak breech pressure or a line's push and strokes, one shot after the other, and
    from the first again; 1 if there are none."""
    friction_scatter: Annotated[float, Field(ge=0, le=0.2)] = 0.0
    """Relative standard deviation of the packing friction from shot to shot, beside the error that all shots share."""
    repeatability: Annotated[float, Field(ge=0, le=0.05)] = 0.0
    """Relative standard deviation from shot to shot of the gain of each force gauge and of the recoil accelerometer."""
    mass_steps: dict[ShotNumber, Finite] = Field(default_factory=dict)
    """Shot -> by what the recoiling mass changes from that shot on, kg; the shot log does not tell."""
    configurations: dict[ShotNumber, Configuration] = Field(default_factory=dict)
    """Shot -> the configuration that the shot log states from that shot on."""
    drifts: dict[str, Change] = Field(default_factory=dict)
    """Channel -> by what its gain has drifted at the last shot, linear in the shot's number from none at the first."""
    outliers: dict[ShotNumber, dict[str, Change]] = Field(default_factory=dict)
    """Shot -> channel -> by what its gain is off in that shot alone."""

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        if self.added_mass_kg is None:
            if "u_added_mass_kg" in self.model_fields_set:
                raise ValueError("u_added_mass_kg is that of an added mass, of which there is none")
        elif self.u_added_mass_kg > LARGEST_U_OF_ADDED_MASS * self.added_mass_kg:
            most = LARGEST_U_OF_ADDED_MASS * self.added_mass_kg
            raise ValueError(f"u_added_mass_kg must be at most {most:g}, a fifth of the added mass")
        return self

    def check_shots(self, shots: int) -> None:
        """Check whether a campaign of so many shots can have all that is planned.

        Raises
        ------
        ValueError
            With everything that it cannot have.
        """
        dated = (
            ("mass step", self.mass_steps),
            ("configuration", self.configurations),
            ("outlier", self.outliers),
        )
        faults = [
            f"{what} at shot {number}: the campaign ends with shot {shots}"
            for what, planned in dated
            for number in sorted(planned)
            if number > shots
        ]
        if self.added_mass_kg is not None and shots < 2:
            faults.append("added mass: every second shot carries it, and there is only one")
        if self.drifts and shots < 2:
            faults.append("drift: it goes from the first shot to the last, and there is only one")
        if faults:
            raise ValueError("; ".join(faults))

    def draw(self, rig: Rig, shots: int, *, seed: int, campaign_seed: int) -> tuple[PlannedShot, ...]:
        """Draw what is left to chance, and say of each shot what it will be.

        Parameters
        ----------
        seed
            Seed of the first shot; the next has the next. It draws what scatters from shot to shot.
        campaign_seed
            Draws what the shots share.

        Raises
        ------
        RigError
            If a channel is not one of the rig's, or a shot's recoiling mass would not do.
        ValueError
            As `check_shots`.
        """
        self.check_shots(shots)
        settings = virtual_settings(rig)
        faults = self._faults_of_channels([c.name for c in rig.channels])
        if faults:
            raise RigError(rig.path, faults)
        scattering = [name for name, role in measured_roles(rig, settings).items() if role in _REPEATING]
        off_kg = self.u_added_mass_kg * float(generator(campaign_seed, "added mass").normal())
        drawn = tuple(self._shot(k + 1, shots, seed + k, off_kg, scattering) for k in range(shots))
        for shot in drawn:
            faults += shot.faults(rig, settings)
        if faults:
            raise RigError(rig.path, faults)
        return drawn

    def _shot(self, number: int, shots: int, seed: int, off_kg: float, scattering: list[str]) -> PlannedShot:
        carries = self.added_mass_kg is not None and number % 2 == 0
        weighed = (self.added_mass_kg or 0.0) if carries else 0.0
        told = [at for at in self.configurations if at <= number]
        gains: dict[str, float] = {}
        if self.repeatability:
            for name in scattering:
                gains[name] = 1.0 + self.repeatability * float(generator(seed, "repeatability", name).normal())
        for name, drift in self.drifts.items():
            gains[name] = gains.get(name, 1.0) * (1.0 + drift * (number - 1) / (shots - 1))
        for name, error in self.outliers.get(number, {}).items():
            gains[name] = gains.get(name, 1.0) * (1.0 + error)
        scatter = float(generator(seed, "friction scatter").normal()) if self.friction_scatter else 0.0
        return PlannedShot(
            plan=self,
            number=number,
            shots=shots,
            configuration=self.configurations[max(told)] if told else "",
            added_mass_kg=weighed,
            u_added_mass_kg=self.u_added_mass_kg if carries else 0.0,
            true_added_mass_kg=weighed + off_kg if carries else 0.0,
            mass_step_kg=math.fsum(kg for at, kg in self.mass_steps.items() if at <= number),
            charge=self.charges[(number - 1) % len(self.charges)] if self.charges else 1.0,
            friction_factor=1.0 + self.friction_scatter * scatter,
            gain_factors=MappingProxyType(gains),
        )

    def _faults_of_channels(self, known: list[str]) -> list[Fault]:
        named: list[KeyPath] = [("drifts", name) for name in self.drifts]
        named += [("outliers", str(at), name) for at, errors in self.outliers.items() for name in errors]
        return [
            Fault(("campaign", *key), f"no such channel; {did_you_mean(str(key[-1]), known)}", FaultCode.UNKNOWN)
            for key in named
            if key[-1] not in known
        ]


@dataclass(frozen=True)
class PlannedShot:
    """One shot of a planned campaign.

    Attributes
    ----------
    number, shots
        Number of the shot, from 1, and of all shots.
    added_mass_kg, u_added_mass_kg
        Added mass as weighed, and its standard uncertainty, for the shot log; 0 where nothing was added.
    true_added_mass_kg
        Mass that was really added.
    mass_step_kg
        Sum of the untold steps up to this shot.
    charge
        Factor of the peak breech pressure.
    friction_factor
        Factor on the packing friction that the campaign's shots share.
    gain_factors
        Channel -> factor on its gain, where it is not 1 by plan.
    """

    plan: CampaignPlan
    number: int
    shots: int
    configuration: str
    added_mass_kg: float
    u_added_mass_kg: float
    true_added_mass_kg: float
    mass_step_kg: float
    charge: float
    friction_factor: float
    gain_factors: Mapping[str, float]

    def m3_kg(self, m3_kg: float) -> float:
        """Return the true recoiling mass of this shot.

        Parameters
        ----------
        m3_kg
            Recoiling mass without steps, and without anything added.
        """
        return m3_kg + self.mass_step_kg + self.true_added_mass_kg

    def faults(self, rig: Rig, settings: TwinSettings | LineSettings) -> list[Fault]:
        """Return why a mechanism with this shot's recoiling mass cannot be simulated, if it cannot."""
        m3_kg = self.m3_kg(settings.m3_true or rig.mechanism.m3)
        where = f"campaign, shot {self.number}"
        if m3_kg <= 0:
            return [Fault((where,), f"the recoiling mass would be {m3_kg:g} kg", FaultCode.RANGE)]
        mechanism = replace(rig.mechanism, m3=m3_kg)
        if isinstance(settings, LineSettings):
            found = faults_of_line(mechanism, settings)
        else:
            found = faults_of_mass(mechanism, settings) + check_statics(mechanism, settings)
        return [replace(fault, parts=(f"{where}, {fault.parts[0]}", *fault.parts[1:])) for fault in found]

    def truth(self) -> dict[str, Any]:
        """Return what ``truth.json`` says of this shot's place in its campaign."""
        return {
            "added_mass_kg": self.true_added_mass_kg,
            "configuration": self.configuration,
            "campaign": {
                "shot": self.number,
                "shots": self.shots,
                "weighed_added_mass_kg": self.added_mass_kg,
                "u_added_mass_kg": self.u_added_mass_kg,
                "mass_step_kg": self.mass_step_kg,
                "charge": self.charge,
                "friction_factor": self.friction_factor,
                "gain_factors": dict(self.gain_factors),
                "plan": self.plan.model_dump(mode="json", exclude_unset=True),
            },
        }
