"""Traceability of a document: the chain of every channel, the constants with their uncertainties, the rig's text."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_acquisition.shot.shot import Shot
from recoil_identification.inference.estimate import Estimate
from recoil_processing.shot.error_source import ErrorSource
from recoil_rigs.mechanism.mechanism_parameters import MEANINGS
from recoil_rigs.rig import Rig
from recoil_rigs.tables.channel_table import ChannelSpec, Sensor

Document = dict[str, Any]

CHAIN = (
    "sensitivity", "sensitivity_unit", "amplifier", "gain", "u_gain", "offset", "time_constant_s", "u_time_constant_s",
    "filter_hz", "filter_type", "filter_order", "delay_s", "u_delay_s", "resonance_hz", "resonance_damping",
)  # fmt: skip
"""Keys of a sensor that say through what its signal goes."""
KNOWN_BY = (
    "U_rel",
    "k",
    "nu",
    "calibration",
    "u_zero_rel",
    "u_linearity_rel",
    "u_distortion_m",
    "reference",
    "u_reference_rel",
)
"""Further keys of a sensor that say how well it is known, as far as it has them."""
LEAST_CORRELATION = 0.3
"""Magnitude from which on a correlation is stated."""
MOST_CORRELATIONS = 20
"""Number of correlations that are stated, the largest first."""


def channels_of(shot: Shot, rig: Rig) -> list[Document]:
    """State the chain of each channel of a shot that the rig declares, in the rig's order."""
    return [_channel(spec, rig) for spec in rig.channels if spec.name in shot.channels]


def _channel(spec: ChannelSpec, rig: Rig) -> Document:
    return {
        "channel": spec.name,
        "role": spec.role or None,
        "quantity": spec.quantity,
        "unit": spec.own_unit_name or SI_UNITS[spec.quantity],
        "signal": spec.signal,
        "clock": spec.source,
        "recorder": rig.source(spec.source).kind,
        **sensor_of(spec),
    }


def sensor_of(spec: ChannelSpec) -> Document:
    """State type, serial number, certificate, range, u and chain of a channel's sensor; null where it is not stated."""
    sensor = spec.sensor
    return {
        "model": sensor.model or None,
        "serial": sensor.serial or None,
        "certificate": sensor.certificate or None,
        "calibrated": None if sensor.calibrated is None else sensor.calibrated.isoformat(),
        "due": None if sensor.due is None else sensor.due.isoformat(),
        "range": None if sensor.range is None else list(sensor.range),
        "u": sensor.u_scale_rel if sensor.states_u_rel else None,
        "known_by": _stated(sensor, KNOWN_BY),
        "chain": {**_stated(sensor, CHAIN), **({"polarity": spec.polarity} if spec.polarity != 1 else {})},
    }


def _stated(sensor: Sensor, keys: Sequence[str]) -> Document:
    """Return what a rig file states of some keys."""
    return {key: getattr(sensor, key) for key in keys if key in sensor.model_fields_set}


def sensor_of_source(source: ErrorSource, rig: Rig) -> Document:
    """Return the sensor of a source of error, with its channel; empty unless it is of one channel of the rig."""
    specs = [one for one in rig.channels if source.of and source.of in (one.role, one.name)]
    return {"channel": specs[0].name, **sensor_of(specs[0])} if len(specs) == 1 else {}


def constants_of(rig: Rig) -> list[Document]:
    """State the constants of the mechanism, as the rig file states them or as they are taken where it does not."""
    mechanism, found = rig.mechanism, []
    of_model = mechanism.symbols_of({channel.role for channel in rig.channels})
    for symbol, meaning in MEANINGS.items():
        if symbol not in of_model:
            continue
        value = getattr(mechanism, symbol, None)
        if not isinstance(value, float | int) or not math.isfinite(value):
            continue
        u = mechanism.u.get(symbol)
        if symbol == "m3":  # as the rig file has it: what was added is the shot log's
            value, u = rig.specification.m3_kg, rig.specification.u_m3_kg or None
        found.append({"symbol": symbol, "value": value, "u": u, "meaning": meaning})
    return found


def rig_of(shot: Shot) -> Document:
    """State the rig file's text that the shot file holds, by its digest."""
    return {"name": shot.rig_name, "sha256": hashlib.sha256(shot.rig_text.encode("utf-8")).hexdigest()}


def correlations_of(inferred: Estimate) -> list[Document]:
    """State how the estimated quantities hang together: the largest correlations, but for shapes that are many."""
    covariance = inferred.covariance
    names = [unknown.name for unknown in inferred.unknowns]
    pairs = []
    for i, one in enumerate(names):
        for k in range(i + 1, len(names)):
            scale = float(covariance[i, i] * covariance[k, k])
            if scale > 0 and inferred.determined[i] and inferred.determined[k]:
                pairs.append((one, names[k], float(covariance[i, k]) / scale**0.5))
    largest = sorted((pair for pair in pairs if abs(pair[2]) >= LEAST_CORRELATION), key=lambda pair: -abs(pair[2]))
    return [{"one": one, "other": other, "r": r} for one, other, r in largest[:MOST_CORRELATIONS]]


def estimates_of(inferred: Estimate, sources: Sequence[ErrorSource]) -> Mapping[ErrorSource, float]:
    """Return by how much each source is off as the shot and the certificates together say, in the source's unit."""
    return dict(zip(sources, (inferred.pulls * inferred.u_sources).tolist(), strict=True))
