"""Books of what a decoder gave: descriptions, faults, and each channel's samples by tick."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from recoil_acquisition.devices.described import DESCRIBED
from recoil_acquisition.devices.device import EVENT, event_of
from recoil_acquisition.streams.opendaq_packets import OpendaqDecoder
from recoil_acquisition.streams.tick_stream import StreamDescription, StreamFault


class StreamBook:
    """What blocks of one openDAQ device hold; `wrong` counts samples that are not the number of their tick."""

    def __init__(self):
        self.decoder = OpendaqDecoder()
        self.events, self.faults, self.descriptions = [], [], []
        self.gaps = defaultdict(list)
        self.samples = defaultdict(int)
        self.wrong = self.said = 0
        self._next = {}

    def take(self, block):
        if block is None:
            return
        if block.kind == EVENT:
            event = event_of(block)
            self.said += event.name == DESCRIBED
            self.events += [event] if event.name != DESCRIBED else []
            return
        for item in self.decoder.feed(block.payload):
            if isinstance(item, StreamFault):
                self.faults.append(item.problem)
            elif isinstance(item, StreamDescription):
                self.descriptions.append(item)
            else:
                self._note(item)

    def _note(self, item):
        channel = self.descriptions[-1].channels[item.channel]
        ticks = item.ticks
        if ticks is None:
            ticks = item.first_tick + channel.step * np.arange(len(item.raw))
            expected = self._next.get(channel.name)
            if expected is not None and expected != item.first_tick:
                self.gaps[channel.name].append(item.first_tick - expected)
            self._next[channel.name] = int(ticks[-1]) + channel.step
        self.wrong += int((item.raw != ticks.astype(item.raw.dtype)).sum())
        self.samples[channel.name] += len(item.raw)

    @property
    def names(self):
        return [event.name for event in self.events]
