"""Systematic delays of a measuring chain: what is declared of them, and how well each is known.

A sample's stamp is late by the chain's delay: the physics was at ``stamp - delay``. A camera track whose
stamps are those of the shutter's opening is early, so that its delay is negative. All of it holds for motion
that is slow against the filter, the mount and the exposure, which is what clocks are aligned by.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

from recoil_processing.arguments import require_not_negative, require_positive
from recoil_processing.filters.analog_filter import AnalogLowPass, FilterType

ExposureStamp = Literal["start", "middle", "end"]

U_CORNER = 0.05
"""Relative standard uncertainty of an analogue filter's corner, from its components."""
U_MOUNT = 0.3
"""Relative standard uncertainty of a mount's delay: its damping is seldom known better."""
SLOWEST_ORDER = 8
"""Order of a Butterworth low-pass, the slowest anti-alias filter that is common."""
USUAL_ORDER = 4
"""Order of an anti-alias filter whose order is not declared."""
STAMP_SHARE = {"start": -0.5, "middle": 0.0, "end": 0.5}
"""Delay of a camera's stamps over the exposure: a moving mark's picture is where the mark was in the middle of it."""


@dataclass(frozen=True)
class DelayPart:
    """One cause of delay.

    Attributes
    ----------
    delay_s
        Delay by which stamps are late on account of this part.
    u_s
        Standard uncertainty.
    """

    cause: str
    delay_s: float
    u_s: float


@dataclass(frozen=True)
class Delay:
    """The delay of a chain.

    Attributes
    ----------
    parts
        Parts of the delay, independent of one another; none where nothing is declared.
    """

    parts: tuple[DelayPart, ...] = ()

    @property
    def delay_s(self) -> float:
        """By which stamps are late, seconds."""
        return math.fsum(part.delay_s for part in self.parts)

    @property
    def u_s(self) -> float:
        """Standard uncertainty of it, seconds."""
        return math.hypot(*(part.u_s for part in self.parts))

    def to_json(self, channel: str) -> list[dict[str, Any]]:
        """List the parts of one channel's delay in JSON types."""
        return [{"channel": channel, "cause": p.cause, "delay_s": p.delay_s, "u_s": p.u_s} for p in self.parts]


def sum_of(parts: Iterable[DelayPart | None]) -> Delay:
    """Add up what there is."""
    return Delay(tuple(part for part in parts if part is not None))


def declared_delay(delay_s: float, u_delay_s: float) -> DelayPart | None:
    """Take a delay as declared: of everything between the sensor and the stamp; None if it is exactly none."""
    return DelayPart("declared", delay_s, u_delay_s) if delay_s or u_delay_s else None


def filter_delay(
    cutoff_hz: float, kind: FilterType | None = None, order: int | None = None, u_delay_s: float | None = None
) -> DelayPart:
    """Delay of an anti-alias filter that has none declared.

    Parameters
    ----------
    cutoff_hz
        Frequency of the filter's -3 dB point.
    kind
        ``bessel`` or ``butterworth``. Without it the delay may be anything from none, where the recorder takes
        it out, to that of a Butterworth low-pass of order `SLOWEST_ORDER`: nothing is corrected, and
        the uncertainty is the root mean square of that range.
    order
        `USUAL_ORDER` if left out.
    u_delay_s
        Standard uncertainty; `U_CORNER` of the delay if left out.

    Raises
    ------
    ValueError
        If the filter is none, see `recoil_processing.filters.analog_filter.AnalogLowPass`.
    """
    if kind is None:
        slowest = AnalogLowPass(cutoff_hz, "butterworth", SLOWEST_ORDER).delay_s
        u = slowest / math.sqrt(3.0) if u_delay_s is None else u_delay_s
        return DelayPart("filter of unknown type", 0.0, u)
    delay = AnalogLowPass(cutoff_hz, kind, USUAL_ORDER if order is None else order).delay_s
    return DelayPart(f"{kind} filter", delay, U_CORNER * delay if u_delay_s is None else u_delay_s)


def mount_delay(resonance_hz: float, damping: float) -> DelayPart:
    """Delay of a sensor on an elastic mount, ``2 zeta / (2 pi fn)``: a second-order low-pass far below its resonance.

    Parameters
    ----------
    resonance_hz
        Undamped natural frequency fn.
    damping
        Damping ratio zeta.

    Raises
    ------
    ValueError
        If the frequency is not positive or the damping is negative.
    """
    require_positive(resonance_hz=resonance_hz)
    require_not_negative(damping=damping)
    delay = damping / (math.pi * resonance_hz)
    return DelayPart("mount", delay, U_MOUNT * delay)


def exposure_delay(exposure_s: float, stamp: ExposureStamp | None = None) -> DelayPart | None:
    """Delay of a camera's stamps against the middle of the exposure, where a moving mark's picture has its centre.

    Parameters
    ----------
    stamp
        Instant of the exposure that a frame's time is: ``start``, ``middle`` or ``end``. Left out, the start is taken,
        as most cameras stamp it; that it might be anything up to the middle is the standard uncertainty ``exposure / (2
        sqrt 3)``, the root mean square of that range.

    Returns
    -------
    DelayPart or None
        Delay of the stamps; None where they are known to be those of the middle.

    Raises
    ------
    ValueError
        If the exposure is negative, or the stamp is unknown.
    """
    require_not_negative(exposure_s=exposure_s)
    if stamp is None:
        cause = "half the exposure, stamps taken for its start"
        return DelayPart(cause, -0.5 * exposure_s, 0.5 * exposure_s / math.sqrt(3.0))
    if stamp not in STAMP_SHARE:
        raise ValueError(f"stamp must be start, middle or end, not {stamp!r}")
    share = STAMP_SHARE[stamp]
    return DelayPart("half the exposure", share * exposure_s, 0.0) if share and exposure_s else None
