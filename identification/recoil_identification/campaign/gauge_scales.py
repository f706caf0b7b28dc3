"""The dynamic scale of each gauge: by how much it reads wrong in the shots themselves, as all of them tell it.

A gauge reads the force too large by the sum of all that its parameter hangs on: the scale of its certificate, its scale
in a pulse beside that, its standard, its area, and of the breech the friction in the bore. Shots tell that sum, and its
parts only as well as they were known before. Shots with two weights tell it whatever the certificates say: what drives
both is the same, so that the ratio of their accelerations is that of their masses.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.remark import Note, NoteCode
from recoil_identification.campaign.joint_fit import JointFit
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_rigs.tables.rig_tables import FORCE_SENSOR_ROLES

OF_GAUGE = (SourceKind.SENSOR_SCALE, SourceKind.SENSOR_DYNAMIC, SourceKind.STANDARD)
"""Kinds of sources that are the gauge's own; the others are what turns its reading into a force."""
TIMES_BETTER = 1.5
"""Factor by which the shots know a scale better than what was stated of it, from which on it is said what it is."""


@dataclass(frozen=True)
class GaugeScale:
    """Share by which a gauge reads its force too large in the shots.

    Attributes
    ----------
    force
        Role of the gauge, or name of its force.
    sensors
        Serial number of the gauge; of those whose mean it is.
    value, u
        Share, with all that turns the reading into a force, and its standard uncertainty.
    known_u
        Standard uncertainty by what was stated beforehand.
    beside
        Sources that are in it beside the gauge: its area, the friction in the bore.
    gauge, u_gauge
        Part of it that is the gauge's, by what was stated of the others.
    """

    force: str
    sensors: str
    value: float
    u: float
    known_u: float
    beside: tuple[ErrorSource, ...]
    gauge: float
    u_gauge: float

    @property
    def is_told(self) -> bool:
        """Whether the shots tell that it is off, and not what was stated of it."""
        return self.u * TIMES_BETTER < self.known_u and abs(self.value) > COVERAGE_FACTOR * self.u

    def note(self) -> Note:
        """Say it in a sentence."""
        own = f"{100 * self.gauge:+.2f} % of it is the gauge's, u {100 * self.u_gauge:.2f} %"
        text = (
            f"{self.force}, sensor {self.sensors}, reads {100 * abs(self.value):.2f} % too "
            f"{'much' if self.value > 0 else 'little'} of its force in these shots, u {100 * self.u:.2f} %, where "
            f"{100 * self.known_u:.2g} % was known: its dynamic scale"
            + "".join(f", {one}" for one in self.beside)
            + (" together" if self.beside else "")
            + f"; by what was stated of each {own}"
        )
        return Note(NoteCode.GAUGE_SCALE, self.force, text)


def gauge_scales(fit: JointFit) -> tuple[GaugeScale, ...]:
    """Return the scale of each gauge that reads a force, in the order of the forces."""
    rows = fit.rows
    places = [fit.names.index(one.identity) for one in rows.influences]
    found = []
    for place, parameter in enumerate(rows.parameters):
        # a gauge that was exchanged has a row of its own
        for loads in dict.fromkeys(map(tuple, rows.loads[:, place].tolist())):
            gauge = [
                load if load and one.source.kind in OF_GAUGE else 0.0
                for one, load in zip(rows.influences, loads, strict=True)
            ]
            of = [one.source for one, load in zip(rows.influences, gauge, strict=True) if load]
            sensors = dict.fromkeys(one.detail for one in of if one.kind is SourceKind.SENSOR_SCALE)
            role = next((one.of for one in of if one.of in FORCE_SENSOR_ROLES), None)
            if role is None or not sensors:
                continue
            bearing = (rows.loads[:, place] == loads).all(axis=1)
            released = {
                fit.names.index(one.name): float(one.shares[bearing][0])
                for one in rows.columns
                if one.parameter == parameter and np.ptp(one.shares[bearing]) == 0.0
            }
            whole, own = _row(fit, places, loads, released), _row(fit, places, gauge, released)
            found.append(
                GaugeScale(
                    force=parameter.removeprefix("ln "),
                    sensors=" and ".join(sensors),
                    value=float(whole @ fit.values),
                    u=math.sqrt(float(whole @ fit.covariance @ whole)),
                    known_u=math.hypot(*loads),
                    beside=tuple(
                        one.source
                        for one, load, mine in zip(rows.influences, loads, gauge, strict=True)
                        if load and not mine
                    ),
                    gauge=float(own @ fit.values),
                    u_gauge=math.sqrt(float(own @ fit.covariance @ own)),
                )
            )
    return tuple(found)


def _row(fit: JointFit, places: list[int], loads: tuple[float, ...] | list[float], released: dict[int, float]) -> Array:
    """Return how much of each unknown is in it, shape (n_unknowns,)."""
    row = np.zeros(len(fit.names))
    row[places] = loads
    for at, share in released.items():
        row[at] = share
    return row
