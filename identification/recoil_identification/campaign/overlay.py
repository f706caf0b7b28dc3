"""The curves of a campaign's shots, laid over one another at the onset of force."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.shot.firing_record import CURVE_POINTS, CURVES, Curves

MOST_SINGLE = 40
"""Shots whose curves are drawn one by one; of more, those that stand out and some of the others."""

LEAST_SHARE = 0.9
"""Share of the shots that must have a value: where shots drop out, the middle of those that are left jumps."""


@dataclass(frozen=True, eq=False)
class Envelope(ReadOnlyArrays):
    """Lowest, middle and highest of all shots at each instant, shapes (n,); NaN where too few have a value."""

    lowest: Array
    median: Array
    highest: Array


@dataclass(frozen=True, eq=False)
class Overlay(ReadOnlyArrays):
    """Curves of all shots on one grid.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
        Instants after the onset of force, s.
    single : mapping of str to Curves
        Curves by shot, as each was recorded.
    envelopes : mapping of str to Envelope
        Envelopes by the names of `CURVES`; empty where every shot is among the single ones.
    shots
        Number of shots that have curves.
    """

    times_s: Array
    single: dict[str, Curves]
    envelopes: dict[str, Envelope]
    shots: int


def overlay(curves: Iterable[tuple[str, Curves]], standing_out: Sequence[str] = ()) -> Overlay | None:
    """Lay curves over one another.

    Parameters
    ----------
    curves
        Curves of each shot that has some, with its name.
    standing_out
        Shots that are drawn in any case.

    Returns
    -------
    Overlay or None
        Curves to be drawn; None where no shot has curves.
    """
    by_shot = dict(curves)
    if not by_shot:
        return None
    names = list(by_shot)
    chosen = [name for name in names if name in standing_out][:MOST_SINGLE]
    others = [name for name in names if name not in chosen]
    # spread evenly over the campaign, its first and last among them
    spread = np.linspace(0, len(others) - 1, min(MOST_SINGLE - len(chosen), len(others)))
    kept = {*chosen, *(others[round(place)] for place in spread.tolist())}
    first = min(float(one.times_s[0]) for one in by_shot.values())
    last = max(float(one.times_s[-1]) for one in by_shot.values())
    times_s = np.linspace(first, last, CURVE_POINTS)
    envelopes = {}
    if len(kept) < len(names):
        for curve in CURVES:
            stack = np.array(
                [
                    np.interp(times_s, one.times_s, one.values[curve], left=np.nan, right=np.nan)
                    for one in by_shot.values()
                    if curve in one.values
                ]
            )
            known = np.isfinite(stack).mean(axis=0) >= LEAST_SHARE if stack.size else np.zeros(times_s.size, dtype=bool)
            if known.any():
                rows = np.full((3, times_s.size), np.nan)
                rows[:, known] = np.nanquantile(stack[:, known], [0.0, 0.5, 1.0], axis=0)
                envelopes[curve] = Envelope(*rows)
    return Overlay(times_s, {name: by_shot[name] for name in names if name in kept}, envelopes, len(names))
