"""Records of known ARX systems, computed sample by sample, and of a rigid mass."""

from __future__ import annotations

import numpy as np

from recoil_identification.targets.arx.decimated_record import DecimatedRecord
from recoil_processing.filters import LowPass

SECOND_ORDER = ((-1.5, 0.7), (1.0, 0.5), 1)
"""a, b and delay of a damped second-order system with unequal coefficients."""


def arx_output(
    a: tuple[float, ...], b: tuple[float, ...], delay: int, input_: np.ndarray, errors: np.ndarray
) -> np.ndarray:
    """Let a system at rest answer an input, with an error in each equation."""
    output = np.zeros(input_.size)
    for k in range(input_.size):
        value = errors[k]
        for i, coefficient in enumerate(a, start=1):
            value -= coefficient * (output[k - i] if k >= i else 0.0)
        for j, coefficient in enumerate(b):
            value += coefficient * (input_[k - delay - j] if k >= delay + j else 0.0)
        output[k] = value
    return output


def arx_record(
    n_samples: int,
    seed: int,
    noise: float = 0.1,
    system: tuple[tuple[float, ...], tuple[float, ...], int] = SECOND_ORDER,
) -> tuple[np.ndarray, np.ndarray]:
    """Drive a system by white noise; its errors are white."""
    rng = np.random.default_rng(seed)
    input_ = rng.standard_normal(n_samples)
    return input_, arx_output(*system, input_, noise * rng.standard_normal(n_samples))


PULSE_MASS_KG = 782.0


def pulse_record(
    seed: int = 1,
    *,
    noise_m_s2: float = 1.0,
    force_noise_n: float = 0.0,
    colour: tuple[float, ...] = (1.0,),
    lag: float = 0.0,
    n: int = 250,
    share: float = 1.0,
) -> DecimatedRecord:
    """Make a decimated shot: a pulse and a long brake; errors of the acceleration as a moving average of white ones."""
    rng = np.random.default_rng(seed)
    t = 1e-3 * np.arange(n)
    force = 1e6 * np.exp(-(((t - 0.03) / 0.006) ** 2)) - 2e5 * np.exp(-(((t - 0.1) / 0.04) ** 2))
    errors = noise_m_s2 * np.convolve(rng.standard_normal(n + len(colour) - 1), colour, mode="valid")
    acceleration = force / PULSE_MASS_KG + errors
    acceleration[1:] += lag * force[:-1] / PULSE_MASS_KG
    force = force + force_noise_n * rng.standard_normal(n)
    rows = (t > 0.01) & (t < 0.23)
    return DecimatedRecord(t, force, acceleration, rows, 1e-3, 20, LowPass(400.0 * share))
