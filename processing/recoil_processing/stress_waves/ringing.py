"""Modes that ring: frequencies and damping of the modes in what a low-pass filter has taken off.

After each knock a structure rings freely, as a sum of decaying sinusoids. The stretches between the knocks are those
in which each sample follows from the ones before. The poles of the sinusoids are those of the signal subspace that all
these windows share (R. Roy and T. Kailath, "ESPRIT", IEEE Trans. ASSP 37, 1989; Y. Hua and T. K. Sarkar, "Matrix pencil
method", IEEE Trans. ASSP 38, 1990). The number of modes is not known: those count that stay where they are while the
assumed number grows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Complex
from recoil_processing.arguments import require_alike, require_finite
from recoil_processing.filters import LowPass
from recoil_processing.gaps import near, runs_of
from recoil_processing.spectra.spectrum import multitaper, smooth

Window = tuple[int, int]

ABOVE_FLOOR = 4.0
"""Density of ringing over that of the white floor; a smoothed floor scatters by less."""
BELOW_PEAK = 1e-4
"""Share of the highest density below which ringing is left out: 40 dB."""
LONGEST_SPECTRUM = 1 << 14
"""Samples from the shot on whose spectrum shows how high the ringing reaches."""
SAMPLES_PER_PERIOD = 2.8
"""Samples per period of the highest ringing to which the record is thinned: a row of the Hankel matrix then covers
more periods, and close modes part."""
LONGEST_LAG = 63
"""Shifts in a row of the Hankel matrix: enough for a dozen modes, and few enough that threads which wait for each
other on a busy machine cost little."""
MOST_MODES = 12
SAME_FREQUENCY = 0.01
"""Relative change of a frequency from one assumed order to the next, of a mode that stays where it is."""
SAME_DAMPING = 0.25
"""Relative change of the damping ratio of such a mode, beside a change of 0.002."""
STAYS = 4
"""Successive orders in which a mode must be found."""
MOST_DAMPED = 0.2
"""Damping ratio beyond which a pole is the transient of a knock, or noise."""
LEAST_SHARE = 0.002
"""Share of the ringing's energy that makes a mode worth telling."""
LONGEST_WINDOW = 640
"""Samples of a window after a knock."""
PREDICTION_ORDER = 28
"""Samples from which the next one is predicted: two for each of a dozen modes, and some for the noise. A window
between knocks is seen whole from twice as many on."""
KNOCK = 12.0
"""Error of the prediction over its median, at a knock: 4.5 standard deviations of white noise, forward and backward."""
COARSE_KNOCK = 0.2
"""Error of the prediction over the loudness there, at a knock of the first search."""
FINE_KNOCK = 0.03
"""Error of the prediction over the loudness there, at a knock of the second search: what is predicted to 30 dB rings
freely, however low the noise."""
RIDGE = 1e-9
"""Power of the white noise assumed beside the recorded one, over that of the ringing; also added to the normalised
products of the modes."""


@dataclass(frozen=True)
class Mode:
    """A mode of the structure, as it rings in one record.

    Attributes
    ----------
    frequency_hz
        Undamped natural frequency: the modulus of the pole over two pi.
    damping_ratio
        Share of the critical damping.
    energy_share
        Energy of this mode over that of the recorded signal since the shot: its share of what was taken off,
        in the windows after the knocks, times the share of that in the record.
    amplitude
        Largest amplitude at the beginning of a window, in the signal's unit.
    """

    frequency_hz: float
    damping_ratio: float
    energy_share: float
    amplitude: float


