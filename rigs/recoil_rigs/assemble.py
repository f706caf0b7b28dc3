"""From recordings and a rig to channels: which signal is which channel, and its samples in SI.

Nothing is aligned, resampled or filled here. A signal that the rig names and the file does not have is
an error that lists the names the file has, nearest first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel, Step
from recoil_acquisition.errors import Fault, ReadError, RigError
from recoil_acquisition.quantity import SI_UNITS, Unit, find_unit
from recoil_acquisition.readers.reader import SignalHeader
from recoil_acquisition.readers.recording import Recording
from recoil_rigs.rig import ChannelSpec, Rig, Sensor, Source

Array = NDArray[np.float64]


def assemble_channels(rig: Rig, recordings: Mapping[str, Recording], version: str) -> dict[str, Channel]:
    """Turn recordings into the rig's channels.

    Parameters
    ----------
    recordings
        By the source that each file was matched to; a source may be missing.
    version
        Of the package, for the channels' history.

    Returns
    -------
    dict of str to Channel
        In the order of the rig; channels of missing sources are left out.

    Raises
    ------
    MissingChannelError
        If a file does not have a signal that the rig names.
    RigError
        If units contradict, with every contradiction.
    ReadError
        If the samples cannot be read.
    """
    faults: list[Fault] = []
    units: dict[str, Unit] = {}
    found: list[tuple[ChannelSpec, Recording, SignalHeader]] = []
    for spec in rig.channels:
        recording = recordings.get(spec.source)
        if recording is None:
            continue
        header = find_signal(recording, spec.signal)
        unit = unit_of(spec, header, rig.source(spec.source), recording.path, faults)
        if unit is not None:
            units[spec.name] = unit
            found.append((spec, recording, header))
    if faults:
        raise RigError(rig.path, faults)
    return {
        spec.name: _channel(spec, recording, header, units[spec.name], version) for spec, recording, header in found
    }


def find_signal(recording: Recording, name: str) -> SignalHeader:
    """Return the header of a signal that the rig names.

    Raises
    ------
    MissingChannelError
        If the file does not have it, with the names that it has.
    """
    for header in recording.signals:
        if header.name == name:
            return header
    # reading an unknown name is the recording's own error, with the names that exist
    recording.read(name, 0, 0)
    raise ReadError(f"signal {name!r} is not listed", path=recording.path)


def unit_of(spec: ChannelSpec, header: SignalHeader, source: Source, path: Path, faults: list[Fault]) -> Unit | None:
    """Return the unit of the file's numbers: as the file states it, else as the rig does; they may not contradict."""
    key = f"channel '{spec.name}'.unit"
    stated = header.unit.strip()
    in_pixels = _is_pixels(stated or spec.unit or "")
    if stated and spec.unit is not None and in_pixels != _is_pixels(spec.unit):
        faults.append(Fault(key, f"the rig says {spec.unit!r}, {path.name} says {stated!r} for {spec.signal!r}"))
        return None
    if in_pixels:
        if spec.quantity != "displacement":
            faults.append(Fault(key, f"{path.name} has {spec.signal!r} in pixels, which is no unit of {spec.quantity}"))
        elif source.scale_mm_per_px is None:
            faults.append(Fault(f"source '{source.name}'.scale_mm_per_px", f"is needed: {path.name} is in pixels"))
        else:
            return Unit(frozenset({"displacement"}), 1e-3 * source.scale_mm_per_px)
        return None
    spelling = stated or spec.unit
    if spelling is None:
        faults.append(Fault(key, f"is needed: {path.name} states no unit for {spec.signal!r}"))
        return None
    unit = find_unit(spelling)
    if unit is None:
        faults.append(Fault(key, f"{path.name} has {spec.signal!r} in {spelling!r}, which is no known unit"))
        return None
    declared = find_unit(spec.unit) if spec.unit is not None else None
    if stated and declared is not None and declared != unit:
        faults.append(Fault(key, f"the rig says {spec.unit!r}, {path.name} says {stated!r} for {spec.signal!r}"))
        return None
    wanted = "voltage" if spec.sensor.sensitivity is not None and "voltage" in unit.quantities else spec.quantity
    if wanted not in unit.quantities:
        faults.append(
            Fault(key, f"{path.name} has {spec.signal!r} in {spelling!r}, which is no unit of {spec.quantity}")
        )
        return None
    return unit


def _is_pixels(spelling: str) -> bool:
    return spelling.strip().casefold() in ("px", "pixel", "pixels")


def _channel(spec: ChannelSpec, recording: Recording, header: SignalHeader, unit: Unit, version: str) -> Channel:
    samples = in_si(spec, unit, recording.read(header.name))
    history = [
        Step(
            "read",
            version,
            {"file": recording.path.name, "reader": recording.reader, "signal": header.name, "unit": header.unit},
        ),
        Step("convert to SI", version, {"factor": unit.factor, "offset": unit.offset}),
    ]
    sensor = spec.sensor
    factor = sensor_factor(sensor, "voltage" in unit.quantities)
    if factor != 1.0:
        history.append(Step("apply sensitivity", version, {"factor_per_volt": factor}))
    if (sensor.gain, sensor.offset) != (1.0, 0.0):
        history.append(Step("apply calibration", version, {"gain": sensor.gain, "offset": sensor.offset}))
    if spec.polarity == -1:
        history.append(Step("turn polarity", version, {}))
    raw = recording.raw(header.name)
    return Channel(
        name=spec.name,
        quantity=spec.quantity,
        samples=samples,
        time_base=recording.time_base(header.name),
        signal=spec.signal,
        role=spec.role,
        u_rel=sensor.u_scale_rel,
        resolution=0.0 if raw is None else abs(raw.gain * si_line(spec, unit)[0]),
        raw=raw,
        history=tuple(history),
    )


