"""The filters: every one of them linear and without phase, see `recoil_processing.filters.zero_phase_filter`.

===========================  ==================================================================================
`LowPass`                    the usual one: Butterworth, forward and backward
`ChannelFrequencyClass`      SAE J211-1 and ISO 6487, for reports that must be comparable
===========================  ==================================================================================

`filter_alike` passes the columns of one regression through one of them; `recoil_processing.filters.table` has those
that an identification can be given by name.
"""

from __future__ import annotations

from recoil_processing.filters.butterworth import ROWS_PER_CUTOFF, LowPass
from recoil_processing.filters.channel_frequency_class import ChannelFrequencyClass
from recoil_processing.filters.filtered import Filtered, filter_alike
from recoil_processing.filters.zero_phase_filter import FilterDescription, LowPassFilter, ZeroPhaseFilter

__all__ = [
    "ROWS_PER_CUTOFF",
    "ChannelFrequencyClass",
    "FilterDescription",
    "Filtered",
    "LowPass",
    "LowPassFilter",
    "ZeroPhaseFilter",
    "filter_alike",
]
