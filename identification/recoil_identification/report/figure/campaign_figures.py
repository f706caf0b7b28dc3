"""The figures of a campaign: what is drawn, from what was found."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_identification.campaign.campaign import Campaign, Used
from recoil_identification.campaign.charted import NOISE, PEAK, RESIDUAL, Charted
from recoil_identification.campaign.charts import (
    EWMA_SIGMAS,
    LAMBDA,
    MOVING_RANGE,
    RULE_SET,
    SETTLED_POINTS,
    IndividualsChart,
)
from recoil_identification.campaign.mechanisms import UNNAMED
from recoil_identification.campaign.overlay import Overlay
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_identification.report.figure.figure import Figure, HorizontalLine, Panel, Span, Trace

Group = tuple[str, float]
"""Configuration, and added mass in kg."""

PANELS = (
    ("breech_pressure_pa", "breech pressure, MPa", 1e-6, "MPa"),
    ("recoil_acceleration_m_s2", "acceleration, m/s²", 1.0, "m/s²"),
    ("recoil_travel_m", "travel, mm", 1e3, "mm"),
)
MOST_STRONG = 12
"""Shots up to which each curve is as strong as any."""
Lines = tuple[float, ...]
"""Centre and limits."""


def campaign_figures(campaign: Campaign, curves: Overlay | None) -> list[Figure]:
    """Compose all figures of a campaign, in reading order; those of the sensors are folded."""
    figures = [_masses(campaign)]
    figures += [_residuals(one) for one in campaign.charts if one.quantity == RESIDUAL]
    if curves is not None:
        figures.append(_curves(campaign, curves))
    figures += _peaks(campaign, [one for one in campaign.charts if one.quantity == PEAK])
    sensors = dict.fromkeys(one.influence for one in campaign.charts if one.quantity not in (RESIDUAL, PEAK))
    for number, sensor in enumerate(sensors):
        figures.append(_sensor(campaign, number, [one for one in campaign.charts if one.influence == sensor]))
    return figures


def group_name(group: Group) -> str:
    """Say how the mechanism was built for some shots.

    >>> group_name(("", 120.0))
    '120 kg added'
    >>> group_name(("long barrel", -12.5))
    'long barrel, 12.5 kg taken off'
    """
    configuration, added_kg = group
    if not added_kg:
        return configuration or UNNAMED
    added = f"{abs(added_kg):g} kg {'added' if added_kg > 0 else 'taken off'}"
    return f"{configuration}, {added}" if configuration else added


def _group(used: Used) -> Group:
    return used.shot.configuration, used.shot.added_mass_kg


def _masses(campaign: Campaign) -> Figure:
    groups = list(dict.fromkeys(_group(one) for one in campaign.shots))
    shots = sorted(campaign.shots, key=lambda one: groups.index(_group(one)))
    places = np.arange(len(shots), dtype=np.float64)
    added = np.array([one.shot.added_mass_kg for one in shots])
    alone = np.array([one.shot.mass_kg for one in shots]) - added
    own, u_own, joint = (
        np.array([math.nan if value is None else value for value in column])
        for column in zip(*((one.own_mass_kg, one.own_u_kg, one.joint_kg) for one in shots), strict=True)
    )
    used = np.isfinite(own)
    half = COVERAGE_FACTOR * u_own
    spans = tuple(Span(group_name(group), *_reach([_group(one) == group for one in shots])) for group in groups)
    traces = [
        Trace("each shot by itself", places[used], alone[used], "points", "kg", hue=7),
        Trace(
            "without the sensors' errors, own scatter 95 %",
            places[used], (own - added)[used], "whiskers", "kg", (own - added - half)[used], (own - added + half)[used],
            hue=0,
        ),
    ]  # fmt: skip
    if not used.all():
        traces.append(Trace("set aside", places[~used], alone[~used], "points", "kg", hue=5))
    if any(change.unit == "kg" for change in campaign.changes):
        last = np.array([_group(a) != _group(b) for a, b in pairwise(shots)] + [True])
        # parted where the next shot is of another group
        x, y = np.insert(places, np.flatnonzero(last) + 1, places[last]), joint - added
        y = np.insert(y, np.flatnonzero(last) + 1, math.nan)
        traces.append(Trace("with what changed", x, y, "model", "kg", hue=2))
    common = np.array([one.shot.u_kg for one in shots]) ** 2 - u_own**2
    bracket_kg = COVERAGE_FACTOR * math.sqrt(max(float(np.nanmedian(common)), 0.0))
    middle, edge = float(np.median(alone[used])), max(0.8, 0.05 * len(shots))
    traces.append(
        Trace(
            "common to all by themselves, 95 %", [len(shots) - 0.5 + 0.6 * edge], [middle], "whiskers", "kg",
            [middle - bracket_kg], [middle + bracket_kg], hue=7,
        )
    )  # fmt: skip
    return Figure(
        "mass",
        "Mass by shot, without what was added",
        "Grey: each shot by itself; what all of these may be off by together is the one bracket at the right edge. "
        "Blue: the same shots with the sensors' errors as the campaign found them, with their own scatter; the band is "
        "the campaign's mass with its 95 % interval.",
        "shot",
        # the band last: many shots would hide it
        (Panel("mass, kg", (*traces, *_bands(campaign, shots)), spans=spans if len(groups) > 1 else ()),),
        names=tuple(one.shot.name for one in shots),
        shown=(-0.6, len(shots) - 0.5 + edge),
    )


def _reach(flags: Sequence[bool]) -> tuple[float, float]:
    """Return from where to where some neighbouring shots reach, with a gap to the next."""
    at = np.flatnonzero(flags)
    return float(at[0]) - 0.46, float(at[-1]) + 0.46


def _bands(campaign: Campaign, shots: Sequence[Used]) -> list[Trace]:
    """Draw the mass of each mechanism over its shots."""
    traces = []
    for number, one in enumerate(campaign.mechanisms):
        levels = (one.mass.mass_kg, *one.mass.interval_kg)
        places = [(i - 0.5, i + 0.5, i + 0.5) for i, used in enumerate(shots) if used.shot.name in one.shots]
        # the third instant parts stretches, and is left out where the next shot is one of them
        gaps = [math.nan if after[0] > before[1] else 1.0 for before, after in pairwise(places)] + [math.nan]
        factors = np.array([factor for gap in gaps for factor in (1.0, 1.0, gap)])
        name = "mass of the campaign, 95 % interval" if len(campaign.mechanisms) == 1 else f"{one.name}, 95 % interval"
        x = [place for three in places for place in three]
        value, low, high = (level * factors for level in levels)
        traces.append(Trace(name, x, value, "band", "kg", low, high, hue=2 + number))
    return traces


def _chart_panel(label: str, unit: str, points: tuple[Array, Array, Flags], lines: Lines, *more: Trace) -> Panel:
    """Draw one chart: places, values and what fired of them, with its centre and its limits."""
    places, values, fired = points
    traces = [*more, Trace(label, places, values, "series", unit, hue=0)]
    if fired.any():
        traces.append(Trace("fired", places[fired], values[fired], "marks", unit))
    centre, *limits = lines
    levels = [HorizontalLine("", centre, "mean"), *(HorizontalLine("", limit, "limit") for limit in limits)]
    return Panel(label, tuple(traces), tuple(levels))


def _fired(chart: IndividualsChart, *, jumps: bool) -> Flags:
    """Return which points fired by any rule of the individuals, or by it and by a jump."""
    flags = [fired for name, fired in chart.fired.items() if jumps or name != MOVING_RANGE]
    return np.any(flags, axis=0) if flags else np.zeros(chart.values.size, dtype=bool)


def _residuals(one: Charted) -> Figure:
    chart, places = one.individuals, np.arange(len(one.shots), dtype=np.float64)
    ranges, jumps = chart.moving_range, chart.fired.get(MOVING_RANGE, np.zeros(places.size, dtype=bool))[1:]
    points = (places, chart.values, _fired(chart, jumps=False))
    panels = [
        _chart_panel("residual w", "", points, (chart.centre, *chart.limits)),
        _chart_panel("moving range", "", (places[1:], ranges, jumps), (float(ranges.mean()), chart.moving_range_limit)),
    ]
    if one.ewma is not None:
        limits = [
            Trace("limits", places, chart.centre + sign * one.ewma.half_width, "reference", "", hue=1, group="limits")
            for sign in (1.0, -1.0)
        ]
        average = (places, one.ewma.values, one.ewma.fired)
        panels.append(_chart_panel("weighted average", "", average, (chart.centre,), *limits))
    return Figure(
        "residuals",
        "Control charts of the residuals",
        "How far each shot's mass lies from what all others say, over the standard deviation of that, in the order of "
        f"firing: individuals ({RULE_SET}), moving range, and weighted average (EWMA, the newest with "
        f"{LAMBDA:g} of the weight, limits at {EWMA_SIGMAS:g} standard deviations)." + _provisional(chart),
        "shot",
        tuple(panels),
        names=one.shots,
    )


def _provisional(chart: IndividualsChart) -> str:
    n = chart.values.size
    return f" With {n} shots the limits are provisional: {SETTLED_POINTS} settle them." if chart.provisional else ""


def _peaks(campaign: Campaign, charts: Sequence[Charted]) -> Iterator[Figure]:
    """Draw the charts of the quantities, one below the other; nothing where too few shots were fired alike."""
    if charts:
        yield Figure(
            "peaks",
            "Control charts of peaks, time and impulse",
            "By how much each shot lies off the mean of the shots that were fired alike, in the order of firing. "
            f"{_told(charts, named=True)}",
            "shot",
            _chart_panels(campaign, charts, lambda one: f"{one.influence}, %"),
            names=tuple(one.shot.name for one in campaign.shots),
            folded=True,
        )


def _sensor(campaign: Campaign, number: int, charts: Sequence[Charted]) -> Figure:
    return Figure(
        f"sensor-{number}",
        charts[0].influence,
        _told(charts),
        "shot",
        _chart_panels(campaign, charts, lambda one: f"{one.quantity.short}, {one.sensor_unit}"),
        names=tuple(one.shot.name for one in campaign.shots),
        folded=True,
    )


def _told(charts: Sequence[Charted], *, named: bool = False) -> str:
    """Say what fired in some charts."""
    told = "; ".join(str(signal) if named else signal.told for one in charts for signal in one.signals)
    told = told or "nothing fired"
    return f"{told[0].upper()}{told[1:]}."


def _chart_panels(
    campaign: Campaign, charts: Sequence[Charted], label_of: Callable[[Charted], str]
) -> tuple[Panel, ...]:
    """Draw charts over the places of the campaign's shots."""
    place_of = {one.shot.name: place for place, one in enumerate(campaign.shots)}
    panels = []
    for one in charts:
        chart = one.individuals
        lines: Lines = (chart.centre, *chart.limits)
        places = np.array([place_of[name] for name in one.shots], dtype=np.float64)
        values = chart.values
        if one.quantity == NOISE:
            # its logarithm is charted, and the noise itself is drawn
            values, lines = np.exp(values), tuple(math.exp(line) for line in lines)
        panels.append(_chart_panel(label_of(one), one.sensor_unit, (places, values, _fired(chart, jumps=True)), lines))
    return tuple(panels)


