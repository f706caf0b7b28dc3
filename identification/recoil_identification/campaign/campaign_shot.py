"""One shot as a campaign takes it: what its report says, and what was written of it in the shot log."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from recoil_acquisition.measured import beside, with_figures
from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.quality_check import Check
from recoil_identification.shot.baseline import Baseline
from recoil_identification.shot.shot_summary import ShotSummary
from recoil_rigs.tables.calibration_day import CalibrationDay
from recoil_rigs.tables.specification import Specification

JUDGED_TOGETHER = "used: what speaks against it alone, all shots together judge better"
"""Sentence about a shot whose own mass is not valid, and that a campaign uses."""
SUMMARISED = "calibrated"
"""The method whose mass the summary of a report is of."""
ROUNDING = 1e-6
"""Share by which a mass may differ from that of its summary and still be the same."""
LARGEST_PULL = 3.29
"""Standard uncertainties of a shot's own mass beyond which it does not agree with the others."""


@dataclass(frozen=True, eq=False)
class CampaignShot:
    """One shot.

    Attributes
    ----------
    started
        Time at which it was fired, ISO 8601; None where nothing tells.
    mass_kg, u_kg
        Mass by the shot alone, with what was added to it, and its standard uncertainty.
    configuration
        Description of how the mechanism was built; empty where nobody said.
    added_mass_kg, u_added_mass_kg
        Mass that was added, as weighed, and its standard uncertainty; negative if it was taken off.
    summary
        Summary of the shot; None where its report has none.
    cutoff_hz
        Cut-off of the rows that the summary stands for; None where these have passed no low-pass.
    excluded
        Reason of the shot log against its use; empty if nothing.
    log
        The shot's row of the shot log, cells by column.
    peaks, peaks_u, peaks_u_shared
        Largest values of the shot, their standard uncertainties, and the parts of these that shots share; units in the
        names. Only what its report states.
    baseline
        Reading of each sensor before the shot, and its noise.
    assumptions
        Assumptions of the shot's report.
    valid, reasons
        Verdict of the shot's own report on its mass. A campaign may use a shot that is not valid by itself: see `use`.
    changes
        Whether its own report says that the mass changes within the shot.
    specification
        Specification of the rig that it was identified with, without what was added; None where its report does not
        say.
    issued
        Identity of its report, and the tolerance of the mass.
    channels, constants
        Chains of its channels, and constants of its rig, as its report states them.
    calibration_day
        Day by which its calibrations are judged; None where its report states neither that nor a start.
    previews
        Sources of which it had what was read live alone: their instruments' own files were to come.
    """

    name: str
    rig: str
    started: str | None
    mass_kg: float
    u_kg: float
    summary: ShotSummary | None
    cutoff_hz: float | None = None
    configuration: str = ""
    added_mass_kg: float = 0.0
    u_added_mass_kg: float = 0.0
    excluded: str = ""
    log: Mapping[str, Any] = field(default_factory=dict)
    peaks: Mapping[str, float] = field(default_factory=dict)
    peaks_u: Mapping[str, float] = field(default_factory=dict)
    peaks_u_shared: Mapping[str, float] = field(default_factory=dict)
    baseline: tuple[Baseline, ...] = ()
    assumptions: tuple[Mapping[str, Any], ...] = ()
    valid: bool = True
    reasons: tuple[str, ...] = ()
    changes: bool = False
    specification: Specification | None = None
    issued: Mapping[str, Any] = field(default_factory=dict)
    channels: tuple[Mapping[str, Any], ...] = ()
    constants: tuple[Mapping[str, Any], ...] = ()
    calibration_day: CalibrationDay | None = None
    previews: tuple[str, ...] = ()

    @classmethod
    def of_report(cls, document: Mapping[str, Any]) -> CampaignShot:
        """Read it from ``report.json``.

        Raises
        ------
        ValueError
            If the document is no report, or its summary is none.
        """
        try:
            mass, stated, log = document["mass"], document.get("campaign"), document.get("shot_log") or {}
            started, cutoff_hz = document.get("started"), None if stated is None else stated.get("cutoff_hz")
            shot = cls(
                name=str(document["shot"]),
                rig=str(document["rig"]),
                started=started,
                mass_kg=float(mass["value"]),
                u_kg=float(mass["u"]),
                summary=None if stated is None else ShotSummary.of_json(stated),
                cutoff_hz=cutoff_hz,
                configuration=str(log.get("configuration", "")),
                added_mass_kg=float(log.get("added_mass_kg", 0.0)),
                u_added_mass_kg=float(log.get("u_added_mass_kg", 0.0)),
                excluded=str(log.get("exclude", "")),
                log=dict(log),
                **{key: _numbers(document.get(key)) for key in ("peaks", "peaks_u", "peaks_u_shared")},
                baseline=tuple(Baseline.of_json(one) for one in document.get("baseline") or ()),
                assumptions=tuple(
                    {key: str(one[key]) for key in ("quantity", "taken", "detail")}
                    | beside(with_figures(str(one["taken"]), one))
                    for one in document.get("assumptions") or ()
                ),
                valid=document["valid"],
                reasons=tuple(str(one) for one in document["reasons"]),
                changes=(document.get("constancy") or {}).get("constant") is False,
                specification=_specification(mass, log),
                issued=dict(document.get("issued") or {}),
                channels=tuple(map(_channel, document.get("channels") or ())),
                constants=tuple(map(_constant, document.get("constants") or ())),
                calibration_day=CalibrationDay.of_report(document),
                previews=tuple(
                    str(one["about"]) for one in document.get("findings") or () if one["code"] == Check.PREVIEW
                ),
            )
        except (KeyError, TypeError, AttributeError, OverflowError) as error:
            raise ValueError(f"it is no report of a shot: {type(error).__name__}: {error}") from error
        if not isinstance(started, str | None) or not isinstance(cutoff_hz, float | int | None):
            raise ValueError(f"it started at {started!r}, with a cut-off of {cutoff_hz!r} Hz")
        if not isinstance(shot.valid, bool):
            raise ValueError(f"it is valid: {shot.valid!r}")
        if not all(map(math.isfinite, (*shot.peaks.values(), *shot.peaks_u.values(), *shot.peaks_u_shared.values()))):
            raise ValueError("it has a peak that is not finite")
        if not (
            math.isfinite(shot.mass_kg) and math.isfinite(shot.u_kg) and shot.mass_kg > max(shot.added_mass_kg, 0.0)
        ):
            raise ValueError(f"a mass of {shot.mass_kg} kg, u {shot.u_kg} kg, with {shot.added_mass_kg} kg added to it")
        if shot.summary is not None and mass.get("method") == SUMMARISED:
            stated_kg = shot.summary.mass_kg
            if not abs(shot.mass_kg / stated_kg - 1.0) <= ROUNDING:
                raise ValueError(f"a mass of {shot.mass_kg} kg, of which its summary says {stated_kg:.6f} kg")
        return shot

    @property
    def set_aside(self) -> str:
        """Why a campaign does not use it; empty if it does."""
        if self.excluded:
            return f"excluded in the shot log: {self.excluded}"
        if self.summary is None:
            return "its report has no summary for campaigns"
        return "; ".join(self.summary.against)

    @property
    def use(self) -> str:
        """Why a campaign uses it although its own report is not valid; empty if that is valid, or it is not used."""
        return "" if self.valid or self.set_aside else JUDGED_TOGETHER

    @property
    def geometry(self) -> Mapping[str, float]:
        """Values of the mechanism with which it was found; empty without a summary."""
        return {} if self.summary is None else self.summary.geometry


