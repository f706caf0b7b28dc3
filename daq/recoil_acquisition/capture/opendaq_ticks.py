"""Channels of an openDAQ device, live and in a capture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from recoil_acquisition.capture.captured_ticks import open_ticks
from recoil_acquisition.capture.live_source import LiveChannel, LiveSource
from recoil_acquisition.capture.tick_signals import TickSignals
from recoil_acquisition.readers.captured import CapturedSource
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.streams.opendaq_packets import OpendaqDecoder


def opendaq_signals(source: LiveSource, channels: Sequence[LiveChannel]) -> TickSignals:
    """Return what decodes some channels of an openDAQ device."""
    del source
    return TickSignals(channels, OpendaqDecoder())


def open_opendaq(path: Path, source: CapturedSource, declared: Declarations) -> Recording:
    """Open what a capture has of an openDAQ device; errors as of `open_ticks`."""
    return open_ticks(path, source, declared.clock, OpendaqDecoder())
