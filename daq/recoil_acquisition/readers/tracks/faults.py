"""Faults of tracking in the positions of a camera's tracks: repeats, stuck features, held ends, jumps, markers.

These are facts of the file, noted with frame and count where it is read; whether a shot is usable in spite of
them is judged by the quality checks, in SI and beside the other instruments. Published tracks have all of them:
up to 56 % of exact repeats within the motion, ends that are held for hundreds of frames, and marks that jump by
24 mm within 0.5 ms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.normal_distribution import MAD_TO_SIGMA
from recoil_acquisition.readers.tracks.marker import SUSTAINED, find_marker, own_speed
from recoil_acquisition.readers.tracks.rest import rest_repeats
from recoil_acquisition.remark import Note, NoteCode, Remark

HELD_FRAMES = 9
"""Equal positions at an end of a track beyond which it is held: noise never repeats so often."""

SHOWN = 8
"""Frames that a note names."""

JUMP_SIGMA = 8.0
"""Noise multiples of a second difference beyond which a position is off its neighbours' line."""

FASTER = 1.5
"""Times the motion's own largest speed that no mark has for a single frame."""


LARGEST_POSITION = 1e100
"""Size of a position, in any unit, beyond which it is none, and differences overflow."""


@dataclass(frozen=True)
class TrackFaults:
    """Faults in the positions of a camera's tracks.

    Attributes
    ----------
    repeated_frames
        Frame numbers at which every feature is exactly where it was in the frame before.
    """

    repeated_frames: tuple[int, ...]
    notes: tuple[Remark, ...]


def find_track_faults(features: Mapping[str, Array], frames: NDArray[np.int64]) -> TrackFaults:
    """Find repeats, stuck features, held ends and jumps.

    Parameters
    ----------
    features : mapping of str to ndarray, shape (n_frames, n_axes)
        Positions by the feature's name; NaN where lost.
    frames : ndarray of int64, shape (n_frames,)
        Numbers of the frames.
    """
    if not features or frames.size < 2:
        return TrackFaults((), ())
    features = {name: _of_size(positions) for name, positions in features.items()}
    same = {name: _repeats(positions) for name, positions in features.items()}
    unseen = [np.isnan(positions).any(axis=1) for positions in features.values()]
    # a feature that is lost shows nothing; where all are lost there is nothing to repeat
    pictures = np.logical_and.reduce([s | u for s, u in zip(same.values(), unseen, strict=True)])
    # a repeat of what rests and has no noise is none of the picture
    rest = {name: rest_repeats(positions) for name, positions in features.items()}
    pictures &= np.logical_or.reduce([s & ~rest[name] for name, s in same.items()])
    notes: list[Remark] = []
    if pictures.any():
        text = f"repeated pictures (all features exactly as before): {shown_frames(frames[pictures])}"
        ends = np.logical_and.reduce([_in_ends(p, *_filled_ends(p, rest[n])) for n, p in features.items()])
        if (pictures & ends).any():
            text += f"; outside the held ends: {shown_frames(frames[pictures & ~ends])}"
        text += "" if len(features) > 1 else "; with one feature it may as well be stuck"
        notes.append(Note(NoteCode.TRACK, None, text))
    for name, positions in features.items():
        before, after = _filled_ends(positions, rest[name])
        lasting = {f"the first {before}": before, f"the last {after}": after}
        which = [text for text, count in lasting.items() if count > HELD_FRAMES]
        if which:
            last, first = int(frames[max(before - 1, 0)]), int(frames[frames.size - max(after, 1)])
            until = [f"to frame {last}"] * (before > HELD_FRAMES) + [f"from frame {first}"] * (after > HELD_FRAMES)
            text = (
                f"{name}: {' and '.join(which)} positions are held at one value ({', '.join(until)}): "
                "filled by the tracking software or out of the picture"
            )
            notes.append(Note(NoteCode.TRACK, name, text))
        inner = same[name] & ~rest[name] & ~pictures & ~_in_ends(positions, before, after)
        if inner.any():
            text = f"{name}: stuck (exactly as before while others move): {shown_frames(frames[inner])}"
            notes.append(Note(NoteCode.TRACK, name, text))
        marker = find_marker(positions, frames)
        if marker is not None:
            notes.append(Note(NoteCode.TRACK, name, f"{name}: lost frames seem to have a marker: {marker}"))
        jumps = find_jumps(frames, positions)
        if jumps.any():
            text = f"{name}: jumps, faster than the motion ever is: {shown_frames(frames[jumps])}"
            notes.append(Note(NoteCode.TRACK, name, text))
    return TrackFaults(tuple(int(n) for n in frames[pictures]), tuple(notes))


