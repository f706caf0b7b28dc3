"""The signals of a shot, filtered and thinned to rows of the equations of motion."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.rows.causes import Cause
from recoil_identification.rows.late_readings import settled_by_late_readings
from recoil_identification.rows.recorded_causes import recorded_causes
from recoil_identification.shot.preparation import Prepared
from recoil_identification.targets.parameters.load_cells import LOAD_CELLS
from recoil_identification.targets.parameters.mechanism_rows import MechanismRows
from recoil_identification.targets.parameters.sensor_errors import SensorError, released, sensor_errors
from recoil_processing.double_integral import integrate
from recoil_processing.filters import ROWS_PER_CUTOFF, LowPassFilter, filter_alike
from recoil_processing.filters.analog_filter import AnalogLowPass
from recoil_processing.gaps import bridge
from recoil_processing.shot.instants import anti_alias_filter
from recoil_processing.shot.projectile import breech_force_on_body_n
from recoil_processing.shot.regression import FORCES, PRESSURE_ROLES, Regression
from recoil_rigs.mechanism.mechanism_regressor import Geometry
from recoil_rigs.shots.fired_shot import FiredShot

Columns = Mapping[str, Array]

TURNING_COLUMNS = ("f_x", "f_y", "w1", "w2")
"""Columns of the carriage's motion and the angular rates."""


def mechanism_rows(
    fired: FiredShot,
    prepared: Prepared,
    recorded: Regression,
    loads: Mapping[str, Array],
    low_pass: LowPassFilter,
    *,
    rows_hz: float | None = None,
    turning: LowPassFilter | None = None,
) -> MechanismRows:
    """Filter, thin and describe what a shot recorded for the equations of motion.

    Parameters
    ----------
    prepared
        Prepared signals with the carriage's accelerations and both angular rates.
    recorded
        The fifth equation as recorded.
    loads : mapping of str to ndarray, shape (n,)
        Loads of `recoil_identification.targets.parameters.load_cells.measured_loads`.
    low_pass
        Low-pass of all columns.
    rows_hz
        Rows per second; `ROWS_PER_CUTOFF` per period of the cut-off if left out.
    turning
        Another one for the carriage's accelerations and the angular rates. Not for a regression: it is for
        forces computed from the motion, in which stress waves on these small terms would be differentiated.
    """
    m, signals, s = fired.rig.mechanism, prepared.signals, prepared.signals.series
    step, times = signals.step_s, signals.times_s
    causes, lacking_n = settled_by_late_readings(
        recorded_causes(recorded, signals, fired), signals, recorded.interval_s
    )
    forces_n = recorded.forces_n.copy()
    forces_n[:, : lacking_n.shape[1]] += lacking_n
    in_baseline = (times >= signals.baseline_s[0]) & (times < signals.baseline_s[1])
    raw = {
        "acc": s["recoil_acceleration"],
        "held": prepared.static_m_s2 * (1.0 - recorded.released),
        "f_x": s["carriage_acceleration_x"],
        "f_y": s["carriage_acceleration_y"],
        "w1": s["carriage_rate"],
        "w2": s["tipping_rate"],
        "x": prepared.travel_m,
        "dx": prepared.velocity_m_s,
        "released": recorded.released,
        "friction_direction": recorded.friction_direction,
        "breech": breech_force_on_body_n(s["breech_pressure"], step, m) + lacking_n[:, 0],
        **loads,
        **{released(name): column for name, column in zip(FORCES, forces_n.T, strict=True)},
    }
    # what repairs may have left passes the same filter, and is no column of the equations
    left = {of: f"left {number}" for number, of in enumerate(signals.left)}
    raw |= {left[of]: remainder for of, remainder in signals.left.items()}
    # nor is what else may be off of the forces and of the instants of the motion
    acting = {_acting(number, name): column for number, one in enumerate(causes) for name, column in _directions(one)}
    raw |= acting
    slow = {name: raw.pop(name) for name in TURNING_COLUMNS} if turning is not None else {}
    table = filter_alike(low_pass, raw, signals.rate_hz)
    full, trusted = dict(table), table.trusted
    remainders = {of: full.pop(name) for of, name in left.items()}
    moved = {name: full.pop(name) for name in acting}
    if turning is not None:
        other = filter_alike(turning, slow, signals.rate_hz)
        full |= other
        trusted = trusted & other.trusted
        raw |= slow
    for role, names in _RECORDED.items():
        spec = fired.rig.by_role(role)
        chain = None if spec is None else anti_alias_filter(spec.sensor)
        if chain is not None:
            full |= {name: _without_chain(full[name], chain, step) for name in names if name in full}
    for name in ("w1", "w2"):
        full[f"d{name}"] = np.gradient(full[name], step)
    full["alpha"] = integrate(full["w1"], step)
    full["beta"] = integrate(full["w2"] - full["w1"], step)
    # as recorded: the filter spreads the pulse into the pre-trigger baseline
    rest = {name: float(np.nanmean(column[in_baseline])) for name, column in loads.items()} | {"breech": 0.0}
    errors = sensor_errors(fired, prepared, full, remainders, rest, signals.onset_s)
    listed = {error.source for error in errors}
    errors += [
        SensorError(one.source, one.u, one.unit, {name: moved[_acting(number, name)] for name, _ in _directions(one)})
        for number, one in enumerate(causes)
        if one.source not in listed
    ]
    stride = max(1, int(signals.rate_hz / (rows_hz or ROWS_PER_CUTOFF * low_pass.cutoff_hz)))
    first = int(np.searchsorted(times, signals.onset_s))
    rows = np.arange(first % stride, times.size, stride)
    spec = fired.rig.by_role("recoil_acceleration")
    r5, r6 = spec.sensor.position if spec is not None else (0.0, 0.0)
    thinned = tuple(replace(e, directions={name: d[rows] for name, d in e.directions.items()}) for e in errors)
    begun = times[rows] >= signals.onset_s - low_pass.reach_s
    inside = (times[rows] >= recorded.interval_s[0]) & (times[rows] <= recorded.interval_s[1])
    return MechanismRows(
        times_s=times[rows],
        columns={name: column[rows] for name, column in full.items()},
        errors=thinned,
        geometry=Geometry.of(m),
        place=(m.b + r5, m.d + r6),
        carriage_place=(m.XA + prepared.motion.r_x, m.YA + prepared.motion.r_y),
        rest=rest,
        recoils=inside & trusted[rows],
        trusted=begun & trusted[rows],
        noise=_noise({"acc": raw["acc"][in_baseline]}, low_pass, step)
        | _noise({name: raw[name][in_baseline] for name in TURNING_COLUMNS}, turning or low_pass, step),
        baseline_s=float(np.count_nonzero(in_baseline)) * step,
        cutoff_hz=low_pass.cutoff_hz,
    )


