"""Errors that one shot could not have found: how far a scale may be off before its own test names it, and the cost.

Errors that all sensors of one kind share come first, for no shot can tell most of them: forces that are all measured
too large by a share are those of a mass that is larger by that share, and so with lengths.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from recoil_identification.calibration.calibration import Calibration
from recoil_identification.inference.reliability import reliability
from recoil_identification.rows import equation_of_motion as motion
from recoil_identification.rows.sensor_priors import RELEASE
from recoil_rigs.tables.force_input import AREAS

ALL_FORCES = "all gauges of force together"
ALL_LENGTHS = "accelerometer and camera together"
"""Names of the errors that sensors of one kind share."""
LARGEST_LINEAR = 0.2
"""Relative error of a scale beyond which a linear answer says nothing: more than this is as good as any."""


@dataclass(frozen=True)
class HiddenError:
    """An error that a shot may not tell.

    Attributes
    ----------
    source
        Name of its row in the budget, or what is off together.
    largest_error
        Largest error that passes once in five times or more often, in `unit`; None where any passes.
    unit
        ``1`` for a relative error of a scale.
    mass_kg
        Change of the mass if the source reads high by `largest_error`; None where any passes.
    sensitivity_kg
        Change of the mass by one unit of the error.
    """

    source: str
    largest_error: float | None
    unit: str
    mass_kg: float | None
    sensitivity_kg: float


def hidden_errors(calibration: Calibration) -> tuple[HiddenError, ...]:
    """List what could be off unseen, what sensors share first, then the costliest first.

    Parameters
    ----------
    calibration
        Calibration of a shot; what its certificates say is judged, and not what the shot alone knows.
    """
    known = calibration.known_beforehand
    stated = {source for one in calibration.common for source in one.sources}
    certified = [source for source in calibration.sources if source in stated and source != RELEASE]
    shared = [_hidden(calibration, name, error, "1") for name, error in _shared(calibration)]
    single = [_hidden(calibration, source, {source: 1.0}, known[source][1]) for source in certified]
    return (*shared, *sorted(single, key=lambda one: -_cost(one)))


def _shared(calibration: Calibration) -> Iterator[tuple[str, Mapping[str, float]]]:
    """Name the sources of one kind that may be off together: the sensors' own, not an area beside them."""
    kinds = (
        (ALL_FORCES, [gauge.name for gauge in calibration.block.gauges]),
        (ALL_LENGTHS, [motion.ACCELERATION.name, motion.CAMERA.name]),
    )
    for name, unknowns in kinds:
        rows = [one for one in calibration.common if one.unknowns[0] in unknowns and one.sources[0] not in AREAS]
        about = {one.unknowns[0]: one for one in rows if not one.exact}
        # of two a third that is exact tells the others: then nothing is off together
        if len(about) > 1 and len(about) == len({one.unknowns[0] for one in rows}):
            yield name, {one.sources[0]: 1.0 for one in about.values()}


def _hidden(calibration: Calibration, source: str, error: Mapping[str, float], unit: str) -> HiddenError:
    priors = [*calibration.common, *calibration.own]
    found = reliability(calibration.inferred, priors, error, motion.MASS.name)
    # a sensor that reads high has a value that lies too low
    sensitivity = -calibration.estimate.mass_kg * found.answer
    unseen = math.isinf(found.smallest_told) or (unit == "1" and found.smallest_told > LARGEST_LINEAR)
    largest = None if unseen else found.smallest_told
    return HiddenError(source, largest, unit, None if largest is None else sensitivity * largest, sensitivity)


def _cost(one: HiddenError) -> float:
    """Return what it may do to the mass, kg: infinite where any error passes that does something."""
    if one.mass_kg is not None:
        return abs(one.mass_kg)
    return math.inf if one.sensitivity_kg else 0.0