def shown_frames(numbers: Sequence[int] | NDArray[np.int64]) -> str:
    """Return how many frames there are, and the numbers of the first ones."""
    shown = ", ".join(str(int(n)) for n in numbers[:SHOWN])
    return f"{len(numbers)}, frames {shown}{' ...' if len(numbers) > SHOWN else ''}" if len(numbers) else "none"


def held_ends(positions: Array) -> tuple[int, int]:
    """Count the positions at the beginning and at the end that are exactly equal; 0 and 0 if none ever changes.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_axes)
        Positions; lost frames, NaN, are passed over and not counted.
    """
    seen = positions[~np.isnan(positions).any(axis=1)]
    changed = np.flatnonzero((np.diff(seen, axis=0) != 0).any(axis=1))
    if not changed.size:
        return 0, 0
    return int(changed[0]) + 1, int(seen.shape[0] - 1 - changed[-1])


def _filled_ends(positions: Array, rest: Flags) -> tuple[int, int]:
    """Count the positions of held ends, as `held_ends` does, but of one at which the mark rests none."""
    before, after = held_ends(positions)
    resting = rest[_repeats(positions)]
    if not resting.size:
        return before, after
    return before * (not resting[0]), after * (not resting[-1])


def _of_size(positions: Array) -> Array:
    """Return positions of which those that are larger than any are lost."""
    low, high = np.fmin.reduce(positions, axis=None, initial=0.0), np.fmax.reduce(positions, axis=None, initial=0.0)
    if low > -LARGEST_POSITION and high < LARGEST_POSITION:
        return positions
    return np.where(np.abs(positions) < LARGEST_POSITION, positions, np.nan)


def find_jumps(frames: NDArray[np.int64], positions: Array) -> Flags:
    """Find the frames to which a mark jumps: off its neighbours' line, and faster than the motion ever is.

    Parameters
    ----------
    frames : ndarray of int64, shape (n_frames,)
        Numbers of the frames, strictly increasing.
    positions : ndarray, shape (n_frames, n_axes)
        Positions, NaN where lost.

    Returns
    -------
    ndarray of bool, shape (n_frames,)
        Whether a jump ends at the frame; the way back of a single false position counts as none.
    """
    jumps = np.zeros(frames.size, dtype=bool)
    positions = _of_size(positions)
    # behind an exact repeat the mark catches up, which is no jump: what is repeated was not seen
    moved = ~_repeats(positions)
    for axis in positions.T:
        seen = np.flatnonzero(np.isfinite(axis) & moved)
        if seen.size < 4 * SUSTAINED:
            continue
        x, between = axis[seen], np.diff(frames[seen]).astype(np.float64)
        speed = np.diff(x)
        speed /= between
        sigma = MAD_TO_SIGMA * float(np.median(np.abs(np.diff(x, n=3)))) / 20**0.5
        least = 1e-9 * float(np.ptp(x))
        fast = np.abs(speed) > FASTER * own_speed(speed) + JUMP_SIGMA * 2**0.5 * sigma + least
        # few steps are fast, and only of those it matters how far they are off the line
        at = np.flatnonzero(fast)
        before = np.where(at > 0, at - 1, 1)
        bend = (speed[at] - speed[before]) * np.where(at > 0, np.minimum(between[at], between[before]), between[at])
        at = at[np.abs(bend) > JUMP_SIGMA * 6**0.5 * sigma + least]
        after = at[np.isin(at - 1, at)]
        back = after[np.abs(x[after + 1] - x[after - 1]) < 0.5 * np.abs(x[after] - x[after - 1])]
        jumps[seen[1:][np.setdiff1d(at, back)]] = True
    return jumps


def _repeats(positions: Array) -> Flags:
    """Return which frames are exactly as the frame before, shape (n_frames,)."""
    return np.concatenate([[False], (np.diff(positions, axis=0) == 0).all(axis=1)])


def _in_ends(positions: Array, before: int, after: int) -> Flags:
    """Return which frames belong to an end that is held, shape (n_frames,)."""
    flags = np.zeros(positions.shape[0], dtype=bool)
    seen = np.flatnonzero(~np.isnan(positions).any(axis=1))
    if before > HELD_FRAMES:
        flags[: seen[before - 1] + 1] = True
    if after > HELD_FRAMES:
        flags[seen[-after] :] = True
    return flags
