"""The quantities of shots that were fired alike: mean, scatter and uncertainty of each, and how they run.

Shots are fired alike if configuration, charge and added mass are the same: another charge has another peak. The mean of
n shots has two parts: their scatter s over the root of n, of n - 1 degrees of freedom, and what the shots share
(JCGM 100:2008, 4.2.3 and 5.2.4), which no number of shots averages out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.estimate.budget import coverage_factor
from recoil_identification.shot.peaks import LABELS
from recoil_processing.noise import welch_satterthwaite

LEAST_SHOTS = 2
"""Shots below which there is no scatter."""


@dataclass(frozen=True)
class PeakOfShots:
    """A quantity of shots that were fired alike.

    Attributes
    ----------
    quantity
        Name of the quantity, as reports have it, its unit in it.
    kind
        Description of how the shots were fired.
    shots
        Names of the shots, in the order in which they were fired.
    values
        Value of each of them.
    us, us_shared
        Standard uncertainty of each, and its part that the shots share; empty where a report of them states none.
    """

    quantity: str
    kind: str
    shots: tuple[str, ...]
    values: tuple[float, ...]
    us: tuple[float, ...] = ()
    us_shared: tuple[float, ...] = ()

    @property
    def mean(self) -> float:
        """Mean of the shots."""
        return math.fsum(self.values) / len(self.values)

    @property
    def scatter(self) -> float | None:
        """Standard deviation from shot to shot, as the shots have it; None of a single one."""
        return float(np.std(self.values, ddof=1)) if len(self.values) >= LEAST_SHOTS else None

    @property
    def u(self) -> float | None:
        """Standard uncertainty of the mean; None where a report states no uncertainty."""
        parts = self._parts
        return None if parts is None else math.hypot(*(u for u, _ in parts))

    @property
    def degrees_of_freedom(self) -> float:
        """Effective degrees of freedom of `u`; infinite where the shots do not scatter."""
        return welch_satterthwaite(self._parts or ())

    @property
    def expanded(self) -> float | None:
        """Half the width of the interval of 95 % coverage."""
        return None if self.u is None else coverage_factor(max(self.degrees_of_freedom, 1.0)) * self.u

    @property
    def _parts(self) -> tuple[tuple[float, float], ...] | None:
        """Parts of `u`, each with its degrees of freedom."""
        if not self.us:
            return None
        n, shared = len(self.values), math.sqrt(float(np.mean(np.square(self.us_shared))))
        own = math.sqrt(max(float(np.mean(np.square(self.us))) - shared**2, 0.0))
        if self.scatter is None or self.scatter <= own:
            # no less than what each is known to be off by: few shots may lie together by chance
            return (shared, math.inf), (own / math.sqrt(n), math.inf)
        return (shared, math.inf), (self.scatter / math.sqrt(n), n - 1.0)


def peaks_of_shots(shots: Sequence[CampaignShot]) -> tuple[PeakOfShots, ...]:
    """Collect the quantities of shots by how they were fired, in the order of the quantities, then of the shots."""
    names = [name for name in LABELS if any(name in one.peaks for one in shots)]
    kinds = dict.fromkeys(fired_alike(one.log) for one in shots)
    found = []
    for name in names:
        for kind in kinds:
            of_it = [one for one in shots if fired_alike(one.log) == kind and name in one.peaks]
            if not of_it:
                continue
            known = all(name in one.peaks_u and name in one.peaks_u_shared for one in of_it)
            found.append(
                PeakOfShots(
                    name,
                    kind,
                    tuple(one.name for one in of_it),
                    tuple(one.peaks[name] for one in of_it),
                    tuple(one.peaks_u[name] for one in of_it) if known else (),
                    tuple(one.peaks_u_shared[name] for one in of_it) if known else (),
                )
            )
    return tuple(found)


def apart_percent(peaks: Sequence[PeakOfShots], order: Sequence[str]) -> Iterator[tuple[str, dict[str, float]]]:
    """Return of each quantity by how much each shot lies off the mean of those that were fired as it was.

    Parameters
    ----------
    order
        Names of all shots, as they were fired.

    Yields
    ------
    tuple of (str, dict of str to float)
        Name of the quantity in words, and percent of the mean by shot; as much as if the mean were known without the
        shot, so that shots of small groups count as those of large ones do.
    """
    for quantity in dict.fromkeys(one.quantity for one in peaks):
        found: dict[str, float] = {}
        for one in peaks:
            n = len(one.values)
            if one.quantity == quantity and n >= LEAST_SHOTS and one.mean:
                factor = 100.0 * math.sqrt(n / (n - 1.0))
                found |= {
                    shot: factor * (value / one.mean - 1.0) for shot, value in zip(one.shots, one.values, strict=True)
                }
        yield LABELS[quantity], {shot: found[shot] for shot in order if shot in found}


def fired_alike(row: Mapping[str, Any]) -> str:
    """Describe how a shot was fired, as its row of the shot log has it: shots of one description were fired alike."""
    configuration, charge = (str(row.get(key) or "").strip() for key in ("configuration", "charge"))
    added_kg = float(row.get("added_mass_kg") or 0.0)
    parts = [f"configuration {configuration}"] if configuration else []
    parts += [f"{added_kg:g} kg added" if added_kg else "nothing added"]
    parts += [f"charge {charge}"] if charge else []
    return ", ".join(parts)
