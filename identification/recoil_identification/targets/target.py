"""Input of a target: one shot, its rig, the user's options.

A target is a function from a `Case` to a `recoil_identification.targets.target_result.TargetResult`. It refuses by
raising an IdentificationError where the channels are missing altogether; a number that is doubtful is a result with
reasons.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.measured import worded
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.estimate.rounding import in_kg
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_identification.shot.preparation import Prepared, prepare
from recoil_processing.shot.verdict.channel_quality import LEAST_SAMPLES
from recoil_processing.shot.verdict.mass_reasons import failed_checks
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.rig_tables import GAUGE_ROLES

LARGEST_APART = 3.0
"""Standard uncertainties of both by which a target's mass may differ from the shot's, whose data it shares."""


@dataclass(frozen=True, eq=False)
class Case:
    """One shot as a target meets it.

    Parameters
    ----------
    fired
        Shot with its alignments, and its rig.
    """

    fired: FiredShot
    options: Options = field(default_factory=Options)

    @cached_property
    def prepared(self) -> Prepared:
        """Channels on one grid, and the equation of motion as recorded; computed once.

        Raises
        ------
        IdentificationError
            As `recoil_identification.shot.preparation.prepare`.
        """
        return prepare(self.fired)

    @cached_property
    def identified(self) -> Identification:
        """The mass of the shot with all that was found on the way; computed once.

        Raises
        ------
        IdentificationError
            As `recoil_identification.shot.analysis.identify_shot`.
        """
        return identify_shot(self.fired, self.options)

    def with_agreeing_gauges(self) -> Case:
        """Leave out the gauges that the mass sets aside; itself where each pressure has one, or they agree.

        Raises
        ------
        IdentificationError
            As of `identified`.
        """
        if all(len(self.fired.rig.with_role(role)) < 2 for role in GAUGE_ROLES):
            return self
        shot, rig = self.fired.shot, self.fired.rig
        for gauge in self.identified.set_aside:
            shot, rig = shot.without_channel(gauge), rig.without_channel(gauge)
        return self if shot is self.fired.shot else Case(FiredShot(shot, rig), self.options)

    def doubts_of_the_mass(self) -> list[Reason]:
        """Say why the shot's mass is doubtful, and with it what rests on it or on the same accelerometer."""
        doubts = [
            reason.again(worded("the recoiling mass is doubtful: ", reason)) for reason in self.identified.reasons
        ]
        shift = self.identified.inertial.zero_shift
        if shift.demanded:
            text = worded("the zero of the recoil accelerometer shifted at the shot: ", shift.told, ".")
            doubts.append(Reason(ReasonCode.ZERO, "recoil_acceleration", text))
        return doubts

    def beside_the_shots_mass(self, mass_kg: float, u_kg: float) -> tuple[list[Note], list[Reason]]:
        """Say why a target's recoiling mass is not quite the shot's, as notes; as reasons where that is too far off."""
        shot = self.identified.chosen.estimate
        apart, its = mass_kg - shot.mass_kg, in_kg(shot.mass_kg, shot.u_kg)
        beside = f"m3 {in_kg(mass_kg, u_kg)} is off the mass of the shot, {its}, by {apart:+.2g} kg"
        # both rest on the same sensors, so that they may differ by less than if they did not
        u_apart = math.hypot(u_kg, shot.u_kg)
        if abs(apart) > LARGEST_APART * u_apart:
            text = f"{beside}, {abs(apart) / u_apart:.1f} standard uncertainties of both (limit {LARGEST_APART:g})."
            return [], [Reason(ReasonCode.AGREEMENT, "m3", text)]
        why = "it rests on a lower low-pass"
        return [Note(NoteCode.COMPARISON, "m3", f"{beside}: {why}; the mass of the shot is the one to take.")], []

    def failed_checks(self, *roles: str) -> list[Reason]:
        """Say which checks of the channels of some roles failed: what a sensor lost is in no uncertainty."""
        names = {channel.name for channel in self.fired.shot.channels.values() if channel.role in roles}
        return [reason for reason in failed_checks(self.fired.shot) if reason.about in names]

    def require_roles(self, *roles: str, purpose: str) -> None:
        """Refuse a shot that lacks channels, or whose channels have lost all that tells of it.

        Raises
        ------
        IdentificationError
            Naming every role that is missing.
        """
        missing = [role for role in roles if self.fired.shot.by_role(role) is None]
        if missing and not self.fired.rig.mechanism.carriage_roles:
            raise IdentificationError(
                f"{purpose}: is found of a gun, and the rig is one of {self.fired.rig.mechanism.words}",
                expected=", ".join(roles),
                remedy="ask for its mass, or for the target arx",
            )
        if missing:
            raise IdentificationError(
                f"{purpose}: no channel of role {', '.join(missing)}",
                expected=", ".join(roles),
                remedy="declare the channels and their roles in the rig file, and ingest the shot again",
            )
        self._require_samples(roles, purpose)

    def _require_samples(self, roles: Sequence[str], purpose: str) -> None:
        present: dict[str, int] = dict.fromkeys(roles, 0)
        for channel in self.fired.shot.channels.values():
            if channel.role in present:
                there = int(np.count_nonzero(np.isfinite(channel.measured)))
                present[channel.role] = max(present[channel.role], there)
        if lost := {role: there for role, there in present.items() if there < LEAST_SAMPLES}:
            raise IdentificationError(
                f"{purpose}: no sample of {', '.join(lost)} can be used",
                expected=f"{LEAST_SAMPLES} samples or more of {', '.join(roles)}",
                found=", ".join(f"{there} of {role}" for role, there in lost.items()),
                remedy="check their files, ranges and cables",
            )

    def require_symbols(self, *symbols: str, purpose: str) -> None:
        """Refuse a rig whose mechanism does not declare values that a target takes as known.

        Raises
        ------
        IdentificationError
            Naming every symbol that is missing.
        """
        missing = [symbol for symbol in symbols if math.isnan(getattr(self.fired.rig.mechanism, symbol))]
        if missing:
            raise IdentificationError(
                f"{purpose}: the rig's [mechanism] does not declare {', '.join(missing)}",
                expected=", ".join(symbols),
                remedy="add them to the rig file, SI units, and ingest the shot again",
            )
