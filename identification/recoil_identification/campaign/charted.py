"""The quantities that are charted over the shots of a campaign, and the signals of their charts.

Charted are the standardised residuals of the joint fit, by how much the peaks of each shot lie off those of the shots
that were fired alike, and of each sensor what it read before the shot and how noisy it was: the masses themselves
differ by charge and by what was added, the residuals do not. A chart asks for a look; it says nothing against the mass.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from recoil_acquisition.measured import Worded, measured, worded
from recoil_acquisition.remark import Caution
from recoil_identification.campaign.changes import MASS
from recoil_identification.campaign.charts import (
    EWMA_RULE,
    LEAST_POINTS,
    MOVING_RANGE,
    RULES,
    TREND_RULE,
    EwmaChart,
    IndividualsChart,
    Trend,
    ewma_chart,
    individuals_chart,
    trend,
)
from recoil_identification.campaign.signal_kind import SignalKind
from recoil_identification.shot.baseline import Baseline


class ChartedQuantity(StrEnum):
    """Quantity that is charted over the shots."""

    RESIDUAL = "residual"
    PEAK = "off the mean of shots fired alike"
    ZERO = "zero before the shot"
    READING = "reading before the shot"
    NOISE = "noise before the shot"

    @property
    def short(self) -> str:
        """Its name on an axis, and before what a rule found."""
        return self.name.lower()


RESIDUAL, PEAK, ZERO, READING, NOISE = ChartedQuantity
MOST_TOLD = 8
"""Shots that a sentence names."""
MEANINGS = {MOVING_RANGE: "a jump from the shot before", EWMA_RULE: "the weighted average beyond its limits", **RULES}


@dataclass(frozen=True)
class ChartSignal:
    """One thing that a chart shows.

    Attributes
    ----------
    influence
        ``mass``, or the sensor.
    rule
        Rule that fired.
    shots
        Shots that complete the pattern; of a trend the first and the last.
    size, u
        Size of a trend and its standard uncertainty, in `unit`: of a noise the share by which it grew. None where the
        rule has no size.
    """

    influence: str
    quantity: ChartedQuantity
    rule: str
    shots: tuple[str, ...]
    size: float | None = None
    u: float | None = None
    unit: str | None = None
    provisional: bool = False

    @property
    def told(self) -> Worded:
        """The quantity, without the name of the sensor."""
        limits = ", limits provisional" if self.provisional else ""
        if self.rule == TREND_RULE:
            scale, unit = (100.0, "%") if self.unit == "1" else (1.0, self.unit)
            size, u = scale * (self.size or 0.0), scale * (self.u or 0.0)
            what = worded(
                "a trend of ", measured(size, f"{unit}", "+.3g"), ", u ", measured(u, f"{unit}", ".2g"),
                f", from shot {self.shots[0]} to {self.shots[-1]}",
            )  # fmt: skip
        else:
            more = f" and {len(self.shots) - MOST_TOLD} more" if len(self.shots) > MOST_TOLD else ""
            where = f"shot{'s' if len(self.shots) > 1 else ''} {', '.join(self.shots[:MOST_TOLD])}{more}"
            what = Worded(f"{MEANINGS[self.rule]} at {where} ({self.rule}{limits})")
        return worded(f"{self.quantity.short}: ", what)

    def remark(self) -> Caution:
        """Return it as a warning."""
        return Caution(SignalKind.CHART, self.influence, worded(f"{self.influence}, ", self.told))

    def __str__(self) -> str:
        return str(self.remark())


@dataclass(frozen=True, eq=False)
class Charted:
    """One series over the shots.

    Attributes
    ----------
    shots
        Shots that have a value.
    unit
        Unit of the values; empty for residuals, and for noise, of which the natural logarithm of its SI value is
        charted.
    sensor_unit
        Unit of the noise itself.
    ewma
        Chart of the weighted average; None but for residuals.
    trend
        Trend over the shots; None but for sensors.
    """

    influence: str
    quantity: ChartedQuantity
    unit: str
    shots: tuple[str, ...]
    individuals: IndividualsChart
    sensor_unit: str = ""
    ewma: EwmaChart | None = None
    trend: Trend | None = None

    @property
    def signals(self) -> tuple[ChartSignal, ...]:
        """Signals of the chart, one for each rule that fired."""
        fired = dict(self.individuals.fired)
        if self.ewma is not None and self.ewma.fired.any():
            fired[EWMA_RULE] = self.ewma.fired
        found = [
            ChartSignal(
                self.influence,
                self.quantity,
                rule,
                tuple(shot for shot, flag in zip(self.shots, flags.tolist(), strict=True) if flag),
                provisional=self.individuals.provisional,
            )
            for rule, flags in fired.items()
        ]
        if self.trend is not None and self.trend.fired:
            ends = (self.shots[0], self.shots[-1])
            unit = "1" if self.quantity == NOISE else self.unit
            found.append(
                ChartSignal(self.influence, self.quantity, TREND_RULE, ends, self.trend.change, self.trend.u, unit)
            )
        return tuple(found)


def charted_residuals(shots: Sequence[str], residuals: Sequence[float]) -> tuple[Charted, ...]:
    """Chart the standardised residuals of a joint fit; nothing of fewer than three shots."""
    if len(shots) < LEAST_POINTS:
        return ()
    individuals = individuals_chart(residuals)
    return (Charted(MASS, RESIDUAL, "", tuple(shots), individuals, ewma=ewma_chart(individuals)),)


def charted_peaks(quantities: Iterable[tuple[str, Mapping[str, float]]]) -> tuple[Charted, ...]:
    """Chart how far each quantity lies off its mean, percent by shot; of those that three or more shots have.

    Parameters
    ----------
    quantities
        Quantities in words, each with its values by shot in the order of firing.
    """
    return tuple(one for label, values in quantities for one in _charted(label, PEAK, "%", values, "%"))


def charted_sensors(shots: Iterable[tuple[str, Sequence[Baseline]]]) -> tuple[Charted, ...]:
    """Chart what each sensor read before the shots, and its noise; of sensors with three or more shots.

    Parameters
    ----------
    shots
        Name and baselines, in the order in which they were fired. Another serial number is another sensor.
    """
    by_sensor: dict[tuple[str, str], list[tuple[str, Baseline]]] = {}
    for name, baselines in shots:
        for one in baselines:
            by_sensor.setdefault((one.channel, one.sensor), []).append((name, one))
    found = []
    for (channel, sensor), read in by_sensor.items():
        label = f"{channel}, sensor {sensor}"
        first = read[0][1]
        offsets = {name: one.offset for name, one in read}
        noises = {name: math.log(one.noise) for name, one in read if one.noise is not None and one.noise > 0}
        quantity = READING if first.at_rest is None else ZERO
        found += [
            *_charted(label, quantity, first.unit, offsets, first.unit),
            *_charted(label, NOISE, "", noises, first.unit),
        ]
    return tuple(found)


def _charted(
    label: str, quantity: ChartedQuantity, unit: str, values: Mapping[str, float | None], sensor_unit: str
) -> tuple[Charted, ...]:
    known = {name: value for name, value in values.items() if value is not None and math.isfinite(value)}
    if len(known) < LEAST_POINTS:
        return ()
    series = np.array(list(known.values()))
    return (
        Charted(
            label,
            quantity,
            unit,
            tuple(known),
            individuals_chart(series),
            sensor_unit,
            trend=trend(series),
        ),
    )
