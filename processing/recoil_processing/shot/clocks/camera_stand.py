"""Where a camera stands: on the ground or with the tipping part, as its rig says or as its frames do.

What a camera sees of the recoil differs by the carriage's motion. So a track that fits the one stand badly, and the
other as well as its noise allows, tells that the rig file has the wrong one, and says nothing against its clock.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.motion_fit import MotionFit
from recoil_rigs.rig import Rig

OTHERWISE_FROM = 64.0
"""Factor on the noise of what the track is compared with, from which on the other stand is tried."""
LIKELIER = 50.0
"""Log-likelihood that the other stand must gain: a carriage accelerometer that is mounted turned gains some 35 for a
camera on the ground, which needs none, and a camera that does stand there 65 and more."""
SEES = "sees"
"""Key of an alignment's details under which the stand is that the frames tell, where the rig says another."""
Aligned = tuple[MotionFit | str, ClockAlignment]
"""Fit of a track by its motion, and how it was judged."""

_TOLD = {
    "ground": "over the ground, and not along the tipping part",
    "tipping_part": "along the tipping part, and not over the ground",
}


def by_its_stand(rig: Rig, clock: str, own: Aligned, by: Callable[[Rig], Aligned]) -> ClockAlignment:
    """Return the alignment of a camera, ``ambiguous`` for its stand alone where the other one explains it far better.

    Parameters
    ----------
    rig
        Rig, which says where the camera stands.
    clock
        Clock of the camera.
    own
        Fit and alignment by what the rig says.
    by
        Function that fits and judges the same track by another rig.
    """
    fit, judged = own
    inflation = (judged.details or {}).get("noise_inflation", 0.0)
    spec = rig.by_role("recoil_displacement")
    if spec is None or rig.source(clock).kind != "camera" or spec.source != clock:
        return judged
    if judged.status == "ok" and inflation < OTHERWISE_FROM:
        return judged
    elsewhere = rig.with_camera_on_ground(not rig.camera_on_ground)
    other_fit, other = by(elsewhere)
    if other.status != "ok" or isinstance(other_fit, str):
        return judged
    gain = math.inf if isinstance(fit, str) else other_fit.best_log_likelihood - fit.best_log_likelihood
    if gain <= LIKELIER:
        return judged
    sees = str(elsewhere.source(clock).sees)
    text = (
        f"the frames of {clock} show the recoiling part's motion {_TOLD[sees]}"
        + ("" if math.isinf(gain) else f" (log-likelihood higher by {gain:.0f}, limit {LIKELIER:g})")
        + f': write `sees = "{sees}"` in its [[source]]'
    )
    return replace(other, status="ambiguous", reasons=(text,), details={**(other.details or {}), SEES: sees})


def contradicts_stand(alignment: ClockAlignment) -> bool:
    """Return whether the frames tell another stand of the camera than the rig does."""
    return SEES in (alignment.details or {})
