"""Channels of a port in SI as its bytes pass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from recoil_acquisition.capture.live_source import LiveChannel, LiveSamples, LiveSource
from recoil_acquisition.devices.device import Block, Counters, interrupts
from recoil_acquisition.errors import MissingChannelError
from recoil_acquisition.frames.decoder import FrameDecoder
from recoil_acquisition.frames.values import decode_fields


class SerialSignals:
    """Channels of a port.

    Parameters
    ----------
    source
        Source with its framing.
    """

    def __init__(self, source: LiveSource, channels: Sequence[LiveChannel]) -> None:
        framing = source.framing
        if framing is None:
            raise ValueError(f"source '{source.name}' has no framing")
        known = {field.name for frame_type in framing.types for field in frame_type.fields}
        for channel in channels:
            if channel.signal not in known:
                raise MissingChannelError(channel.signal, tuple(sorted(known)), path=source.path)
        self._framing = framing
        self._channels = tuple(channels)
        self._fields = frozenset(channel.signal for channel in channels)
        self._decoder = FrameDecoder(framing)
        self._fed = 0
        self._latest_s = -np.inf

    def feed(self, block: Block) -> list[LiveSamples]:
        """Take the next block; return the samples that it completes."""
        if not block.is_data:
            if interrupts(block):
                self._decoder.interrupt(missing=True)
            return []
        host_s = block.host_ns / 1e9
        self._decoder.feed(block.payload, host_s)
        self._fed += len(block.payload)
        frames = self._decoder.take()
        if not frames.begins.size:
            return []
        series = decode_fields(self._framing, frames, self._fields)
        # a frame ended on the line before the bytes that came behind it in the same read
        times_s = host_s - (self._fed - frames.ends).astype(np.float64) * self._framing.byte_s
        times_s = np.clip(np.maximum.accumulate(times_s), self._latest_s, host_s)
        self._latest_s = float(times_s[-1])
        samples = []
        for channel in self._channels:
            found = series[channel.signal]
            if found.frames.size:
                values = found.values * channel.factor + channel.offset
                samples.append(LiveSamples(channel.name, times_s[found.frames], values))
        return samples

    def skip(self) -> None:
        """Note that bytes are missing: a half frame will not be completed."""
        self._decoder.interrupt(missing=True)

    def stamped_by(self, blocks: Sequence[Block]) -> str:
        """Return which clock stamped the frames: the ``sensor`` its own, or the ``host`` when it read."""
        del blocks
        return "host" if self._framing.device_time is None else "sensor"

    def unheard(self, channel: LiveChannel, counters: Counters) -> str:
        """Say why nothing of a channel may have come, and what to do."""
        skipped = "" if not counters.skipped_bytes else f"; {counters.skipped_bytes} bytes belong to no frame"
        return f"no frame holds {channel.signal}: check the framing and the baud rate{skipped}"
