"""Faults of a real range, put into the channels of an assembled shot before its clocks are aligned."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.shot.shot import Shot
from tests.builders.virtual_shots import VirtualShot, virtual_shot

Array = NDArray[np.float64]
Injected = Callable[[VirtualShot, Shot], Shot]

CAMERA = "recoil_displacement"
FULL_SCALE = {"acceleration": 5000.0, "angular_rate": 1.0, "pressure": 250e6, "displacement": 1.0}


@dataclass(frozen=True)
class RangeFault:
    """A fault: what is injected, and whether it is small enough that a valid result is expected now and then."""

    name: str
    inject: Injected


def range_faults(shot: Shot) -> list[RangeFault]:
    """List one fault after the other for all the channels that carry a role."""
    roles = [c.role for c in shot.channels.values() if c.role and c.role != "trigger"]
    sampled = [role for role in roles if role != CAMERA]
    return [
        *(RangeFault(f"zero shift {pct:g} %", shifted_zero(0.01 * pct)) for pct in (0.5, 1.0, 2.0, 3.0, -1.0)),
        *(RangeFault(f"{r} late {us} us", late(r, 1e-6 * us)) for r in sampled for us in (50, 200, 500)),
        *(RangeFault(f"acc clipped at {100 * p:.0f} %", clipped("recoil_acceleration", p)) for p in (0.95, 0.8, 0.5)),
        *(RangeFault(f"breech clipped at {100 * p:.0f} %", clipped("breech_pressure", p)) for p in (0.95, 0.8)),
        *(RangeFault(f"{r} frozen 10 ms", frozen(r, 0.01)) for r in roles),
        *(RangeFault(f"{r} spikes", spikes(r)) for r in roles),
        *(RangeFault(f"{r} gain {g:g}", scaled(r, g)) for r in roles for g in (1.03, 1.15, 0.5)),
        *(RangeFault(f"{r} polarity", scaled(r, -1.0)) for r in roles),
        *(RangeFault(f"{a} and {b} swapped", swapped(a, b)) for a, b in _alike(shot)),
        *(RangeFault(f"{r} block lost {ms} ms", lost(r, 1e-3 * ms)) for r in roles for ms in (2, 10)),
        RangeFault("foreign camera", foreign_camera()),
        RangeFault("still camera", still_camera()),
        RangeFault("record from 2 ms after the onset", begun_late(0.002)),
        RangeFault("record from 10 ms after the onset", begun_late(0.010)),
        *(RangeFault(f"{r} hum", hum(r)) for r in sampled),
    ]


def pairs(faults: list[RangeFault], count: int, seed: int = 0) -> Iterator[RangeFault]:
    """Draw pairs of faults."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        first, second = (faults[int(i)] for i in rng.choice(len(faults), 2, replace=False))
        yield RangeFault(f"{first.name} + {second.name}", _both(first.inject, second.inject))


def _both(first: Injected, second: Injected) -> Injected:
    return lambda virtual, shot: second(virtual, first(virtual, shot))


def _alike(shot: Shot) -> list[tuple[str, str]]:
    channels = [c for c in shot.channels.values() if c.role and c.role not in (CAMERA, "trigger")]
    return [(a.role, b.role) for a, b in combinations(channels, 2) if a.quantity == b.quantity]


def _of(shot: Shot, role: str) -> Channel:
    channel = shot.by_role(role)
    if channel is None:
        raise ValueError(f"the shot has no channel of role {role}")
    return channel


def changed(shot: Shot, role: str, change: Callable[[Array, Channel], Array]) -> Shot:
    channel = _of(shot, role)
    samples = change(np.array(channel.samples, dtype=np.float64), channel)
    return replace(shot, channels={**shot.channels, channel.name: replace(channel, samples=samples)})


def since_fired(virtual: VirtualShot, channel: Channel) -> Array:
    """Give instants since the first force, roughly where the channel is on another clock."""
    clocks = virtual.truth["clocks"]
    clock = clocks.get(channel.time_base.clock, {"drift": 0.0, "offset_s": 0.0})
    t = channel.time_base.times_s
    return np.asarray((1 + clock["drift"]) * t + clock["offset_s"] - float(virtual.truth["t_fire"]))


