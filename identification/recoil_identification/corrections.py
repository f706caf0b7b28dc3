"""What a calibration by the shot itself offers, whichever motion sensor it was made with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from recoil_identification.mass import MassEstimate
from recoil_processing.shot.regression import Regression

Array = NDArray[np.float64]


class Corrections(Protocol):
    """Errors of the sensors as a shot and their calibrations together say."""

    @property
    def estimate(self) -> MassEstimate:
        """The mass; its budget has the rows that the calibration itself knows of."""
        ...

    @property
    def pulls(self) -> Mapping[str, float]:
        """By how many of its standard uncertainties each sensor is off."""
        ...

    @property
    def normalised_residuals(self) -> Mapping[str, float]:
        """The same over its own standard deviation."""
        ...

    def correct(self, regression: Regression) -> tuple[Array, Array]:
        """Return a' and F' with the sensors' errors taken off, shape (n,) each."""
        ...

    def errors_left(self, regression: Regression) -> Array:
        """Return what the errors that are left do to the acceleration, shape (n, n_errors)."""
        ...
