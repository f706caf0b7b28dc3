"""Several shots of one rig together: one cut-off for all of them, and whether they repeat."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from recoil_acquisition.shot import Verdict
from recoil_acquisition.store import read_shot
from recoil_identification.analysis import Options
from recoil_identification.default_method import default_method
from recoil_identification.filter_choice import campaign_choice, force_spectra
from recoil_identification.preparation import prepare
from recoil_processing.quality.repeatability import ShotPeaks, check_repeat_peaks
from recoil_processing.spectra.spectral_gap import ShotSpectrum
from recoil_rigs.rig import parse_rig

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
    StoreError, RigError, IdentificationError
        If a shot file cannot be read, or nothing can be identified from it.
    """
    if len(paths) < LEAST_SHOTS or options.cutoff_hz is not None:
        return dict.fromkeys(paths, options)
    spectra: dict[str, list[Mapping[str, ShotSpectrum]]] = {}
    rigs: dict[Path, str] = {}
    for path in paths:
        progress(path.name)
        shot = read_shot(path)
        rigs[path] = shot.rig_name
        rig = parse_rig(shot.rig_text, path, shot.databases or {}, refuse_doubts=False)
        if default_method(shot) == "calibrated":
            # a displacement has a low-pass of its own, and no spectrum to choose it by
            spectra.setdefault(shot.rig_name, []).append(force_spectra(prepare(shot, rig).recorded))
    chosen = {name: campaign_choice(shots) for name, shots in spectra.items() if len(shots) >= LEAST_SHOTS}
    return {path: replace(options, campaign=chosen.get(rigs[path])) for path in paths}


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