def shifted_zero(share: float) -> Injected:
    def inject(virtual: VirtualShot, shot: Shot) -> Shot:
        def change(s: Array, c: Channel) -> Array:
            return s + share * FULL_SCALE["acceleration"] * (since_fired(virtual, c) > 0.5e-3)

        return changed(shot, "recoil_acceleration", change)

    return inject


def late(role: str, by_s: float) -> Injected:
    def change(s: Array, c: Channel) -> Array:
        t = c.time_base.times_s
        return np.asarray(np.interp(t - by_s, t, s))

    return lambda _, shot: changed(shot, role, change)


def clipped(role: str, share: float) -> Injected:
    return lambda _, shot: changed(shot, role, lambda s, _c: np.minimum(s, share * np.nanmax(s)))


def frozen(role: str, for_s: float) -> Injected:
    def inject(virtual: VirtualShot, shot: Shot) -> Shot:
        def change(s: Array, c: Channel) -> Array:
            at = np.flatnonzero((since_fired(virtual, c) > 0.004) & (since_fired(virtual, c) < 0.004 + for_s))
            s[at] = s[at[0]]
            return s

        return changed(shot, role, change)

    return inject


def spikes(role: str, count: int = 8) -> Injected:
    def inject(virtual: VirtualShot, shot: Shot) -> Shot:
        def change(s: Array, c: Channel) -> Array:
            inside = np.flatnonzero((since_fired(virtual, c) > 0) & (since_fired(virtual, c) < 0.06))
            at = np.random.default_rng(3).choice(inside, count, replace=False)
            s[at] += 0.5 * np.nanmax(np.abs(s))
            return s

        return changed(shot, role, change)

    return inject


def scaled(role: str, gain: float) -> Injected:
    return lambda _, shot: changed(shot, role, lambda s, _c: gain * s)


def swapped(one: str, other: str) -> Injected:
    def inject(_: VirtualShot, shot: Shot) -> Shot:
        a, b = _of(shot, one), _of(shot, other)
        if a.samples.shape != b.samples.shape:
            # on other clocks: the declared roles are swapped
            swap = {a.name: replace(a, role=b.role), b.name: replace(b, role=a.role)}
        else:
            swap = {a.name: replace(a, samples=b.samples), b.name: replace(b, samples=a.samples)}
        return replace(shot, channels={**shot.channels, **swap})

    return inject


def lost(role: str, for_s: float) -> Injected:
    def inject(virtual: VirtualShot, shot: Shot) -> Shot:
        def change(s: Array, c: Channel) -> Array:
            s[(since_fired(virtual, c) > 0.006) & (since_fired(virtual, c) < 0.006 + for_s)] = np.nan
            return s

        return changed(shot, role, change)

    return inject


def foreign_camera() -> Injected:
    """Put the camera track of a shot with a shorter recoil in the place of this one's."""

    def inject(virtual: VirtualShot, shot: Shot) -> Shot:
        other = _of(virtual_shot(virtual.rig.name, 77, peak_pressure_pa=105e6).shot, CAMERA)
        own = _of(shot, CAMERA)
        return replace(shot, channels={**shot.channels, own.name: replace(other, name=own.name)})

    return inject


def still_camera() -> Injected:
    def change(s: Array, _: Channel) -> Array:
        return np.full_like(s, np.nanmedian(s[:50])) + 5e-5 * np.random.default_rng(1).standard_normal(s.size)

    return lambda _, shot: changed(shot, CAMERA, change)


def begun_late(after_s: float) -> Injected:
    """Lose everything that was recorded before the force had begun."""

    def inject(virtual: VirtualShot, shot: Shot) -> Shot:
        for channel in shot.channels.values():
            if channel.time_base.clock == shot.reference_clock and channel.role:

                def change(s: Array, c: Channel) -> Array:
                    s[since_fired(virtual, c) < after_s] = np.nan
                    return s

                shot = changed(shot, channel.role, change)
        return shot

    return inject


def hum(role: str) -> Injected:
    def change(s: Array, c: Channel) -> Array:
        return np.asarray(s + 0.02 * np.nanmax(np.abs(s)) * np.sin(2 * np.pi * 50.0 * c.time_base.times_s + 0.3))

    return lambda _, shot: changed(shot, role, change)
