"""The filters: every one of them linear and without phase, see `recoil_processing.filters.zero_phase_filter`.

===========================  ==================================================================================
`LowPass`                    the usual one: Butterworth, forward and backward
`ChannelFrequencyClass`      SAE J211-1 and ISO 6487, for reports that must be comparable
`KaiserLowPass`              finite: nothing spreads beyond a known reach
`WhittakerLowPass`           short and lossy records: weights instead of padding and bridges
`WienerFilter`               by the spectra of signal and noise, where no cut-off parts them
===========================  ==================================================================================

`filter_alike` passes the columns of one regression through one of them; `filter_channels` and
`filter_in_blocks` are for long tables.
"""

from __future__ import annotations

from recoil_processing.filters.butterworth import LowPass
from recoil_processing.filters.channel_frequency_class import ChannelFrequencyClass
from recoil_processing.filters.filter_blocks import filter_in_blocks
from recoil_processing.filters.filter_engine import filter_channels
from recoil_processing.filters.filtered import Filtered, filter_alike
from recoil_processing.filters.finite_filter import KaiserLowPass
from recoil_processing.filters.whittaker import WhittakerLowPass
from recoil_processing.filters.wiener import WienerFilter
from recoil_processing.filters.zero_phase_filter import FilterDescription, ZeroPhaseFilter

__all__ = [
    "ChannelFrequencyClass",
    "FilterDescription",
    "Filtered",
    "KaiserLowPass",
    "LowPass",
    "WhittakerLowPass",
    "WienerFilter",
    "ZeroPhaseFilter",
    "filter_alike",
    "filter_channels",
    "filter_in_blocks",
]