def ringing_modes(
    residual: Array, rate_hz: float, *, lowest_hz: float, recorded: Array | None = None, first: int = 0
) -> tuple[Mode, ...]:
    """Find the modes that ring in the part of a record above the cut-off.

    Parameters
    ----------
    residual : ndarray, shape (n_samples,)
        Recorded less filtered, finite.
    lowest_hz
        No mode is looked for below: what lies there is left over from the motion. The valley of the
        spectral gap is the place.
    recorded : ndarray, shape (n_samples,), optional
        The recorded signal, its level at rest taken off, for the shares of energy; without it they are
        shares of the residual.
    first
        First sample of the shot.

    Returns
    -------
    tuple of Mode
        Modes by falling share of energy; none where nothing rings above the noise.

    Raises
    ------
    ValueError
        If the samples are not finite, the two do not match, the rate is not positive, or `lowest_hz` is
        not between 0 and half the rate.
    """
    require_alike(residual=residual, recorded=residual if recorded is None else recorded)
    if not 0 < lowest_hz < 0.5 * rate_hz:
        raise ValueError(f"lowest_hz must be between 0 and {0.5 * rate_hz:g}, not {lowest_hz}")
    if not 0 <= first < residual.size:
        raise ValueError(f"first {first} is not one of the record's {residual.size} samples")
    require_finite(residual=residual)
    shot = residual[first:]
    if shot.size < 64 or not np.any(shot):
        return ()
    highest_hz = _highest(shot, rate_hz, lowest_hz)
    if highest_hz is None:
        return ()
    stride = max(1, int(rate_hz / (SAMPLES_PER_PERIOD * highest_hz)))
    slow_hz = rate_hz / stride
    thinning = LowPass(0.4 * slow_hz, 6)
    if stride > 1:
        shot = thinning.apply(shot, rate_hz)[::stride]
    windows = free_windows(shot, max(16, round(3 * slow_hz / lowest_hz)))
    if not windows:
        return ()
    poles = _stable_poles(shot, windows, slow_hz, lowest_hz, 1.1 * highest_hz)
    share = 1.0 if recorded is None else float(np.sum(residual[first:] ** 2) / np.sum(recorded[first:] ** 2))
    modes = _modes(shot, share, windows, poles, slow_hz)
    if stride == 1:
        return modes
    gains = thinning.gain(np.array([mode.frequency_hz for mode in modes]))
    return tuple(
        replace(mode, energy_share=mode.energy_share / gain**2, amplitude=mode.amplitude / gain)
        for mode, gain in zip(modes, gains.tolist(), strict=True)
    )


def _highest(shot: Array, rate_hz: float, lowest_hz: float) -> float | None:
    """Highest frequency at which something rings above the floor; None if nothing does."""
    spectrum = smooth(multitaper(shot[:LONGEST_SPECTRUM], rate_hz))
    inside = spectrum.frequency_hz >= lowest_hz
    f, density = spectrum.frequency_hz[inside], spectrum.density[inside]
    if f.size == 0:
        return None
    floor = float(np.median(density[f >= 0.5 * f[-1]]))
    rings = np.flatnonzero(density > max(ABOVE_FLOOR * floor, BELOW_PEAK * float(density.max())))
    return float(f[rings[-1]]) if rings.size else None


