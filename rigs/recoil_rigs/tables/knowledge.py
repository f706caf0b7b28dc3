"""Knowledge of a shot's forces beside the gauges' certificates: the table ``[knowledge]`` of a rig file.

The momentum that projectile and charge carry away is the impulse of the breech's force, whatever its gauge reads:
``m_p v0 + b m_c v0``, with the muzzle velocity v0 and the charge's share b of it: a half while the projectile is in
the bore, and more by what flows out behind it (J. Corner, "Theory of the Interior Ballistics of Guns", 1950). And a
gauge that was shown a known load, or that reads a known one at rest before each shot, tells how it reads.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated

from pydantic import Field

from recoil_acquisition.errors import Fault, FaultCode
from recoil_acquisition.quantities.declaration import DeclaredTable, Finite, NotNegative, Positive, Text
from recoil_rigs.tables.channel_table import ChannelSpec


class ProjectileImpulse(DeclaredTable):
    """Projectile and charge, whose momentum is the impulse of the breech's force."""

    mass_kg: Positive
    """Mass of the projectile, kg."""
    u_mass_kg: NotNegative = 0.0
    """Standard uncertainty of `mass_kg`, kg."""
    muzzle_velocity_m_s: Positive
    """Muzzle velocity, m/s."""
    u_muzzle_velocity_m_s: NotNegative
    """Standard uncertainty of `muzzle_velocity_m_s` for a shot, m/s: how it scatters where it is not measured; the shot
    log's columns `muzzle_velocity_m_s` and `u_muzzle_velocity_m_s` state what was measured of each."""
    charge_kg: NotNegative = 0.0
    """Mass of the charge, kg."""
    u_charge_kg: NotNegative = 0.0
    """Standard uncertainty of `charge_kg`, kg."""
    gas_share: Positive = 1.5
    """Speed of the charge's gas on the whole, share of the muzzle velocity: a half until the projectile leaves, and
    more by what flows out behind it."""
    u_gas_share: NotNegative = 0.15
    """Standard uncertainty of `gas_share`."""

    @property
    def impulse_n_s(self) -> float:
        """Impulse of the breech's force, N s."""
        return self.muzzle_velocity_m_s * (self.mass_kg + self.gas_share * self.charge_kg)

    @property
    def u_rel(self) -> float:
        """Relative standard uncertainty of `impulse_n_s`."""
        return math.hypot(self.u_common_rel, self.u_own_rel)

    @property
    def u_common_rel(self) -> float:
        """Part of `u_rel` that is the same in all shots of a rig: by the masses and the gas."""
        parts = self.u_mass_kg, self.gas_share * self.u_charge_kg, self.charge_kg * self.u_gas_share
        return math.hypot(*parts) / (self.mass_kg + self.gas_share * self.charge_kg)

    @property
    def u_own_rel(self) -> float:
        """Part of `u_rel` that each shot has of its own: by the muzzle velocity."""
        return self.u_muzzle_velocity_m_s / self.muzzle_velocity_m_s

    def at(self, muzzle_velocity_m_s: float, u_muzzle_velocity_m_s: float | None) -> ProjectileImpulse:
        """Return it with the muzzle velocity that was measured of a shot.

        Parameters
        ----------
        u_muzzle_velocity_m_s
            Standard uncertainty of it; None where nothing states one: that of the rig stands then.
        """
        u_m_s = self.u_muzzle_velocity_m_s if u_muzzle_velocity_m_s is None else u_muzzle_velocity_m_s
        measured = {"muzzle_velocity_m_s": muzzle_velocity_m_s, "u_muzzle_velocity_m_s": u_m_s}
        return self.model_copy(update=measured)


class KnownLoad(DeclaredTable):
    """Load on a gauge that is known by another way: a dead weight, a precharge, a standard beside it."""

    channel: Text
    """Name of the gauge's channel."""
    known: Finite
    """Load, in the channel's unit."""
    u_known: Positive
    """Standard uncertainty of `known`, in the channel's unit; the gauge's own zero is in it."""
    read: Finite | None = None
    """Reading of the gauge under it, in the channel's unit; if left out, what it reads before each shot is taken."""

    def contradictions(self) -> Sequence[Fault]:
        """Return what is wrong with a load that is none."""
        if self.known == 0:
            return [Fault(("known",), "a load of 0 tells nothing of a scale", FaultCode.CONTRADICTION)]
        if self.read is not None and not self.read / self.known > 0:
            return [Fault(("read",), f"has another sign than known, {self.known:g}", FaultCode.CONTRADICTION)]
        return []


class Knowledge(DeclaredTable):
    """Knowledge of forces beside the gauges' certificates; none where the table is left out."""

    weighed_mass_kg: Positive | None = None
    """Mass at hand that is weighed and added to every second shot, kg: it tells a campaign the gauges' scales. The shot
    log states which shots carried it."""
    u_weighed_mass_kg: NotNegative | None = None
    """Standard uncertainty of `weighed_mass_kg`, kg; must be written with it."""
    projectile: ProjectileImpulse | None = None
    """Projectile and charge, see ``[knowledge.projectile]``."""
    load: Annotated[tuple[KnownLoad, ...], Field(strict=False)] = ()
    """Known loads, see ``[[knowledge.load]]``."""

    def contradictions(self) -> Sequence[Fault]:
        """Return what is wrong with a weight of which only one half is stated."""
        if (self.weighed_mass_kg is None) == (self.u_weighed_mass_kg is None):
            return []
        lacks, problem = (
            ("weighed_mass_kg", "is missing: `u_weighed_mass_kg` needs it")
            if self.weighed_mass_kg is None
            else ("u_weighed_mass_kg", "is missing: `weighed_mass_kg` needs it")
        )
        return [Fault((lacks,), problem, FaultCode.MISSING)]


KNOWLEDGE = "knowledge"
WEIGHT = ("weighed_mass_kg", "u_weighed_mass_kg")
"""Keys of the mass that is added to every second shot."""
NOTHING_KNOWN = Knowledge()
"""Knowledge of a rig file that states none."""


def faults_of_knowledge(knowledge: Knowledge, channels: Sequence[ChannelSpec]) -> Iterator[Fault]:
    """Check that what is known is of the rig's gauges; these are its sound channels."""
    if knowledge.projectile is not None and not any(one.role == "breech_pressure" for one in channels):
        problem = "needs a channel of role 'breech_pressure', whose impulse it is"
        yield Fault((KNOWLEDGE, "projectile"), problem, FaultCode.CONTRADICTION)
    gauges = {channel.name: channel for channel in channels if channel.quantity in ("pressure", "force")}
    for number, load in enumerate(knowledge.load):
        where = (KNOWLEDGE, "load", number, "channel")
        if load.channel not in gauges:
            problem = f"{load.channel!r} is no gauge of a force: {', '.join(gauges) or 'there is none'}"
            yield Fault(where, problem, FaultCode.VALUE)
        elif load.read is None and gauges[load.channel].role in ("breech_pressure", "brake_pressure"):
            problem = f"{load.channel!r} is taken for empty at rest, and its zero for what it reads: state `read`"
            yield Fault(where, problem, FaultCode.CONTRADICTION)
