"""A shot by hand: one body on a rail, prescribed breech pressure, and Newton's law sample by sample.

Every sample of the noise-free shot keeps ``m a' = P - R_f`` exactly once the part is released, so that
what an estimator adds of its own can be told from rounding.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np

from recoil_acquisition.channel import Channel, RawCounts
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import MissingChannelError
from recoil_acquisition.readers.recording import SignalHeader
from recoil_acquisition.shot.shot import Shot
from recoil_acquisition.track import Track
from recoil_processing.double_integral import integrate
from recoil_processing.shot.regression import Regression, build_regression
from recoil_processing.shot.signals import Signals, collect_signals
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.shots.assemble import assemble_channels
from recoil_rigs.shots.fired_shot import FiredShot

MASS_KG = 782.0
BORE_M2, BRAKE_M2, RECUPERATOR_M2 = 0.00883, 0.0056, 0.0078
ELEVATION_RAD = 0.17
GRAVITY_M_S2 = 9.80665
FIRE_S = 0.03


def bench_rig(
    *,
    friction: float = 1500.0,
    u_friction: float = 150.0,
    pressure_unit: str = "Pa",
    u_rel: float = 0.005,
    **extra: str,
) -> Rig:
    """Make a rig of one recorder whose gauges read all forces in time.

    ``extra`` adds to a channel's sensor, by the channel's name, or ``tables``.
    """

    def channel(name: str, quantity: str, unit: str, role: str) -> str:
        sensor = f"u_rel = {u_rel}" + (f", {extra[name]}" if name in extra else "")
        if role == "recuperator_pressure" and "delay_s" not in sensor:
            sensor += ", delay_s = 0"
        return (
            f'[[channel]]\nname = "{name}"\nsource = "recorder"\nsignal = "{name}"\nquantity = "{quantity}"\n'
            f'unit = "{unit}"\nrole = "{role}"\nsensor = {{ {sensor} }}\n'
        )

    text = f"""
schema = "recoil-daq/rig/1"
name = "bench"
reference_clock = "recorder"
[mechanism]
m3 = {MASS_KG}
XA = 1.95
YA = 0.90
b = 0.80
d = 0.04
phi10 = 0.0
phi20 = {ELEVATION_RAD}
bore_area = {BORE_M2}
brake_area = {BRAKE_M2}
recuperator_area = {RECUPERATOR_M2}
bore_friction = 0
u_bore_friction = 0
unread_share = 0
u_unread_share = 0
unread_force = 0
friction = {friction}
u_friction = {u_friction}
[[source]]
name = "recorder"
kind = "dewetron"
"""
    text += channel("acc", "acceleration", "m/s2", "recoil_acceleration")
    for role in ("breech", "brake", "recuperator"):
        text += channel(f"p_{role}", "pressure", pressure_unit, f"{role}_pressure")
    return parse_rig(text + extra.get("tables", ""), Path("bench.toml"))


@dataclass(frozen=True, eq=False)
class BenchMotion:
    """What happens, SI, shape (n,) each; ``release`` is the first free sample."""

    times_s: np.ndarray
    acceleration_m_s2: np.ndarray
    breech_pa: np.ndarray
    brake_pa: np.ndarray
    recuperator_pa: np.ndarray
    travel_m: np.ndarray
    velocity_m_s: np.ndarray
    release: int


@cache
def bench_motion(rate_hz: float = 20_000.0, duration_s: float = 0.2, friction: float = 1500.0) -> BenchMotion:
    """Let the part recoil: the acceleration of each sample is that of the forces of the same sample."""
    step = 1.0 / rate_hz
    times = step * np.arange(round(duration_s * rate_hz))
    since = np.maximum(times - FIRE_S, 0.0)
    breech = 130e6 * np.exp(2.0) / 4.0 * (since / 2.5e-3) ** 2 * np.exp(-since / 2.5e-3)
    brake, recuperator, acceleration, travel, velocity = np.zeros((5, times.size))
    downhill = GRAVITY_M_S2 * math.sin(ELEVATION_RAD)
    x = v = 0.0
    release = -1
    for k in range(times.size):
        brake[k] = 1.0e5 * v * v + 6e6 * (1.0 - math.exp(-2.0 * v)) if v > 0 else 0.0
        recuperator[k] = 1.65e6 * (1.0 - 0.5 * x) ** -1.3
        slides = friction * (1.0 if v >= 0 else -1.0)
        force = breech[k] * BORE_M2 - brake[k] * BRAKE_M2 - recuperator[k] * RECUPERATOR_M2 - slides
        if release < 0 and force > 0:
            release = k
        acceleration[k] = force / MASS_KG if release >= 0 else -downhill
        travel[k], velocity[k] = x, v
        if release >= 0:
            v += step * (acceleration[k] + downhill)
            x += step * v
    return BenchMotion(times, acceleration, breech, brake, recuperator, travel, velocity, release)


def bench_shot(motion: BenchMotion | None = None, *, shift_s: float = 0.0, **samples: np.ndarray) -> Shot:
    """Make a shot of one clock; ``samples`` replaces channels."""
    motion = motion or bench_motion()
    base = TimeBase.uniform("recorder", shift_s, float(motion.times_s[1]), motion.times_s.size)
    channels = [
        Channel("acc", "acceleration", motion.acceleration_m_s2, base, "acc", "recoil_acceleration", 0.005),
        Channel("p_breech", "pressure", motion.breech_pa, base, "p_breech", "breech_pressure", 0.005),
        Channel("p_brake", "pressure", motion.brake_pa, base, "p_brake", "brake_pressure", 0.005),
        Channel("p_recuperator", "pressure", motion.recuperator_pa, base, "p_recuperator", "recuperator_pressure"),
    ]
    by_name = {c.name: replace(c, samples=samples[c.name]) if c.name in samples else c for c in channels}
    return Shot("b1", "bench", "", "recorder", by_name)


def bench_signals(shot: Shot | None = None, rig: Rig | None = None) -> Signals:
    """Bring a bench shot's signals onto their grid."""
    return collect_signals(FiredShot(shot or bench_shot(), rig or bench_rig()), {})


