"""First instant of force by the kind of mechanism."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import singledispatch

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.shot.line_motion import driven_s, telling_role
from recoil_processing.shot.onset import find_onset
from recoil_rigs.mechanism.line import Line
from recoil_rigs.mechanism.mechanism_parameters import Mechanism


@singledispatch
def onset_s(
    mechanism: Mechanism,  # noqa: ARG001 - by whose kind it is found
    grid_s: Array,
    series: Mapping[str, Array],
    forces: Collection[str],  # noqa: ARG001 - of a line
) -> float:
    """Return the first instant of force, s.

    Parameters
    ----------
    grid_s : ndarray, shape (n,)
        Instants, evenly spaced.
    series : mapping of str to ndarray, shape (n,)
        Readings by role, or name of a force.
    forces
        Names of the forces.

    Raises
    ------
    IdentificationError
        If nothing shows one.
    """
    return find_onset(grid_s, series)


@onset_s.register
def _end_of_rest_s(mechanism: Line, grid_s: Array, series: Mapping[str, Array], forces: Collection[str]) -> float:
    """Return the instant at which a rest ends, the record's first one without any."""
    static = mechanism.at_rest["recoil_acceleration"]
    role = telling_role(series)
    if not role:
        return float(grid_s[0])
    read = [series[name] for name in forces if name in series]
    first_s = driven_s(grid_s, series, read, static)[0]
    # what moves as soon as anything tells of it has no rest before
    return float(grid_s[0]) if first_s == grid_s[int(np.argmax(np.isfinite(series[role])))] else first_s
