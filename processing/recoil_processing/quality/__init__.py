"""All checks of one channel, one track or several shots, by name.

Each is a small function that returns ``(verdict, detail)``; the detail gives the figure, the limit and what to
do before the next shot, in words for the person at the range. All limits and their sources stand in
`recoil_processing.quality.limits.LIMITS`.
"""

from __future__ import annotations

from collections.abc import Sequence

from recoil_acquisition.shot import Verdict
from recoil_processing.quality.clipping_checks import check_clipping, check_flat_tops, check_out_of_band
from recoil_processing.quality.force_checks import check_braking, check_force_sign, check_impulse, check_skew
from recoil_processing.quality.frame_checks import check_duplicated_pictures, check_frame_rate
from recoil_processing.quality.level_checks import (
    check_baseline,
    check_filtered_noise,
    check_level_after,
    check_steady_baseline,
    check_zero_shift,
)
from recoil_processing.quality.limits import LIMITS, Limit, Outcome
from recoil_processing.quality.loss_checks import check_held, check_losses, check_time_steps
from recoil_processing.quality.marker_checks import (
    check_distance,
    check_jumps,
    check_marker_noise,
    check_peak_locking,
    check_residual,
)
from recoil_processing.quality.motion_checks import check_carriage, check_polarity, check_rest_to_rest, check_velocity
from recoil_processing.quality.repeatability import check_repeat_peaks
from recoil_processing.quality.spectral_checks import (
    check_aliasing,
    check_gap,
    check_hum,
    check_no_gap,
    check_srs_symmetry,
)
from recoil_processing.quality.track_quality import (
    check_battery,
    check_held_ends,
    check_lost_frames,
    check_repeated_frames,
)

__all__ = [
    "LIMITS",
    "Limit",
    "Outcome",
    "check_aliasing",
    "check_baseline",
    "check_battery",
    "check_braking",
    "check_carriage",
    "check_clipping",
    "check_distance",
    "check_duplicated_pictures",
    "check_filtered_noise",
    "check_flat_tops",
    "check_force_sign",
    "check_frame_rate",
    "check_gap",
    "check_held",
    "check_held_ends",
    "check_hum",
    "check_impulse",
    "check_jumps",
    "check_level_after",
    "check_losses",
    "check_lost_frames",
    "check_marker_noise",
    "check_no_gap",
    "check_out_of_band",
    "check_peak_locking",
    "check_polarity",
    "check_repeat_peaks",
    "check_repeated_frames",
    "check_residual",
    "check_rest_to_rest",
    "check_skew",
    "check_srs_symmetry",
    "check_steady_baseline",
    "check_time_steps",
    "check_velocity",
    "check_zero_shift",
    "worst",
]


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """Return the worst of several verdicts; ``ok`` for none."""
    return "fail" if "fail" in verdicts else "warn" if "warn" in verdicts else "ok"
