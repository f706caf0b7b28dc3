"""The limits of all checks of a shot, in one table, each with its source.

Every check returns `Outcome`: a verdict, and a detail that gives the figure, the limit and what to do before
the next shot, in words for the person at the range.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from recoil_acquisition.measured import worded
from recoil_acquisition.shot.quality_check import Verdict

Outcome = tuple[Verdict, str]
NEVER = math.inf
"""Limit beyond which no figure is."""


@dataclass(frozen=True)
class Limit:
    """Limit of one check.

    Attributes
    ----------
    warn, fail
        Figures beyond which the verdict is ``warn``, and ``fail``.
    what
        Name of the figure that is limited, with its unit.
    source
        Source of the limit: a standard, a publication or a measurement.
    below
        Whether a figure is beyond a limit if it is below it.
    """

    warn: float
    fail: float
    what: str
    source: str
    below: bool = False

    def verdict(self, figure: float) -> Verdict:
        """Judge a figure; one that is no number warns."""
        if math.isnan(figure):
            return "warn"
        if self.below:
            return "fail" if figure < self.fail else "warn" if figure < self.warn else "ok"
        return "fail" if figure > self.fail else "warn" if figure > self.warn else "ok"

    def outcome(self, figure: float, text: str, remedy: str, *, unit: str = "", share: bool = False) -> Outcome:
        """Judge a figure, and say it with the limit that it is beyond and what to do, if it is.

        Parameters
        ----------
        figure
            Figure to judge, in the unit of the limits.
        text
            Sentence that gives the figure.
        remedy
            Rest of the sentence, from the punctuation mark behind the limit on.
        unit
            Unit of the limit as it is shown, with a space before it; empty for a number and a share.
        share
            Whether figure and limits are shares, so that the limit is shown in percent.
        """
        verdict = self.verdict(figure)
        if verdict == "ok":
            return "ok", text
        bound = self.fail if verdict == "fail" else self.warn
        shown = f"{100 * bound:g} %" if share else f"{bound:g}{unit}"
        return verdict, worded(text, f" (limit {shown}){remedy}")


LIMITS: Mapping[str, Limit] = MappingProxyType(
    {
        # levels
        "clipped_share": Limit(
            0.0, 0.02, "clipped samples of the pulse", "mass bias 1.2 % at 1.8 % clipped: synthetic recoil pulses"
        ),
        "flat_top": Limit(
            3.0, NEVER, "samples in a row at one extreme value", "more than chance makes of noise above the resolution"
        ),
        "offset_share": Limit(
            0.02, 0.10, "offset over peak", "an offset is corrected; a large one means a wrong zero"
        ),
        "signal_to_noise_db": Limit(
            30.0, 20.0, "peak over noise before the shot, dB", "MIL-STD-810H, 522.2: useful above 20 dB", below=True
        ),
        "filtered_signal_to_noise_db": Limit(
            40.0, 20.0, "rms of the pulse over noise, low-passed, dB", "40 dB for 1 % of mass; 522.2", below=True
        ),
        "baseline_share": Limit(
            0.0025, NEVER, "change of level or noise within the pre-trigger baseline over peak", "as for the zero shift"
        ),
        "zero_shift_share": Limit(
            0.0025, 0.05, "shift of the zero over peak", "1 % of the peak costs 12 % of the velocity 85 ms later"
        ),
        # losses
        "lost_share": Limit(0.0, 0.05, "lost samples", "what can be bridged or left out without a bias of the mass"),
        "longest_gap_s": Limit(0.0, 1e-2, "longest gap, s", "an eighth of a recoil"),
        "held_chance": Limit(
            1e-6, -NEVER, "runs of one value that noise makes in a record", "one record in a million", below=True
        ),
        "time_step_share": Limit(0.01, NEVER, "time step off the period", "usual in the repair of shock data"),
        # motion
        "carriage_excess": Limit(
            0.1, 0.25, "share of a carriage accelerometer's part in the recoil travel that the camera refutes",
            "2 is a turned sensor and moves the mass by 1.4 %: a quarter moves it by less than half its uncertainty",
        ),
        "velocity_share": Limit(
            0.05, 0.10, "velocity against the camera, or at rest, over its peak", "NASA and IEST practice for pyroshock"
        ),
        "impulse_share": Limit(
            0.02, 0.20, "impulse over momentum, less 1", "2 % is a gain that is off; 20 % is wiring, an area or a unit"
        ),
        "force_correlation": Limit(
            0.9, 0.0, "correlation of force and acceleration", "below 0 one of them is turned", below=True
        ),
        "redundant_gain": Limit(
            3.0, NEVER, "gain of a channel that repeats another, off 1, over its standard uncertainty", "one of 370"
        ),
        "skew_s": Limit(
            1e-4, NEVER, "time skew of force and acceleration, s", "200 us cost 0.2 % of the mass, 1 ms 5 %"
        ),
        # spectra
        "gap_depth_db": Limit(
            10.0, -NEVER, "depth of the gap below the ringing, dB", "below 6 dB no cut-off, to 10 dB a doubtful one",
            below=True,
        ),
        "ringing_share": Limit(
            0.05, NEVER, "rms of the ringing without a gap, over the peak", "less does not dilute the mass"
        ),
        "aliasing_db": Limit(
            40.0, -NEVER, "fall of the last octave below the ringing, dB", "MIL-STD-810H, 522.2: 50 dB", below=True
        ),
        "hum_share": Limit(
            0.002, 0.05, "amplitude of the mains' hum over peak", "a zero that is off by it at the onset, as zero shift"
        ),
        "slew_share": Limit(
            0.6, NEVER, "part of a flank at the largest rate", "a sine has 0.2 within 2 % of its largest rate"
        ),
        "noise_left_share": Limit(
            0.25, -NEVER, "noise at the peak over noise before the shot", "an amplifier that is full passes none",
            below=True,
        ),
        "srs_ratio_db": Limit(
            3.0, 6.0, "positive over negative shock response, dB", "usual in the validation of pyroshock data"
        ),
        # several shots
        "repeat_share": Limit(
            0.05, NEVER, "spread of the rigid body's peak over shots", "one lot spreads below 2 %: PTB 2020"
        ),
        # tracks
        "lost_frames_share": Limit(0.02, 0.20, "lost frames", "what the accelerometer carries the travel across"),
        "longest_frame_gap_s": Limit(
            2e-2, NEVER, "longest gap between frames, s", "the accelerometer carries the travel across, the camera not"
        ),
        "frame_rate_share": Limit(
            0.001, 0.5, "frame rate of the file against the declared one", "0.1 % is no clock; half is a playback rate"
        ),
        "repeated_share": Limit(
            0.0, 0.10, "repeated positions of those in motion", "published tracks: 1.4 % in the median, bad ones 56 %"
        ),
        "duplicated_share": Limit(
            0.002, NEVER, "duplicated pictures while nothing moves", "a few of them change nothing"
        ),
        "marker_noise": Limit(
            3.0, NEVER, "noise of 50 ms over that of the whole track", "blur and poor light raise it"
        ),
        "jump_sigma": Limit(
            8.0, NEVER, "second difference over its noise, where faster than the motion", "no mass moves so"
        ),
        "distance_sigma": Limit(
            3.0, NEVER, "distance of two marks on one body off its median, of its noise", "a rigid body keeps it"
        ),
        "held_frames": Limit(9.0, NEVER, "frames held at one value at an end", "noise never repeats"),
        "battery_m": Limit(1e-3, NEVER, "start against end position, m", "what a battery stop gives way"),
        "peak_locking": Limit(
            0.05, NEVER, "error that repeats with the pixel, pixels", "natural marks are tracked to 0.05 to 0.2 pixels"
        ),
        "residual_share": Limit(
            0.005, NEVER, "frames off the fused motion by more than 5 sigma", "chance gives 6e-7"
        ),
    }
)  # fmt: skip
"""Name of the check's figure -> its limit."""