def _curves(campaign: Campaign, curves: Overlay) -> Figure:
    groups = list(dict.fromkeys(_group(one) for one in campaign.shots))
    group_of = {one.shot.name: _group(one) for one in campaign.shots}
    named = {name for change in campaign.changes if change.kind == "outlier" for name in change.shots}
    panels, drawn = [], len(curves.single)
    for curve, label, scale, unit in PANELS:
        traces = []
        if curve in curves.envelopes:
            envelope = curves.envelopes[curve]
            traces.append(
                Trace(
                    f"lowest to highest of all {curves.shots} shots", 1e3 * curves.times_s, scale * envelope.median,
                    "band", unit, scale * envelope.lowest, scale * envelope.highest, hue=7,
                )
            )  # fmt: skip
        for shot, one in curves.single.items():
            if curve in one.values:
                group, strong = group_of[shot], shot in named or drawn <= MOST_STRONG
                x, y = 1e3 * one.times_s, scale * one.values[curve]
                hue, name = groups.index(group), group_name(group)
                if shot in named:
                    hue, name = 5, f"shot {shot} lies apart"
                traces.append(
                    Trace(f"shot {shot}", x, y, "filtered" if strong else "measured", unit, hue=hue, group=name)
                )
        if traces:
            panels.append(Panel(label, tuple(traces)))
    what = "each shot is a line" if not curves.envelopes else f"{drawn} of {curves.shots} shots are lines"
    apart = f"; {', '.join(sorted(named))} lies apart, and is red" if named else ""
    missing = len(campaign.shots) - curves.shots
    lacking = f" {missing} shots have no curves beside their reports." if missing else ""
    return Figure(
        "curves",
        "All shots laid over one another",
        f"Behind the low-pass, from the onset of force: {what}{apart}.{lacking}",
        "time after the onset of force, ms",
        tuple(panels),
        single=True,
    )