def _stable_poles(
    shot: Array, windows: tuple[Window, ...], rate_hz: float, lowest_hz: float, highest_hz: float
) -> Complex:
    """Poles in 1/s, one of each pair, that stay where they are while the order grows."""
    lag = min(LONGEST_LAG, max(end - begin for begin, end in windows) // 2)
    # largest first: ringing before noise
    vectors = np.linalg.eigh(hankel_covariance(shot, windows, lag))[1][:, ::-1]
    tracks: list[list[complex]] = []
    alive: list[list[complex]] = []
    for order in range(2, min(2 * MOST_MODES, lag // 2) + 1, 2):
        found = _poles(vectors[:, :order], rate_hz)
        frequency, damping = np.abs(found) / (2 * np.pi), -found.real / np.abs(found)
        sane = (found.imag > 0) & (damping > 0) & (damping < MOST_DAMPED)
        still = []
        for pole in found[sane & (frequency > lowest_hz) & (frequency < highest_hz)].tolist():
            near_by = [track for track in alive if _stays(track[-1], pole)]
            if near_by:
                track = min(near_by, key=lambda t: abs(t[-1] - pole))
                alive.remove(track)
            else:
                track = []
                tracks.append(track)
            track.append(pole)
            still.append(track)
        alive = still
    settled = sorted((t for t in tracks if len(t) >= STAYS), key=len, reverse=True)
    poles: list[complex] = []
    for track in settled:
        # a broken track comes again at a higher order
        middle = complex(median(p.real for p in track), median(p.imag for p in track))
        if not any(_stays(pole, middle) for pole in poles):
            poles.append(middle)
    return np.asarray(poles, dtype=np.complex128)


def _poles(subspace: Array, rate_hz: float) -> Complex:
    """Poles of a signal subspace by its invariance to a shift, in least squares."""
    upper, last = subspace[:-1], subspace[-1]
    # the columns are orthonormal: (upper' upper)^-1 = 1 + last last' / (1 - last last')
    shifted = upper.T @ subspace[1:]
    rest = 1.0 - float(last @ last)
    if rest < 1e-9:
        return np.empty(0, dtype=np.complex128)
    steps = np.linalg.eigvals(shifted + np.outer(last, last @ shifted) / rest)
    steps = steps[np.abs(steps) > 1e-6]
    return np.asarray(np.log(steps.astype(np.complex128)) * rate_hz)


def _stays(before: complex, after: complex) -> bool:
    damping_before, damping_after = -before.real / abs(before), -after.real / abs(after)
    same_frequency = abs(abs(after) - abs(before)) <= SAME_FREQUENCY * abs(before)
    return same_frequency and abs(damping_after - damping_before) <= 0.002 + SAME_DAMPING * damping_before


def _modes(shot: Array, share: float, windows: tuple[Window, ...], poles: Complex, rate_hz: float) -> tuple[Mode, ...]:
    """Amplitudes of the poles in each window by least squares; those above the noise are modes."""
    if poles.size == 0:
        return ()
    # everything below needs no more of a window than these products
    products = []
    for begin, end in windows:
        decays = np.exp(np.outer(np.arange(end - begin) / rate_hz, poles))
        basis = np.stack([decays.real, -decays.imag], axis=2).reshape(end - begin, 2 * poles.size)
        scale = np.linalg.norm(basis, axis=0)
        basis /= scale
        products.append((np.einsum("ti,tj->ij", basis, basis), shot[begin:end] @ basis, scale))
    total = float(sum(np.sum(shot[begin:end] ** 2) for begin, end in windows))
    samples = sum(end - begin for begin, end in windows)
    kept = np.arange(poles.size)
    while kept.size:
        energy, amplitude, left = np.zeros(kept.size), np.zeros(kept.size), total
        columns = np.stack([2 * kept, 2 * kept + 1], axis=1).ravel()
        for gram, projected, scale in products:
            own = gram[np.ix_(columns, columns)]
            # close modes are nearly parallel; the ridge only keeps the equations regular
            weights = np.linalg.solve(own + RIDGE * np.eye(columns.size), projected[columns])
            pairs = weights.reshape(-1, 2)
            cross = own[np.arange(0, columns.size, 2), np.arange(1, columns.size, 2)]
            energy += np.sum(pairs**2, axis=1) + 2.0 * cross * pairs[:, 0] * pairs[:, 1]
            amplitude = np.maximum(amplitude, np.hypot(*(weights / scale[columns]).reshape(-1, 2).T))
            left -= float(2.0 * weights @ projected[columns] - weights @ own @ weights)
        freedom = samples - len(windows) * columns.size
        if freedom <= 0:
            return ()
        # two amplitudes in each window explain that much of white noise; ten times that is no chance
        chance = 20.0 * len(windows) * max(left, 0.0) / freedom
        if float(energy.min()) >= max(chance, LEAST_SHARE * total):
            break
        # one at a time: what the weakest explained may be another's
        kept = np.delete(kept, int(np.argmin(energy)))
    return tuple(
        Mode(
            float(abs(poles[kept[i]]) / (2 * math.pi)),
            float(-poles[kept[i]].real / abs(poles[kept[i]])),
            float(share * energy[i] / total),
            float(amplitude[i]),
        )
        for i in (np.argsort(energy)[::-1] if kept.size else ())
    )


def free_windows(shot: Array, shortest: int) -> tuple[Window, ...]:
    """Find the windows of free ringing: between the knocks, as long as it is heard.

    Free ringing can be predicted from its own past or future, a knock from neither. Knocks are where the
    error of a linear prediction stands out of its usual size, and of what rings there.

    Parameters
    ----------
    shot : ndarray, shape (n,)
        Samples from the shot on.
    shortest
        Samples of a window that is worth fitting.

    Returns
    -------
    tuple of (begin, end)
        Sample indices, as for a slice.
    """
    if shot.size < max(shortest, 16):
        return ()
    order = min(PREDICTION_ORDER, shot.size // 8)
    loudness = np.sqrt(np.convolve(shot**2, np.full(shortest, 1.0 / shortest), mode="same"))
    free: tuple[Window, ...] = ((0, shot.size),)
    # the knocks themselves spoil the first prediction; the second is fitted between them
    for least in (COARSE_KNOCK, FINE_KNOCK):
        missed = _unpredicted(shot, free, order)
        knocks = near(missed > np.maximum(KNOCK * float(np.median(missed)), least * loudness), 2)
        free = tuple(runs_of(~knocks))
    heard = loudness > max(2.0 * float(np.quantile(loudness, 0.02)), 0.01 * float(loudness.max()))
    windows = []
    for begin, end in free:
        last = min(end, begin + LONGEST_WINDOW)
        audible = np.flatnonzero(heard[begin:last])
        if audible.size:
            last = int(begin + audible[-1] + 1)
            if last - begin >= shortest:
                windows.append((begin, last))
    return tuple(windows)


def _unpredicted(shot: Array, windows: tuple[Window, ...], order: int) -> Array:
    """Size of the error with which each sample is predicted, from those before or behind it, whichever is better.

    Only inside a knock both fail: behind it the ringing is free already, before it, it still is.
    """
    products = hankel_covariance(shot, windows, order)
    # a little white noise keeps the equations regular where nothing is random
    ridge = (RIDGE * products[0, 0] + np.finfo(np.float64).tiny) * np.eye(order)
    forward = np.linalg.solve(products[:-1, :-1] + ridge, products[:-1, -1])[::-1]
    backward = np.linalg.solve(products[1:, 1:] + ridge, products[1:, 0])[::-1]
    ahead = np.convolve(shot, np.append(1.0, -forward))[: shot.size]
    behind = np.convolve(shot, np.append(-backward, 1.0))[order:]
    return np.minimum(np.abs(ahead), np.abs(behind))


def hankel_covariance(shot: Array, windows: tuple[Window, ...], lag: int) -> Array:
    """Sum over all windows of the products of samples up to a lag apart, shape (lag + 1, lag + 1).

    The entry one further down the diagonal has lost the first product of each window and gained one behind
    its last: one row is computed, the others follow.

    Parameters
    ----------
    shot : ndarray, shape (n,)
    windows
        Windows of the record; those of no more than `lag` samples are left out.

    Returns
    -------
    ndarray, shape (lag + 1, lag + 1)
        Zero if every window is left out.
    """
    first_row = np.zeros(lag + 1)
    begins, ends = [], []
    for begin, end in windows:
        if end - begin > lag:
            shifted = np.lib.stride_tricks.sliding_window_view(shot[begin:end], lag + 1)
            # plain sums: a threaded scalar product of this size waits longer for its threads than it computes
            first_row += np.einsum("tj,t->j", shifted, shot[begin : end - lag])
            begins.append(shot[begin : begin + lag + 1])
            ends.append(np.append(shot[end - lag : end], 0.0))
    if not begins:
        return np.zeros((lag + 1, lag + 1))
    lost, gained = np.array(begins), np.array(ends)
    change = np.einsum("wi,wj->ij", gained, gained) - np.einsum("wi,wj->ij", lost, lost)
    covariance = np.empty((lag + 1, lag + 1))
    covariance[0] = covariance[:, 0] = first_row
    for row in range(lag):
        covariance[row + 1, 1:] = covariance[row, :-1] + change[row, :-1]
    return covariance
