"""Files of the readers of container formats, for the rules that every reader keeps."""

from __future__ import annotations

from daq.readers.reader import Declarations
from daq.readers.wav import WavReader
from tests.builders import container_files as build
from tests.contracts.reader_rules import Case

RECORDER = Declarations("dewetron")

CASES = (Case("wav", WavReader(), build.small_wave(), RECORDER, {"channel 1": (-1.0, 1.0), "channel 2": (-1.0, 1.0)}),)
