"""Channels of an OXYGEN recorder, live and in a capture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from recoil_acquisition.capture.captured_ticks import open_ticks
from recoil_acquisition.capture.live_source import LiveChannel, LiveSource
from recoil_acquisition.capture.tick_signals import TickSignals
from recoil_acquisition.readers.captured import CapturedSource
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.streams.oxygen_stream import OxygenDecoder


def oxygen_signals(source: LiveSource, channels: Sequence[LiveChannel]) -> TickSignals:
    """Return what decodes some channels of a recorder."""
    del source
    return TickSignals(channels, OxygenDecoder())


def open_oxygen(path: Path, source: CapturedSource, declared: Declarations) -> Recording:
    """Open what a capture has of a recorder; CorruptFileError if it is nothing."""
    return open_ticks(path, source, declared.clock, OxygenDecoder())