def in_si(spec: ChannelSpec, unit: Unit, values: Array) -> Array:
    """Turn the file's numbers into the channel's SI samples, see `si_line`.

    Parameters
    ----------
    unit
        Of the file's numbers; see `unit_of`.
    values : ndarray of float64, shape (n_samples,)

    Returns
    -------
    ndarray of float64, shape (n_samples,)
    """
    factor, offset = si_line(spec, unit)
    return factor * values + offset


def si_line(spec: ChannelSpec, unit: Unit) -> tuple[float, float]:
    """Factor and offset of ``SI value = factor * number + offset``: unit, sensitivity, calibration, polarity.

    Parameters
    ----------
    unit
        Of the file's numbers; see `unit_of`. A calibration counts in it: a gain on degrees Celsius is none on kelvins.
    """
    sensor = spec.sensor
    factor = sensor_factor(sensor, "voltage" in unit.quantities)
    own = _own_unit(spec)
    offset = unit.offset * factor + sensor.offset * (1.0 if own is None else own.factor)
    return spec.polarity * sensor.gain * unit.factor * factor, spec.polarity * offset


def sensor_factor(sensor: Sensor, in_volts: bool) -> float:
    """SI units of the measured quantity per volt of the recorder; 1 where the file is not in volts.

    A charge amplifier turns ``sensitivity`` (pC per SI unit) into volts by ``amplifier`` (V/pC); a
    voltage sensor's ``sensitivity`` (mV or V per SI unit) is multiplied by the gain ``amplifier``.
    """
    if not in_volts or sensor.sensitivity is None:
        return 1.0
    volts = {"pC": 1.0, "mV": 1e-3, "V": 1.0}[sensor.sensitivity_unit or "V"]
    return 1.0 / (sensor.sensitivity * volts * sensor.amplifier)


def range_si(spec: ChannelSpec) -> tuple[float, float] | None:
    """Return the sensor's declared range in SI; its numbers are in the channel's unit, or SI without one.

    A record is clipped where its recorded values reach the range, so that the calibration corrects the range with them.
    """
    sensor = spec.sensor
    if sensor.range is None:
        return None
    unit = _own_unit(spec)
    low, high = (sensor.gain * limit + spec.polarity * sensor.offset for limit in sensor.range)
    return (low, high) if unit is None else (unit.to_si(low), unit.to_si(high))


def shown_unit(spec: ChannelSpec) -> tuple[str, Unit]:
    """Return the unit that a channel's values are shown in, with its name: the rig's, or SI where it states none."""
    unit, si = _own_unit(spec), SI_UNITS[spec.quantity]
    if spec.unit is None or unit is None or (unit.factor, unit.offset) == (1.0, 0.0):
        return si, Unit(frozenset({spec.quantity}), 1.0)
    return spec.unit, unit


def _own_unit(spec: ChannelSpec) -> Unit | None:
    """Return the unit that the rig states for a channel; None if it states none, or that of the recorder's volts."""
    unit = find_unit(spec.unit) if spec.unit is not None else None
    return unit if unit is not None and spec.quantity in unit.quantities else None


def match_files(rig: Rig, files: Sequence[tuple[Path, str]]) -> dict[str, Path]:
    """Match files to the rig's sources, by the sources' patterns first and by kind where that is unique.

    Parameters
    ----------
    files
        The kind is that of the reader which claimed the file, or empty if none did.

    Returns
    -------
    dict of str to Path
        By source.

    Raises
    ------
    ReadError
        If a file fits no source or several, or a source gets two files.
    """
    matched: dict[str, Path] = {}
    for path, kind in files:
        candidates = [s for s in rig.matching(path.name) if kind in ("", s.kind)]
        if not candidates:
            candidates = [s for s in rig.sources if kind == s.kind and s.match is None]
        if not candidates:
            candidates = [s for s in rig.sources if kind == s.kind]
        known = ", ".join(f"{s.name} ({s.kind}{f', {s.match}' if s.match else ''})" for s in rig.sources)
        if not candidates:
            raise ReadError(
                f"a {f'{kind} file' if kind else 'file that no reader recognises'} fits no source of rig {rig.name!r}",
                path=path, expected=known, remedy="leave it out, or declare its source in the rig file",
            )  # fmt: skip
        if len(candidates) > 1:
            raise ReadError(
                f"fits several sources: {', '.join(s.name for s in candidates)}",
                path=path, remedy="assign each with `match` in the rig file",
            )  # fmt: skip
        name = candidates[0].name
        if name in matched:
            raise ReadError(
                f"source {name!r} already has {matched[name].name}", path=path, remedy="give one file per source"
            )
        matched[name] = path
    return matched
