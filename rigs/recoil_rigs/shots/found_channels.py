"""Contradictions between what a rig declares of a recorder's channels and what the recorder says of them itself."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from recoil_acquisition.errors import Fault, FaultCode, Row
from recoil_acquisition.quantities.quantity import find_unit
from recoil_acquisition.streams.tick_stream import TickChannel
from recoil_rigs.rig import ChannelSpec, Source
from recoil_rigs.tables.channel_table import range_si

SHARE = 0.01
"""Share of a range or a frequency by which both may differ: numbers are rounded."""
_RANGE = re.compile(r"([-+.0-9eE]+) (\S+) to ([-+.0-9eE]+) (\S+)")
_FREQUENCY = re.compile(r"([.0-9eE+]+) (k?Hz)")
_OFF = ("off", "false", "0")


def contradictions(source: Source, spec: ChannelSpec, found: TickChannel) -> Iterator[Fault]:
    """Yield what a recorder says otherwise than the rig, of one channel; its unit is compared elsewhere."""
    said, row = found.said, Row("channel", spec.name)
    limits, declared = _range_si(said), range_si(spec)
    if limits is not None and declared is not None and spec.sensor.sensitivity is None:
        (low, high), (lowest, highest) = limits, declared
        slack = SHARE * (highest - lowest)
        if low > lowest + slack or high < highest - slack:
            text = f"the recorder cuts off what lies beyond {said['Range']}, and the sensor's range is wider"
            yield Fault((row, "range"), f"{text}: set the one or the other", FaultCode.CONTRADICTION)
    filtered_hz, declared_hz = _frequency_hz(said), spec.sensor.filter_hz
    if filtered_hz is not None and declared_hz is not None and abs(filtered_hz / declared_hz - 1.0) > SHARE:
        text = f"the recorder filters at {filtered_hz:g} Hz, the rig takes off the delay of one at {declared_hz:g} Hz"
        yield Fault((row, "filter_hz"), f"{text}: set the one or the other", FaultCode.CONTRADICTION)
    if said.get("Neon/Stored", "").lower() in _OFF and (source.device or {}).get("storing"):
        text = "the recorder does not store it, and is to store: switch that on, or its file has no such channel"
        yield Fault((row, "signal"), text, FaultCode.CONTRADICTION)


def _range_si(said: Mapping[str, str]) -> tuple[float, float] | None:
    stated = _RANGE.fullmatch(said.get("Range", ""))
    unit = None if stated is None or stated[2] != stated[4] else find_unit(stated[2])
    if stated is None or unit is None:
        return None
    try:
        return unit.to_si(float(stated[1])), unit.to_si(float(stated[3]))
    except ValueError:
        return None


def _frequency_hz(said: Mapping[str, str]) -> float | None:
    stated = _FREQUENCY.fullmatch(said.get("LP_Filter_Freq", ""))
    try:
        return None if stated is None else float(stated[1]) * (1000.0 if stated[2] == "kHz" else 1.0)
    except ValueError:
        return None