def _directions(cause: Cause) -> Iterator[tuple[str, Array]]:
    """Yield what a size of one adds to the columns of the equation along the bore, by their names."""
    for name, column in zip(FORCES, cause.forces_n.T, strict=False):
        if np.any(column):
            yield released(name), -column
            if name == "breech":
                yield name, -column
    if np.any(cause.acceleration_m_s2):
        yield "acc", cause.acceleration_m_s2


def _acting(number: int, name: str) -> str:
    return f"cause {number} of {name}"


def _noise(baseline: Columns, low_pass: LowPassFilter, step_s: float) -> dict[str, float]:
    """Return the standard deviation of each column behind the low-pass, of angular rates that of their derivatives.

    The baseline is filtered alone: the pulse behind it would spread into it.
    """
    found = {}
    for name, samples in baseline.items():
        margin = math.ceil(0.5 / (low_pass.cutoff_hz * step_s))
        if samples.size <= 4 * margin or not np.isfinite(samples).any():
            continue
        smooth = low_pass.apply(bridge(samples), 1.0 / step_s)
        rate = name in ("w1", "w2")
        feels = np.gradient(smooth, step_s) if rate else smooth
        found[f"d{name}" if rate else name] = float(np.std(feels[margin:-margin]))
    return found


_RECORDED = {
    "recoil_acceleration": ("acc",),
    "carriage_acceleration_x": ("f_x",),
    "carriage_acceleration_y": ("f_y",),
    "carriage_rate": ("w1",),
    "tipping_rate": ("w2",),
    **{role: (released(name),) for role, name in zip(PRESSURE_ROLES, FORCES, strict=False)},
    **{role: (load,) for load, role in LOAD_CELLS.items()},
}
"""Role -> columns that its chain has filtered."""
LEAST_CHAIN_GAIN = 0.5
"""Gain of a chain below which a reading is not raised to what it was: noise would be raised with it."""


def _without_chain(samples: Array, chain: AnalogLowPass, step_s: float) -> Array:
    """Raise what a chain's filter has lowered; its delay is off already.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples behind a low-pass, so that little is left where the chain lets little through.
    """
    # a record that ends on another level than it began on would ring: its line is left as it is
    line = np.linspace(samples[0], samples[-1], samples.size)
    spectrum = np.fft.rfft(samples - line)
    gain = chain.gain(np.asarray(np.fft.rfftfreq(samples.size, step_s), dtype=np.float64))
    return np.asarray(np.fft.irfft(spectrum / np.maximum(gain, LEAST_CHAIN_GAIN), samples.size) + line)
