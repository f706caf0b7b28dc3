"""Which low-pass both sides of the equation of motion pass, and why that one.

The cut-off is chosen from the data: where the spectra of the acceleration and of the force say that
motion and stress waves part (`recoil_processing.spectra.cutoff`). Several shots of one rig are given one cut-off
(`recoil_processing.spectra.campaign_cutoff`). Where no spectrum tells, a fixed one stands in, and the report says so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot.shot import Shot
from recoil_processing.filters import LowPass, LowPassFilter
from recoil_processing.filters.table import FILTERS, USUAL
from recoil_processing.gaps import bridge
from recoil_processing.shot.regression import MASS_ROLES, Regression
from recoil_processing.shot.thinned import thinned_beside
from recoil_processing.spectra.campaign_cutoff import campaign_cutoff
from recoil_processing.spectra.cutoff import CutoffChoice
from recoil_processing.spectra.spectral_gap import ShotSpectrum, shot_spectrum
from recoil_rigs.tables.rig_tables import FORCE_ROLES

Basis = Literal["given", "shot", "campaign", "default"]

DEFAULT_CUTOFF_HZ = 300.0
"""Stress waves of gun-size mechanisms ring above 900 Hz, the recoil pulse has little above 300 Hz."""
LARGEST_SHARE_OF_RATE = 0.2
"""A force that is sampled slowly cannot follow a higher cut-off."""
LARGEST_SHARE_OF_TUBE = 0.33
"""Cut-off of the fit of the mass over the tube's first mode along its axis: below a third."""
MASS_ENERGY = 0.99
"""Share of the force's energy below the cut-off of the fit of the mass: noise above it says nothing more of it."""

BAND = 1.6
"""Upper edge over lower edge of the bands in which both sides of the equation of motion are compared."""
SAMPLES_PER_PERIOD = 16
"""Samples that are kept per period of the highest frequency that is asked for, while they are compared."""
LEAST_COHERENCE = 0.9
"""Correlation of both sides in a band, below which one of them shows something else than the motion."""


