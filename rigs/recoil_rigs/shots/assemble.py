"""From recordings and a rig to channels: which signal is which channel, and its samples in SI.

Nothing is aligned, resampled or filled here. A signal that the rig names and the file does not have is
an error that lists the names the file has, nearest first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from recoil_acquisition.channel import MASK_OVERLOADS, Channel, Step
from recoil_acquisition.errors import ErrorCode, Fault, FaultCode, ReadError, RigError, Row
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.quantities.quantity import SI_UNITS, UNITS, Unit, find_unit
from recoil_acquisition.quantities.unit_choice import SI, UnitChoice
from recoil_acquisition.readers.own_rows import own_rows
from recoil_acquisition.readers.recording import Recording, SignalHeader
from recoil_rigs.rig import ChannelSpec, Rig, Source


def assemble_channels(rig: Rig, recordings: Mapping[str, Recording], version: str) -> dict[str, Channel]:
    """Turn recordings into the rig's channels.

    Parameters
    ----------
    recordings
        Recordings by the source that each file was matched to; a source may be missing.
    version
        Version of the package, for the channels' history.

    Returns
    -------
    dict of str to Channel
        Channels in the order of the rig; those of missing sources are left out.

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
    # reading an unknown name is the recording's own error, with the names that exist; another name is none
    recording.read(name, 0, 0)
    if isinstance(recording, Recording):
        return recording.header(name)
    raise ReadError(f"signal {name!r} is not listed", path=recording.path)


def unit_of(spec: ChannelSpec, header: SignalHeader, source: Source, path: Path, faults: list[Fault]) -> Unit | None:
    """Return the unit of the file's numbers: as the file states it, else as the rig does; they may not contradict.

    What is no known unit states none.
    """

    def contradiction(problem: str, code: FaultCode = FaultCode.UNIT) -> None:
        faults.append(Fault((Row("channel", spec.name), "unit"), problem, code))

    stated = header.unit.strip()
    in_pixels = _is_pixels(stated or spec.unit or "")
    if stated and spec.unit is not None and in_pixels != _is_pixels(spec.unit):
        contradiction(f"the rig says {spec.unit!r}, {path.name} says {stated!r} for {spec.signal!r}")
        return None
    if in_pixels:
        if spec.quantity != "displacement":
            contradiction(f"{path.name} has {spec.signal!r} in pixels, which is no unit of {spec.quantity}")
        elif source.scale_mm_per_px is None:
            key = (Row("source", source.name), "scale_mm_per_px")
            faults.append(Fault(key, f"is needed: {path.name} is in pixels", FaultCode.MISSING))
        else:
            return Unit(frozenset({"displacement"}), 1e-3 * source.scale_mm_per_px)
        return None
    unknown = f"{path.name} has {spec.signal!r} in {stated!r}, which is no known unit"
    if unknown_unit(spec, header):
        stated = ""
    spelling = stated or spec.unit
    if spelling is None:
        contradiction(f"is needed: {path.name} states no unit for {spec.signal!r}", FaultCode.MISSING)
        return None
    unit = find_unit(spelling)
    if unit is None:
        contradiction(f"{unknown}: declare `unit`, or the source's `layout` where the file is read wrongly")
        return None
    from_chain = chain_applies(spec, unit)
    declared = find_unit(spec.unit) if spec.unit is not None else None
    # where the file has the volts of a chain, the rig may state the unit of what is measured
    in_words = from_chain and declared is not None and spec.quantity in declared.quantities
    if stated and declared is not None and declared != unit and not in_words:
        contradiction(f"the rig says {spec.unit!r}, {path.name} says {stated!r} for {spec.signal!r}")
        return None
    if not from_chain and spec.quantity not in unit.quantities:
        contradiction(f"{path.name} has {spec.signal!r} in {spelling!r}, which is no unit of {spec.quantity}")
        return None
    return unit


def unknown_unit(spec: ChannelSpec, header: SignalHeader) -> bool:
    """Return whether a file states what is no known unit, so that the rig's counts."""
    return spec.unit is not None and bool(header.unit.strip()) and find_unit(header.unit.strip()) is None


def about_unknown_unit(spec: ChannelSpec, header: SignalHeader, path: Path) -> str:
    """Return the warning of a unit that is none: what counts, and what to do if it is wrong."""
    return (
        f"{path.name} has {header.name!r} in {header.unit.strip()!r}, which is no known unit: the rig's {spec.unit!r} "
        "counts; if the file is read wrongly, declare the source's `layout`"
    )


def _is_pixels(spelling: str) -> bool:
    return spelling.strip().casefold() in ("px", "pixel", "pixels")


