"""Reasons against a mass by the camera, and notes for its reader."""

from __future__ import annotations

from collections.abc import Iterator

from recoil_acquisition.shot import Shot
from recoil_acquisition.usability import Reason, ReasonCode
from recoil_identification.calibration import Calibration
from recoil_identification.camera_rows import LATE
from recoil_identification.tracked_recoil import TrackedRecoil
from recoil_processing.alignment.align import INNOVATION_LIMITS, MOST_INFLATION, MOST_SET_ASIDE
from recoil_processing.noise import noise_sigma
from recoil_processing.shot.clocks.double_impulse import INFLATIONS
from recoil_processing.shot.verdict.mass_reasons import unused_channels
from recoil_rigs.rig import Rig

UNCHECKED = (
    "no accelerometer on the recoiling part was used: what it checks is not checked, the camera's scale and a skew of "
    "the recorder's channels among it"
)
LARGEST_SHIFT = 4.0
"""Standard uncertainties by which frames and forces may call for another offset of the clock than it was aligned by."""


def against_the_track(tracked: TrackedRecoil, calibration: Calibration) -> Iterator[Reason]:
    """Say what speaks against a mass by this camera track, one sentence each, with its limit."""
    found, clock = tracked.found, tracked.clock
    if found.inflation > MOST_INFLATION:
        more = " or more, for no more are tried," if found.inflation >= INFLATIONS[-1] else ""
        yield _of_track(
            f"camera track and forces do not show the same motion: {found.inflation:.0f} times the force's noise{more} "
            f"would be needed to explain the difference (limit {MOST_INFLATION:g})"
        )
    noise = noise_sigma(tracked.positions_m)
    if noise > 0 and (found.marker_sigma_m / noise) ** 2 > INNOVATION_LIMITS[1]:
        yield _of_track(
            f"the camera track is {1e3 * found.marker_sigma_m:.3g} mm off what the forces drive, its own noise is "
            f"{1e3 * noise:.3g} mm: a dropped frame, a wrong frame rate or a force that is wrong"
        )
    if found.set_aside > MOST_SET_ASIDE * (found.frames + found.set_aside):
        yield _of_track(f"{found.set_aside} of {found.frames + found.set_aside} frames contradict their neighbours")
    if not tracked.by_force:
        shift_s = calibration.inferred.value(LATE.name)
        apart = abs(shift_s) / max(clock.u_offset_s, 1e-9)
        if apart > LARGEST_SHIFT:
            yield _of_track(
                f"camera track and forces call for an offset of clock {clock.clock} {1e6 * shift_s:+.0f} us away, "
                f"{apart:.1f} of its standard uncertainties (limit {LARGEST_SHIFT:g})"
            )


def _of_track(text: str) -> Reason:
    return Reason(ReasonCode.TRACK, "recoil_displacement", text)


def notes_on_track(shot: Shot, rig: Rig, tracked: TrackedRecoil, calibration: Calibration) -> list[str]:
    """Say what a reader should know of a mass by this camera track although it does not make the result invalid."""
    notes = [UNCHECKED]
    if tracked.by_force:
        notes.append(
            f"clock {tracked.clock.clock} is aligned by camera track and forces, and its offset is found with the mass "
            f"(u {1e6 * calibration.inferred.u(LATE.name):.1f} us)"
        )
    ignored = [c for c in shot.quality if c.verdict == "fail" and c.channel in unused_channels(shot, rig)]
    return [*notes, *(f"not used: {c.channel}: {c.detail}" for c in ignored)]
