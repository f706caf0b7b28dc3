"""When a sliding least-squares window may give a number, and the judgement of those that do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_identification.memory.window_factors import FloatArray, Solution
from recoil_identification.memory.windowed_estimates import (
    COLLINEAR_PIVOT,
    GUARDED_PIVOT,
    GUARDED_RESIDUAL,
    WindowStatus,
)


@dataclass(frozen=True, eq=False)
class WindowPolicy:
    """When a window may give a number.

    Parameters
    ----------
    window
        Samples of a window, at least ``n_parameters + 1``: one degree of freedom is the least from
        which an error can be told.
    min_excitation : float or array_like, shape (n_parameters,), optional
        Least weighted sum of squares of each regressor in a window, in its own squared unit times
        the weight's. Zero excitation never gives a number.
    max_relative_error
        Largest standard error of the first parameter over its magnitude, in every output.
    minimum_count
        Least number of samples present, ``n_parameters + 1`` if omitted.
    partial
        Whether the first ``window - 1`` rows, whose window the record does not fill, are tried too.

    Raises
    ------
    ValueError
        If a limit is out of range or of another shape.
    TypeError
        If a number of samples is not an integer.
    """

    n_parameters: int
    window: int
    min_excitation: Any = None
    max_relative_error: float | None = None
    minimum_count: int | None = None
    partial: bool = False

    def __post_init__(self) -> None:
        for name in ("n_parameters", "window", "minimum_count"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | np.integer | None):
                raise TypeError(f"{name} must be an integer number, found {value!r}")
        if self.n_parameters < 1:
            raise ValueError(f"n_parameters must be at least 1, found {self.n_parameters}")
        if self.window < self.least_count:
            raise ValueError(
                f"window must hold one sample more than there are parameters, "
                f"at least {self.least_count}, found {self.window}"
            )
        if not self.least_count <= self.needed_count <= self.window:
            raise ValueError(
                f"minimum_count must lie between {self.least_count} and the window {self.window}, "
                f"found {self.minimum_count}"
            )
        limits = np.asarray(0.0 if self.min_excitation is None else self.min_excitation, dtype=np.float64)
        if limits.shape not in ((), (self.n_parameters,)):
            raise ValueError(f"min_excitation must be one number or {self.n_parameters}, found shape {limits.shape}")
        if not (np.isfinite(limits) & (limits >= 0.0)).all():
            raise ValueError("min_excitation must be finite and not negative")
        if self.max_relative_error is not None and not self.max_relative_error > 0.0:
            raise ValueError(f"max_relative_error must be positive, found {self.max_relative_error}")
        object.__setattr__(self, "min_excitation", np.broadcast_to(limits, (self.n_parameters,)).copy())

    @property
    def least_count(self) -> int:
        """Samples below which no window has a degree of freedom."""
        return self.n_parameters + 1

    @property
    def needed_count(self) -> int:
        """Samples below which a window is not tried."""
        return self.least_count if self.minimum_count is None else self.minimum_count


def judged(
    solution: Solution,
    degrees_of_freedom: NDArray[np.int64] | int,
    min_excitation: FloatArray,
    max_relative_error: float | None,
) -> tuple[NDArray[np.uint8], FloatArray]:
    """Judge windows that hold enough samples.

    Parameters
    ----------
    degrees_of_freedom : ndarray, shape (n_windows,), or int
        One for all windows where it is the same.
    min_excitation : ndarray, shape (n_parameters,)
        In the solution's units.

    Returns
    -------
    status : ndarray of uint8, shape (n_windows,)
    standard_errors : ndarray, shape (n_parameters, n_outputs, n_windows)
        In the solution's units.
    """
    variance = solution.residual_sum_of_squares / np.maximum(degrees_of_freedom, 1)
    standard_errors = solution.variance_factors[:, np.newaxis] * variance
    np.sqrt(standard_errors, out=standard_errors)
    least = np.maximum(min_excitation, np.nextafter(0.0, 1.0))
    weak = solution.energies[0] < least[0]
    for energy, limit in zip(solution.energies[1:], least[1:], strict=True):
        weak |= energy < limit
    status = np.zeros(weak.shape, dtype=np.uint8)  # `WindowStatus.IDENTIFIED`
    if max_relative_error is not None:
        precise = (standard_errors[0] <= max_relative_error * np.abs(solution.parameters[0])).all(axis=0)
        status[~precise] = WindowStatus.NO_EXCITATION
    if solution.energies.shape[0] > 1:  # a single regressor has no other to be told apart from
        status[solution.smallest_pivot < COLLINEAR_PIVOT] = WindowStatus.COLLINEAR
    status[weak] = WindowStatus.NO_EXCITATION
    return status, standard_errors


def is_sound(solution: Solution) -> NDArray[np.bool_]:
    """Whether sums of products are accurate enough for a window, or have nothing to be accurate about.

    Parameters
    ----------
    solution
        Of sums of products.

    Returns
    -------
    ndarray of bool, shape (n_windows,)
    """
    sound = solution.smallest_pivot >= GUARDED_PIVOT
    for residual, energy in zip(solution.residual_sum_of_squares, solution.response_energy, strict=True):
        sound &= residual >= GUARDED_RESIDUAL * energy
    for energy in solution.energies:
        sound |= energy == 0.0
    return np.asarray(sound)
