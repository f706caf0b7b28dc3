"""Several shots of one rig together: one cut-off for all of them, and whether they repeat."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.shot import Verdict
from recoil_daq.fired import read_fired
from recoil_identification.analysis import Options
from recoil_identification.default_method import default_method
from recoil_identification.filter_choice import campaign_band_hz, campaign_choice, force_band_hz, force_spectra
from recoil_identification.preparation import prepare
from recoil_processing.quality.repeatability import ShotPeaks, check_repeat_peaks
from recoil_processing.spectra.cutoff import CutoffChoice
from recoil_processing.spectra.spectral_gap import ShotSpectrum

Progress = Callable[[str], None]

LEAST_SHOTS = 2
"""One shot is no campaign."""


def shared_options(
    paths: Sequence[Path], options: Options, *, progress: Progress = lambda _: None
) -> Mapping[Path, Options]:
    """Return the options of each shot file: with one cut-off for all shots of a rig, unless one is asked for.

    A rig with one shot, or none with a spectrum, leaves each shot to find its own.

    Parameters
    ----------
    options
        As asked for.
    progress
        Told each shot's name.

    Raises
    ------
    StoreError, ReadError, RigError, IdentificationError
        If a shot file or the shot log cannot be read, or nothing can be identified from it.
    """
    if len(paths) < LEAST_SHOTS or options.cutoff_hz is not None:
        return dict.fromkeys(paths, options)
    bands: dict[Path, ShotBand] = {}
    for path in paths:
        progress(path.name)
        bands[path] = shot_band(path)
    chosen: dict[str, tuple[CutoffChoice | None, float | None]] = {}
    for rig in {band.rig for band in bands.values()}:
        several = [band for band in bands.values() if band.rig == rig and band.spectra is not None]
        if len(several) >= LEAST_SHOTS:
            choice = campaign_choice([band.spectra or {} for band in several])
            mass_hz = campaign_band_hz([band.band_hz for band in several if band.band_hz is not None], choice)
            chosen[rig] = choice, options.mass_cutoff_hz or mass_hz
    found = {path: chosen.get(band.rig, (None, options.mass_cutoff_hz)) for path, band in bands.items()}
    return {path: replace(options, campaign=one, mass_cutoff_hz=mass_hz) for path, (one, mass_hz) in found.items()}


@dataclass(frozen=True)
class ShotBand:
    """What of a shot a common cut-off is chosen by.

    Attributes
    ----------
    spectra
        Of both sides of the equation of motion; None for a shot whose mass is the camera's: a displacement has a
        low-pass of its own, and no spectrum to choose it by.
    band_hz
        That the force fills.
    """

    rig: str
    spectra: Mapping[str, ShotSpectrum] | None = None
    band_hz: float | None = None


def shot_band(path: Path) -> ShotBand:
    """Return what of a shot file a common cut-off is chosen by; errors as of `shared_options`."""
    fired = read_fired(path)
    shot, rig = fired.shot, fired.rig
    if default_method(shot) != "calibrated":
        return ShotBand(shot.rig_name)
    recorded = prepare(shot, rig).recorded
    return ShotBand(shot.rig_name, force_spectra(recorded), force_band_hz(recorded))


def repeatability(documents: Sequence[Mapping[str, Any]]) -> dict[str, tuple[Verdict, str]]:
    """Judge, for each rig, whether the rigid body's peak repeats from shot to shot.

    Parameters
    ----------
    documents
        Reports, of one charge on each rig.

    Returns
    -------
    dict of str to (verdict, detail)
        By the rig's name, where it has at least two shots.
    """
    peaks: dict[str, list[ShotPeaks]] = {}
    for d in documents:
        figures = d["peak_acceleration"]
        if figures["recorded_m_s2"] is None:
            # no accelerometer recorded any
            continue
        peaks.setdefault(d["rig"], []).append(ShotPeaks(d["shot"], figures["recorded_m_s2"], figures["filtered_m_s2"]))
    return {rig: check_repeat_peaks(shots) for rig, shots in peaks.items() if len(shots) >= LEAST_SHOTS}