def _numbers(table: Mapping[str, Any] | None) -> dict[str, float]:
    """Return the numbers of a report's table by name; those that it leaves open are not in it."""
    return {str(name): float(value) for name, value in (table or {}).items() if value is not None}


def _specification(mass: Mapping[str, Any], log: Mapping[str, Any]) -> Specification | None:
    """Return the specification that a report compares with, less what its shot log added."""
    if mass.get("specification") is None or mass.get("u_specification") is None:
        return None
    kg, u_kg = float(mass["specification"]), float(mass["u_specification"])
    # earlier reports do not say of what it consists: all but what was added is of the rig file
    parts = mass.get("specification_of") or {}
    added_kg, carried_kg = float(log.get("added_mass_kg", 0.0)), float(parts.get("carried_mass_kg", 0.0))
    u_added_kg, u_carried_kg = float(log.get("u_added_mass_kg", 0.0)), float(parts.get("u_carried_mass_kg", 0.0))
    if not (math.isfinite(kg) and math.isfinite(u_kg) and kg > 0.0 <= u_kg):
        raise ValueError(f"a specification of {kg} kg, u {u_kg} kg")
    if not (math.isfinite(carried_kg) and math.isfinite(u_carried_kg) and carried_kg >= 0.0 <= u_carried_kg):
        raise ValueError(f"a specification with {carried_kg} kg carried along, u {u_carried_kg} kg")
    # to a microgram, which is what the sums of the masses are exact to
    u_m3_kg = math.sqrt(max(u_kg**2 - u_added_kg**2 - u_carried_kg**2, 0.0))
    return Specification(
        m3_kg=round(kg - added_kg - carried_kg, 9),
        u_m3_kg=round(u_m3_kg, 9),
        carried_kg=carried_kg,
        u_carried_kg=u_carried_kg,
    )