def _channel(spec: ChannelSpec, recording: Recording, header: SignalHeader, unit: Unit, version: str) -> Channel:
    samples, base = in_si(spec, unit, recording.read(header.name)), recording.time_base(header.name)
    # what has signals as a recording has, and is none, marks nothing
    marked = getattr(recording, "overloads", None)
    overloads = 0 if marked is None else int(marked(header.name))
    history = [
        Step(
            "read",
            version,
            {"file": recording.path.name, "reader": recording.reader, "signal": header.name, "unit": header.unit},
        ),
        *([Step(MASK_OVERLOADS, version, {"samples": overloads})] if overloads else []),
        Step("convert to SI", version, {"factor": unit.factor, "offset": unit.offset}),
    ]
    sensor = spec.sensor
    factor = sensor_factor(spec, unit)
    if factor != 1.0:
        history.append(Step("apply sensitivity", version, {"factor_per_volt": factor}))
    if (sensor.gain, sensor.offset) != (1.0, 0.0):
        history.append(Step("apply calibration", version, {"gain": sensor.gain, "offset": sensor.offset}))
    if spec.polarity == -1:
        history.append(Step("turn polarity", version, {}))
    raw = recording.raw(header.name)
    rows = own_rows(samples)
    if rows is not None:
        samples, base = samples[rows], base.every(rows)
        raw = None if raw is None else replace(raw, counts=raw.counts[rows])
        history.append(Step("take its own rows", version, {"first": rows.start + 1, "of": rows.step}))
    return Channel(
        name=spec.name,
        quantity=spec.quantity,
        samples=samples,
        time_base=base,
        signal=spec.signal,
        role=spec.role,
        u_rel=spec.u_scale_rel,
        resolution=0.0 if raw is None else abs(raw.gain * si_line(spec, unit)[0]),
        raw=raw,
        history=tuple(history),
    )


def in_si(spec: ChannelSpec, unit: Unit, values: Array) -> Array:
    """Turn the file's numbers into the channel's SI samples, see `si_line`.

    Parameters
    ----------
    unit
        Unit of the file's numbers; see `unit_of`.
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
        Unit of the file's numbers; see `unit_of`. A calibration counts in it: a gain on degrees Celsius is none on
        kelvins.
    """
    sensor, own, sensitivity = spec.sensor, spec.own_unit, spec.sensitivity
    factor = sensor_factor(spec, unit)
    zero = 0.0
    if sensitivity is not None and chain_applies(spec, unit):
        zero = sensitivity.per.offset - sensor.gain * spec.measured_at_zero_si
    offset = unit.offset * factor + sensor.offset * (1.0 if own is None else own.factor) + zero
    return spec.polarity * sensor.gain * unit.factor * factor, spec.polarity * offset


def shown_unit(
    spec: ChannelSpec, stated: str = "", unit: Unit | None = None, chosen: UnitChoice = SI
) -> tuple[str, Unit]:
    """Return the unit in which people read a channel, and its spelling: that chosen, its own, the file's, or SI.

    Parameters
    ----------
    stated
        Unit as the file has it; empty if it states none, or there is no file.
    unit
        Unit of the file's numbers, see `unit_of`.
    chosen
        Units that the rig chose to be read.
    """
    if (name := chosen.by_quantity.get(spec.quantity)) and (wanted := find_unit(name)) is not None:
        return name, wanted
    if spec.own_unit is not None:
        return str(spec.own_unit_name), spec.own_unit
    if unit is not None and spec.quantity in unit.quantities and stated.strip() and find_unit(stated.strip()) == unit:
        return stated.strip(), unit
    return SI_UNITS[spec.quantity], UNITS[SI_UNITS[spec.quantity]]


def chain_applies(spec: ChannelSpec, unit: Unit) -> bool:
    """Whether a file's numbers in a unit are what the chain behind the channel's sensor gives out."""
    sensitivity = spec.sensitivity
    return sensitivity is not None and sensitivity.turned_into(unit)


def sensor_factor(spec: ChannelSpec, unit: Unit) -> float:
    """SI units of the measured quantity per SI unit of the file's numbers; 1 where those are of the quantity itself.

    A charge amplifier turns picocoulombs into volts by ``amplifier`` (V/pC); of a sensor that gives out volts
    ``amplifier`` is the gain.
    """
    sensitivity = spec.sensitivity
    if sensitivity is None or not chain_applies(spec, unit):
        return 1.0
    return sensitivity.per_recorded(unit, spec.sensor.amplifier)


def match_files(rig: Rig, files: Sequence[tuple[Path, str]]) -> dict[str, Path]:
    """Match files to the rig's sources, by the sources' patterns first and by kind where that is unique.

    Sources of a CAN log that each say which bus they are share a file.

    Parameters
    ----------
    files
        Files with the kind of each: that of the reader which claimed it, or empty if none did.

    Returns
    -------
    dict of str to Path
        Files by source.

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
                code=ErrorCode.NO_SOURCE, path=path, expected=known,
                remedy="leave it out, or declare its source in the rig file",
            )  # fmt: skip
        if len(candidates) > 1 and any(s.bus is None for s in candidates):
            of_can = all(s.kind == "can" for s in candidates)
            raise ReadError(
                f"fits several sources: {', '.join(s.name for s in candidates)}",
                path=path, remedy="assign each with `match` in the rig file"
                + (", or let each say by `bus` which bus of the file it is" if of_can else ""),
            )  # fmt: skip
        for name in (s.name for s in candidates):
            if name in matched:
                raise ReadError(
                    f"source {name!r} already has {matched[name].name}", path=path,
                    found=_named_for_others(rig, path, kind), remedy="give one file per source",
                )  # fmt: skip
            matched[name] = path
    return matched


def _named_for_others(rig: Rig, path: Path, kind: str) -> str | None:
    """Say for which sources of other kinds a file's name is, which by its content it cannot be; None if for none."""
    others = [source for source in rig.matching(path.name) if kind not in ("", source.kind)]
    if not others:
        return None
    names = " and ".join(f"{source.name!r} ({source.kind})" for source in others)
    return f"a {kind} file whose name fits the `match` of {names}: nothing that reads such a source's files knows it"
