"""Repair of a channel before the equation of motion uses it, and what that leaves uncertain.

What an instrument did to its own samples is mended on them: drop-outs are masked, clipped tips are rebuilt
where the rule of `repairs.clipping` allows it, and masked where it does not, and gaps that no low-pass notices are
bridged. What it added to all of them is taken off on the grid, where the pre-trigger baseline is known: the mains' hum,
and the droop of an AC-coupled chain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_processing.gaps import runs_of
from recoil_processing.repairs.clipping import find_clipped, repair_clipping
from recoil_processing.repairs.droop import invert_droop
from recoil_processing.repairs.dropouts import find_drop_outs
from recoil_processing.repairs.hum import subtract_hum
from recoil_processing.repairs.repair import Repair, Repaired
from recoil_processing.repairs.short_gaps import bridge_short_gaps
from recoil_rigs.rig import ChannelSpec
from recoil_rigs.shots.assemble import shown_unit
from recoil_rigs.tables.channel_table import range_si

U_TIME_CONSTANT = 0.05
"""Relative standard uncertainty of a chain's time constant where none is declared: that of its components."""
EVENLY_STAMPED = ("dewetron",)
"""Kinds of source whose stamps are those of a converter; a bus or a port makes them late one by one."""
MOST_SPANS = 200
"""Stretches of time that are listed one by one."""


@dataclass(frozen=True, eq=False)
class ChannelRepair(ReadOnlyArrays):
    """One thing that was done to one channel of a shot.

    Attributes
    ----------
    repair
        Repair of the channel's own samples, or of the grid's.
    spans_s : ndarray, shape (n_runs, 2)
        First and last instant of every stretch that was touched, on the reference clock; none where it was all of it.
    """

    channel: str
    role: str
    repair: Repair
    spans_s: Array

    @classmethod
    def of(cls, channel: str, role: str, repair: Repair, times_s: Array) -> ChannelRepair:
        """Return the stretches of a repair whose samples were at the instants given, shape (n_samples,)."""
        runs = [] if repair.kind.throughout else runs_of(repair.flags)
        spans = [(times_s[start], times_s[stop - 1]) for start, stop in runs]
        return cls(channel, role, repair, np.array(spans, dtype=np.float64).reshape(-1, 2))

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types."""
        document = self.repair.to_json()
        return {
            "channel": self.channel,
            "what": document["what"],
            "samples": f"{document['count']} of {document['of']}",
            "detail": self.repair.sentence,
            "count": document["count"],
            "of": document["of"],
            "figures": document["figures"],
            "spans_s": self.spans_s[:MOST_SPANS].tolist(),
        }


_MENDED: WeakKeyDictionary[Channel, tuple[ChannelSpec, str, Repaired]] = WeakKeyDictionary()
"""Channels that were mended already: clocks, checks and mass each begin with the same ones."""


def mend_samples(channel: Channel, spec: ChannelSpec, kind: str) -> Repaired:
    """Mask drop-outs, rebuild or mask clipped samples, and bridge short gaps; what was done once is remembered.

    Parameters
    ----------
    channel
        Channel as recorded.
    spec
        Channel of the rig, for the range of its sensor.
    kind
        Kind of the channel's source.
    """
    known = _MENDED.get(channel)
    if known is None or known[:2] != (spec, kind):
        known = _MENDED[channel] = spec, kind, _mended(channel, spec, kind)
    return known[2]


def _mended(channel: Channel, spec: ChannelSpec, kind: str) -> Repaired:
    samples = np.asarray(channel.samples, dtype=np.float64)
    limits = range_si(spec)
    clipped = None if limits is None else find_clipped(samples, *limits)
    stamps = channel.time_base.stamps_s if kind in EVENLY_STAMPED else None
    drop_outs = find_drop_outs(samples, stamps, spared=None if clipped is None else clipped.flags)
    masked, repairs = drop_outs.mask(samples)
    mended, kept = Repaired(samples).then(masked, *repairs), None
    unit, own = shown_unit(spec)
    if limits is not None and clipped is not None and clipped.flags.any():
        tips, kept = repair_clipping(mended.samples, *limits, unit=unit, shown_in=own), clipped.flags
        mended = mended.then(tips.samples, *tips.repairs)
    step_s = channel.time_base.step_s
    if step_s is None:
        return mended
    bridged = bridge_short_gaps(mended.samples, step_s, kept=kept, unit=unit, shown_in=own)
    return mended.then(bridged.samples, *bridged.repairs, left=bridged.left)


_LEVELLED: WeakKeyDictionary[Channel, tuple[tuple[ChannelSpec, float, float], Array, Flags, Repaired]]
_LEVELLED = WeakKeyDictionary()
"""Series that were made last of each channel, with what they were made of: the second look at a shot has the same
grid."""


def level_samples(
    channel: Channel, samples: Array, step_s: float, in_baseline: Flags, spec: ChannelSpec, noise: float
) -> Repaired:
    """Take hum and droop off a channel's series on the grid; what was done last is remembered with the channel.

    The level at rest is still in what is returned.

    Parameters
    ----------
    channel
        Channel as recorded.
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN, and some of the pre-trigger baseline is there.
    in_baseline : ndarray of bool, shape (n,)
        Samples of the pre-trigger baseline.
    spec
        Channel of the rig, for its sensor's time constant.
    noise
        Standard deviation per sample in the pre-trigger baseline.
    """
    known, numbers = _LEVELLED.get(channel), (spec, step_s, noise)
    if (
        known is None
        or known[0] != numbers
        or not np.array_equal(known[1], samples, equal_nan=True)
        or not np.array_equal(known[2], in_baseline)
    ):
        made = _levelled(samples, step_s, in_baseline, spec, noise)
        known = _LEVELLED[channel] = numbers, samples, in_baseline, made
    return known[3]


def _levelled(samples: Array, step_s: float, in_baseline: Flags, spec: ChannelSpec, noise: float) -> Repaired:
    done = Repaired(samples)
    hum = subtract_hum(samples, 1.0 / step_s, in_baseline, unit=SI_UNITS[spec.quantity])
    if hum.lines:
        done = done.then(hum.samples, *hum.repairs, left={"hum": hum.quadrature[np.newaxis]})
    constant_s = spec.sensor.time_constant_s
    if constant_s is not None:
        baseline = done.samples[in_baseline & np.isfinite(samples)]
        u_constant_s = spec.sensor.u_time_constant_s
        droop = invert_droop(
            done.samples,
            step_s,
            constant_s,
            float(np.mean(baseline)),
            u_time_constant_s=U_TIME_CONSTANT * constant_s if u_constant_s is None else u_constant_s,
            u_rest=noise / max(np.sqrt(baseline.size), 1.0),
            noise=noise,
        )
        done = done.then(droop.samples, droop.repair, left={"droop": droop.by_constant[np.newaxis]})
    return done