def _channel(stated: Mapping[str, Any]) -> dict[str, Any]:
    """Return the chain of a channel as a report states it; ValueError if something else stands there."""
    texts = ("channel", "role", "quantity", "unit", "signal", "clock", "recorder", "model", "serial", "certificate",
             "calibrated", "due")  # fmt: skip
    found: dict[str, Any] = {key: stated.get(key) for key in texts}
    ends, u = stated.get("range"), stated.get("u")
    if not all(isinstance(value, str | None) for value in found.values()) or not isinstance(u, float | int | None):
        raise ValueError(f"a channel {found['channel']!r} with something else where a text or its u belongs")
    low_high = None if ends is None else [float(end) for end in ends]
    if low_high is not None and len(low_high) != 2:
        raise ValueError(f"a channel {found['channel']!r} with a range of {len(low_high)} ends")
    further = {key: dict(stated.get(key) or {}) for key in ("known_by", "chain")}
    return {**found, "range": low_high, "u": u, **further}


def _constant(stated: Mapping[str, Any]) -> dict[str, Any]:
    """Return a constant of the mechanism as a report states it; ValueError or TypeError if it is none."""
    u = stated["u"]
    numbers = {"value": float(stated["value"]), "u": None if u is None else float(u)}
    return {"symbol": str(stated["symbol"]), **numbers, "meaning": str(stated["meaning"])}


def alike(shots: Sequence[CampaignShot]) -> dict[str, Any]:
    """Return what the identities of all shots' reports state alike, JSON types."""
    first = shots[0].issued if shots else {}
    return {key: value for key, value in first.items() if all(one.issued.get(key) == value for one in shots)}


def doubted_signs(shots: Sequence[CampaignShot]) -> list[Reason]:
    """Name the shots that agree with the others of their configuration if their added mass has the other sign."""
    found = []
    for shot in shots:
        others = [
            one.mass_kg - one.added_mass_kg
            for one in shots
            if one is not shot and one.configuration == shot.configuration
        ]
        added_kg = shot.added_mass_kg
        if not (others and 2 * abs(added_kg) > LARGEST_PULL * shot.u_kg):
            continue
        middle_kg = median(others)
        off_kg, other_off_kg = (abs(shot.mass_kg + sign * added_kg - middle_kg) for sign in (-1, 1))
        if other_off_kg <= LARGEST_PULL * shot.u_kg < off_kg:
            text = (
                f"shot {shot.name}: is the sign of its added mass right? With {-added_kg:+g} kg instead of "
                f"{added_kg:+g} kg it agrees with the others; correct `added_mass_kg` in the shot log"
            )
            found.append(Reason(ReasonCode.ADDED_SIGN, shot.name, text))
    return found


def in_order(shots: Sequence[CampaignShot]) -> tuple[CampaignShot, ...]:
    """Sort shots as they were fired: by time where each has one, else by name, numbers in it by their size."""
    timed = all(shot.started for shot in shots)
    return tuple(sorted(shots, key=lambda shot: ((shot.started or "") if timed else "", numbered(shot.name))))


def numbered(name: str) -> tuple[tuple[int, str], ...]:
    """Return a shot's name as what sorts 2 before 10."""
    return tuple((int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name))