def bench_regression(shot: Shot | None = None, rig: Rig | None = None) -> Regression:
    """Set up both sides of the equation of motion of a bench shot, as recorded."""
    rig = rig or bench_rig()
    signals = bench_signals(shot, rig)
    acceleration = signals.series["recoil_acceleration"]
    downhill = GRAVITY_M_S2 * math.sin(ELEVATION_RAD)
    velocity = integrate(np.nan_to_num(acceleration + downhill), signals.step_s)
    return build_regression(signals, rig.mechanism, acceleration, velocity, -downhill)


@dataclass(frozen=True, eq=False)
class ArrayRecording:
    """An opened file that holds what it is given: numbers and the file's units by the signals' names."""

    numbers: Mapping[str, np.ndarray]
    units: Mapping[str, str] = field(default_factory=dict)
    counts: Mapping[str, RawCounts] = field(default_factory=dict)
    clock: str = "recorder"
    step_s: float = 5e-5
    path: Path = Path("file.csv")
    reader: str = "arrays"
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    incomplete: str = ""
    absolute_start: AbsoluteStart | None = None

    @property
    def signals(self) -> tuple[SignalHeader, ...]:
        return tuple(SignalHeader(n, self.units.get(n, ""), v.size) for n, v in self.numbers.items())

    def read(self, name: str, start: int = 0, stop: int | None = None) -> np.ndarray:
        if name not in self.numbers:
            raise MissingChannelError(name, list(self.numbers), path=self.path)
        return self.numbers[name][start:stop]

    def raw(self, name: str, start: int = 0, stop: int | None = None) -> RawCounts | None:
        counts = self.counts.get(name)
        return None if counts is None else replace(counts, counts=counts.counts[start:stop])

    def time_base(self, name: str) -> TimeBase:
        return TimeBase.uniform(self.clock, 0.0, self.step_s, self.numbers[name].size)

    def tracks(self) -> tuple[Track, ...]:
        return ()


def assembled_bench_shot(rig: Rig, numbers: Mapping[str, np.ndarray]) -> Shot:
    """Assemble a shot from numbers in the units that the rig declares."""
    return Shot(
        "b1", rig.name, rig.text, "recorder", assemble_channels(rig, {"recorder": ArrayRecording(numbers)}, "0")
    )