@dataclass(frozen=True)
class FilterChoice:
    """A low-pass and why it was taken.

    Attributes
    ----------
    basis
        ``given`` by the user, from this ``shot``, from the ``campaign``, or the ``default``.
    cutoff
        Choice by the spectra; None where nobody asked them.
    reason
        Reason in words.
    """

    low_pass: LowPassFilter
    basis: Basis
    cutoff: CutoffChoice | None
    reason: str

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types; what is not a number is None."""
        said = self.cutoff
        figures = {} if said is None else {
            "spectra_hz": math.nan if said.cutoff_hz is None else said.cutoff_hz,
            "valley_hz": said.valley_hz,
            "shoulder_hz": said.shoulder_hz,
            "depth_db": said.depth_db,
            "predicted_error": said.predicted_error,
        }  # fmt: skip
        return {
            "cutoff_hz": self.low_pass.cutoff_hz,
            "half_order": self.low_pass.describe().order,
            "basis": self.basis,
            "confidence": None if said is None else said.confidence,
            "reason": self.reason,
            **{key: value if math.isfinite(value) else None for key, value in figures.items()},
            # of the usual filter its order says all
            **({} if isinstance(self.low_pass, LowPass) else {"description": self.low_pass.describe().to_json()}),
        }


def force_spectra(recorded: Regression) -> dict[str, ShotSpectrum]:
    """Return the spectra of both sides of the equation of motion around the onset, where they have one."""
    found = {}
    for name, column, quantity in (
        ("acceleration", recorded.acceleration_m_s2, "acceleration"),
        ("force", recorded.force_n, "force"),
    ):
        onset = int((recorded.times_s < recorded.interval_s[0]).sum())
        spectrum = shot_spectrum(column, recorded.rate_hz, onset_index=min(onset, column.size - 1), quantity=quantity)
        if not isinstance(spectrum, str):
            found[name] = spectrum
    return found


def campaign_choice(shots: Sequence[Mapping[str, ShotSpectrum]]) -> CutoffChoice | None:
    """Choose one cut-off for several shots of one rig from what `force_spectra` found; None if no shot has any."""
    names = sorted({name for spectra in shots for name in spectra})
    channels = {name: [spectra[name] for spectra in shots if name in spectra] for name in names}
    return campaign_cutoff(channels) if channels else None


def mass_filter(
    recorded: Regression, choice: FilterChoice, given_hz: float | None = None, tube_hz: float = 0.0
) -> LowPassFilter:
    """Return the low-pass of the fit of the mass: the force's own band, within that of the choice.

    A mass is one number, and the force tells it where the force has its energy; the trace over time and peaks need
    the rest of the band as well. No row reaches beyond the band in which both sides show the same motion. A cut-off
    that was asked for holds for both; where samples of the recoil are lost, a lower one would lose more around them.
    A tube that swings along its axis does what the force does, only more, far below its first mode alone.

    Parameters
    ----------
    given_hz
        One for all shots of a campaign; nothing else counts then but the tube, where the shot's rate allows it.
    tube_hz
        First mode of the tube along its axis; 0 where none is stated.
    """
    tube_hz = LARGEST_SHARE_OF_TUBE * tube_hz or math.inf
    if given_hz is not None and given_hz < 0.5 * recorded.rate_hz:
        return choice.low_pass.at(min(given_hz, tube_hz))
    if choice.basis == "given":
        return choice.low_pass
    lost = not recorded.trusted[recorded.inside].all()
    band_hz = (None if lost else force_band_hz(recorded)) or math.inf
    most_hz = min(band_hz, choice.low_pass.cutoff_hz, tube_hz)
    # however low that is, the rows must be enough
    coherent = max(coherent_hz(recorded, most_hz), recorded.stroke_rows / (2.0 * recorded.stroke_s))
    return choice.low_pass.at(min(coherent, choice.low_pass.cutoff_hz))


def coherent_hz(recorded: Regression, most_hz: float) -> float:
    """Return the highest frequency up to which both sides of the equation of motion show the same motion.

    Bands of the width `BAND` follow one another from two periods of the travel upward; the upper edge of the last one
    before the first in which the correlation of both sides within the travel is below `LEAST_COHERENCE`.

    Parameters
    ----------
    most_hz
        Frequency that is returned where they do throughout, and where the first band lies beyond it or shows that
        nothing can be told.
    """
    stride = max(int(recorded.rate_hz / (SAMPLES_PER_PERIOD * most_hz)), 1)
    sides = [bridge(one, otherwise=0.0) for one in (recorded.acceleration_m_s2, recorded.force_n)]
    if stride > 1:
        sides = [LowPass(BAND**2 * most_hz).apply(one, recorded.rate_hz)[::stride] for one in sides]
    rate_hz, inside = recorded.rate_hz / stride, recorded.inside[::stride]
    low_hz = 2.0 / recorded.stroke_s
    below = [LowPass(low_hz).apply(one, rate_hz)[inside] for one in sides] if low_hz < most_hz else []
    first_hz = low_hz
    while low_hz < most_hz and BAND * low_hz < LARGEST_SHARE_OF_RATE * rate_hz:
        within = [LowPass(BAND * low_hz).apply(one, rate_hz)[inside] for one in sides]
        a, f = (upper - lower for upper, lower in zip(within, below, strict=True))
        if a @ f < LEAST_COHERENCE * math.sqrt(max(float((a @ a) * (f @ f)), np.finfo(np.float64).tiny)):
            return low_hz if low_hz > first_hz else most_hz
        low_hz, below = BAND * low_hz, within
    return most_hz


def force_band_hz(recorded: Regression) -> float | None:
    """Return the frequency below which the force has nearly all its energy; None where it has it in one bin."""
    times_s, force = recorded.times_s, np.where(np.isfinite(recorded.force_n), recorded.force_n, 0.0)
    times_s, force = thinned_beside(times_s, force, recorded.force_rate_hz)
    force = force[(times_s >= recorded.interval_s[0]) & (times_s <= recorded.interval_s[1])]
    energy = np.cumsum(np.abs(np.fft.rfft(force, 4 * force.size)) ** 2)
    bin_hz = 1.0 / (float(times_s[1] - times_s[0]) * 4 * force.size)
    band_hz = bin_hz * float(np.searchsorted(energy, MASS_ENERGY * energy[-1]))
    return band_hz if band_hz > bin_hz else None


def campaign_band_hz(bands_hz: Sequence[float], choice: CutoffChoice | None) -> float | None:
    """Choose one cut-off for the mass of several shots: the middle one of their forces' bands, within the choice.

    It has three figures, so that it is the same however the shots' bands scatter in the last ones.
    """
    if not bands_hz:
        return None
    band_hz = float(np.median(bands_hz))
    if choice is not None and choice.cutoff_hz is not None and choice.confidence == "sure":
        band_hz = min(band_hz, choice.cutoff_hz)
    return float(f"{band_hz:.3g}")


def choose_filter(
    recorded: Regression, shot: Shot, *, kind: LowPassFilter = FILTERS[USUAL], given_hz: float | None = None,
    campaign: CutoffChoice | None = None,
) -> FilterChoice:  # fmt: skip
    """Choose the low-pass of one shot's regression.

    Parameters
    ----------
    recorded
        Regression as recorded.
    shot
        Shot, for the rates of the forces' channels.
    kind
        Filter whose cut-off is chosen.
    given_hz
        The user's own cut-off; nothing else counts then.
    campaign
        Chosen for several shots, this one among them.

    Raises
    ------
    IdentificationError
        If the user's own cut-off is not below half the rate.
    """
    if given_hz is not None:
        if not given_hz < 0.5 * recorded.rate_hz:
            raise IdentificationError(
                f"a cut-off of {given_hz:g} Hz needs more than {2 * given_hz:g} samples/s",
                found=f"{recorded.rate_hz:g} samples/s",
                remedy="ask for a lower one, or for none",
            )
        return FilterChoice(kind.at(given_hz), "given", None, f"{given_hz:g} Hz were asked for")
    basis: Basis = "shot" if campaign is None else "campaign"
    said = campaign_choice([force_spectra(recorded)]) if campaign is None else campaign
    of_mass = (*MASS_ROLES, *FORCE_ROLES, "recoil_velocity")
    rates = [c.time_base.rate_hz for c in shot.channels.values() if c.role in of_mass]
    slowest = min((rate for rate in rates if math.isfinite(rate)), default=math.inf)
    most_hz = LARGEST_SHARE_OF_RATE * slowest
    if said is not None and said.cutoff_hz is not None and said.confidence == "sure":
        if said.cutoff_hz <= most_hz:
            return FilterChoice(kind.at(said.cutoff_hz), basis, said, said.reason)
        reason = (
            f"the spectra would allow {said.cutoff_hz:.4g} Hz, but a force is sampled at {slowest:.4g} Hz only; "
            f"{said.reason}"
        )
        return FilterChoice(kind.at(most_hz), basis, said, reason)
    why = "the record allows no spectrum" if said is None else said.reason
    band_hz = recorded.bands * (force_band_hz(recorded) or 0.0)
    cutoff_hz = min(max(DEFAULT_CUTOFF_HZ, band_hz), most_hz, LARGEST_SHARE_OF_RATE * recorded.rate_hz)
    return FilterChoice(kind.at(cutoff_hz), "default", said, f"the fixed {cutoff_hz:g} Hz: {why}")
