"""Each sensor's reading and noise in the pre-trigger baseline: over a season they show its drift."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.shot.onset import LEAST_LEVEL_SAMPLES
from recoil_processing.shot.signals import Offset, Signals
from recoil_rigs.shots.fired_shot import FiredShot


@dataclass(frozen=True)
class Baseline:
    """One sensor before one shot.

    Attributes
    ----------
    channel, role
    sensor
        Serial number of the sensor, or rig and channel where it has none.
    offset
        Mean reading, less what it should read at rest in battery; the mean reading itself where that is not known.
    noise
        Standard deviation of a sample; not a robust one, which moves by steps of the recorder and not with the noise.
    unit
        Unit of all numbers, SI.
    at_rest
        Reading that it should have; None where that is not known.
    """

    channel: str
    role: str
    sensor: str
    offset: float | None
    noise: float | None
    unit: str
    at_rest: float | None

    @classmethod
    def of_json(cls, stated: Mapping[str, Any]) -> Baseline:
        """Read it from ``report.json``.

        Raises
        ------
        KeyError, TypeError, ValueError
            If it is none.
        """

        def number(key: str) -> float | None:
            return None if stated[key] is None else float(stated[key])

        channel, role, sensor, unit = (str(stated[key]) for key in ("channel", "role", "sensor", "unit"))
        return cls(channel, role, sensor, number("offset"), number("noise"), unit, number("at_rest"))

    def to_json(self) -> dict[str, Any]:
        """Return its fields."""
        return asdict(self)


def baselines_of(
    fired: FiredShot, signals: Signals, camera: Channel | None, alignments: Mapping[str, ClockAlignment]
) -> tuple[Baseline, ...]:
    """List what the sensors of a shot read before it; nothing where the record has no pre-trigger baseline.

    Parameters
    ----------
    camera
        Camera's displacement on its own clock; None where there is none.
    alignments
        Alignments by clock.
    """
    first, last = signals.baseline_s
    return tuple(_baselines(fired, signals, camera, alignments)) if last > first else ()


def _baselines(
    fired: FiredShot, signals: Signals, camera: Channel | None, alignments: Mapping[str, ClockAlignment]
) -> Iterator[Baseline]:
    silent = (signals.times_s >= signals.baseline_s[0]) & (signals.times_s < signals.baseline_s[1])

    def baseline(channel: str, role: str, offset: float, noise: float, at_rest: float | None) -> Baseline:
        own = fired.channels[channel]
        serial = own.spec.sensor.serial or f"{fired.rig.name}/{channel}"
        mean, sigma = (number if math.isfinite(number) else None for number in (offset, noise))
        return Baseline(channel, role, serial, mean, sigma, own.recorded.unit, at_rest)

    for role, series in signals.series.items():
        at_rest = fired.rig.mechanism.at_rest.get(role)
        readings: list[tuple[str, Array, Offset]] = [
            (one.channel, one.samples, one.offset) for one in signals.gauges.get(role, ())
        ]
        if not readings:
            name = next(one.spec.name for one in fired.of_series(role) if one.spec.name not in signals.unused)
            readings = [(name, series, signals.offsets[role])]
        for name, samples, offset in readings:
            mean, noise = _moments(samples[silent])
            value = offset.value if at_rest is not None else mean
            yield baseline(
                name, fired.channels[name].recorded.role, value if math.isfinite(offset.u) else math.nan, noise, at_rest
            )
    alignment = None if camera is None else alignments.get(camera.time_base.clock)
    if camera is not None and alignment is not None and alignment.status != "failed":
        before = camera.measured[alignment.to_reference(camera.time_base.times_s) < signals.baseline_s[1]]
        yield baseline(camera.name, camera.role, *_moments(before), None)


def _moments(samples: Array) -> tuple[float, float]:
    """Return mean and standard deviation of what was recorded; NaN where that is too little."""
    present = samples[np.isfinite(samples)]
    if present.size < LEAST_LEVEL_SAMPLES:
        return math.nan, math.nan
    return float(present.mean()), float(present.std())
