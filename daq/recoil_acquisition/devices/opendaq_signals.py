"""Signals of an openDAQ device as channels that count their samples; used in the process that reads it alone.

Nothing here imports the library: it is handed over. Each signal has a reader of its own, whose status is always asked
for: a reader of several shifts them against each other after a reconnection and says nothing, one without status hides
gaps, and one that gives times goes through float64, which is off by up to 240 ns.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.streams.tick_stream import StreamDescription, TickChannel

MOST_SAMPLES = 8000
"""Samples of one read: the library allocates them all, however few come (a million costs ten times as much each)."""
_MOST_READS = 8
_TYPES = {
    "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4", "Int64": "i8",
    "UInt64": "u8", "Float32": "f4", "Float64": "f8",
}  # fmt: skip
_EXPLICIT, _LINEAR = "Explicit", "Linear"
_SECOND = "s"


class SignalsChangedError(Exception):
    """Error that says that the signals are others by now, so that the device is to be connected anew."""


class _UnusableError(Exception):
    """Signal that is no row of numbers over time; its text says why."""


@dataclass(frozen=True, eq=False)
class Run(ReadOnlyArrays):
    """Samples of one channel that follow each other without a gap.

    Attributes
    ----------
    is_apart
        Whether samples are missing before it, or it overlaps what came before.
    is_of_another_grid
        Whether its ticks are not a whole number of steps from those before.
    """

    ticks: Array
    values: Array
    is_apart: bool
    is_of_another_grid: bool


@dataclass(frozen=True)
class Changed:
    """Statement of a channel's that changed: what follows is of the new one."""

    channel: TickChannel


@dataclass(frozen=True)
class _Form:
    """How a signal's values and ticks come, by its descriptors."""

    channel: TickChannel
    sample_type: str
    is_scaled: bool
    start_utc_ns: int | None


class SignalReader:
    """One signal, read by ticks.

    Parameters
    ----------
    daq
        The library.
    signal
        Signal with a domain signal; both have their descriptors.
    """

    def __init__(self, daq: Any, signal: Any, name: str) -> None:
        self._daq, self._name, self._id = daq, name, str(signal.global_id)
        self._value, self._domain = signal.descriptor, signal.domain_signal.descriptor
        self._form = _form(self._value, self._domain, name, self._id)
        self._next: int | None = None
        form = self._form
        self._reader = daq.StreamReader(
            signal,
            getattr(daq.SampleType, form.sample_type),
            daq.SampleType.Int64,
            daq.ReadMode.Unscaled if form.is_scaled else daq.ReadMode.Scaled,
            daq.ReadTimeoutType.Any,
            0,  # events are not passed over
        )

    @property
    def channel(self) -> TickChannel:
        """The channel as it is described now."""
        return self._form.channel

    @property
    def identifier(self) -> str:
        """Identifier of the signal in its device."""
        return self._id

    @property
    def start_utc_ns(self) -> int | None:
        """Instant of tick 0."""
        return self._form.start_utc_ns

    def forget_grid(self) -> None:
        """Take whatever comes next for the first sample."""
        self._next = None

    def read(self) -> Iterator[Run | Changed]:
        """Return what waits, in its order.

        Raises
        ------
        SignalsChangedError
            If the reader cannot go on.
        """
        for _ in range(_MOST_READS):
            values, ticks, status = self._reader.read_with_domain(MOST_SAMPLES, 0, True)
            if len(values):
                yield from self._runs(ticks, values)
            if status.read_status == self._daq.ReadStatus.Event:
                yield from self._event(status.event_packet)
            elif status.read_status == self._daq.ReadStatus.Fail:
                raise SignalsChangedError(f"the library cannot go on reading '{self._name}'")
            elif len(values) < MOST_SAMPLES:
                return

    def _runs(self, ticks: Array, values: Array) -> Iterator[Run]:
        step = self._form.channel.step
        apart = np.diff(ticks)
        cuts = [0, *(np.flatnonzero(apart != step if step else apart <= 0) + 1).tolist(), len(ticks)]
        for start, stop in pairwise(cuts):
            apart_ticks = int(ticks[start]) - self._next if step and self._next is not None else 0
            strange = bool(step) and apart_ticks % step != 0
            yield Run(ticks[start:stop], values[start:stop], apart_ticks != 0, strange)
            self._next = int(ticks[stop - 1]) + step  # behind it, for who takes it may forget the grid

    def _event(self, packet: Any) -> Iterator[Changed]:
        """Note new descriptors; a gap needs nothing, for the ticks show it."""
        if packet is None or str(packet.event_id) != "DATA_DESCRIPTOR_CHANGED":
            return
        stated = dict(packet.parameters)
        for key in ("DataDescriptor", "DomainDataDescriptor"):
            given = stated.get(key)
            if given is None:
                continue
            descriptor = self._daq.IDataDescriptor.cast_from(given)
            if descriptor.sample_type == self._daq.SampleType.Null:
                raise SignalsChangedError(f"'{self._name}' is described no more")
            if key == "DataDescriptor":
                self._value = descriptor
            else:
                self._domain = descriptor
        try:
            new = _form(self._value, self._domain, self._name, self._id)
        except _UnusableError as error:
            raise SignalsChangedError(f"'{self._name}' cannot be read any more: {error}") from error
        old, self._form = self._form, new
        if (new.sample_type, new.is_scaled) != (old.sample_type, old.is_scaled):
            raise SignalsChangedError(f"'{self._name}' comes in another form: {new.sample_type}, not {old.sample_type}")
        if new != old:
            self.forget_grid()
            yield Changed(new.channel)


@dataclass(frozen=True)
class DeviceSignals:
    """Signals of one device, and what is left out of them.

    Attributes
    ----------
    ids
        Identifiers of the signals that must be there still.
    are_all
        Whether no other may be there.
    left_out
        Reason for each signal that is no row of numbers over time, in one line.
    """

    readers: tuple[SignalReader, ...] = ()
    ids: frozenset[str] = frozenset()
    are_all: bool = True
    left_out: tuple[str, ...] = ()

    def are_in(self, device: Any) -> bool:
        """Return whether a device shows the same signals still."""
        shown = signal_ids(device)
        return shown == self.ids if self.are_all else shown >= self.ids

    def described(self, time_by: str) -> StreamDescription:
        """Return the description of all.

        Raises
        ------
        ValueError
            If two count from different instants: their ticks would say that they were taken at once.
        """
        starts = {one.start_utc_ns for one in self.readers}
        if len(starts) > 1:
            first = self.readers[0]
            other = next(one for one in self.readers if one.start_utc_ns != first.start_utc_ns)
            raise ValueError(f"'{first.channel.name}' and '{other.channel.name}' count from different instants")
        return StreamDescription(tuple(one.channel for one in self.readers), starts.pop(), time_by)


def signals_of_device(daq: Any, device: Any, wanted: Collection[str]) -> DeviceSignals | None:
    """Find the signals of a device and begin to read them; None while some have not been described yet.

    Parameters
    ----------
    wanted
        Names of those that are read; all are where there is none, or the device lacks one: whoever wants it is told
        what there is.
    """
    signals = [one for one in device.signals_recursive if one.public and one.domain_signal is not None]
    if not signals or any(one.descriptor is None or one.domain_signal.descriptor is None for one in signals):
        return None
    readers: list[SignalReader] = []
    left_out: list[str] = []
    names = _names(signals)
    left = set(wanted) if wanted and set(wanted) <= set(names) else set(names)
    for name, signal in zip(names, signals, strict=True):
        if name not in left:
            continue
        try:
            readers.append(SignalReader(daq, signal, name))
        except _UnusableError as error:
            left_out.append(f"signal '{name}' is left out: {error}")
    are_all = len(left) == len(set(names))
    ids = signal_ids(device) if are_all else frozenset(one.identifier for one in readers)
    return DeviceSignals(tuple(readers), ids, are_all, tuple(left_out))


def signal_ids(device: Any) -> frozenset[str]:
    """Return the identifiers of all signals that a device shows."""
    return frozenset(str(one.global_id) for one in device.signals_recursive)


def time_source(daq: Any, device: Any) -> str:
    """Return what a device's clock follows, in its own words; empty where it says nothing."""
    try:
        sync = daq.ISyncComponent.cast_from(device.sync_component)
        names = [str(name) for name in dict(sync.interfaces)]
        name = names[sync.selected_source]
        return name if sync.sync_locked else f"{name}, not locked"
    except (RuntimeError, AttributeError, TypeError, IndexError):
        return ""  # not every device, and no pseudo device of a stream, has one


def _names(signals: list[Any]) -> list[str]:
    """Return a name of each: its own where no other has it, else its path in the device.

    Streams without a device (``daq.lt``, ``daq.ns``) name a signal by its whole path, with other separators.
    """
    whole = [str(one.name) for one in signals]
    own = [name.replace("#", "*").rsplit("*", 1)[-1] if name.startswith(("#", "*")) else name for name in whole]
    often = Counter(own)
    paths = [
        name if name != short else str(one.global_id) for name, short, one in zip(whole, own, signals, strict=True)
    ]
    return [name if often[name] == 1 else path for name, path in zip(own, paths, strict=True)]


def _form(value: Any, domain: Any, name: str, identifier: str) -> _Form:
    if value.dimensions is not None and len(value.dimensions):
        raise _UnusableError("each of its samples is a list")
    if (rule := value.rule) is not None and rule.type.name != _EXPLICIT:
        raise _UnusableError(f"its values follow the rule {rule.type.name}")
    scaling = value.post_scaling
    is_scaled = scaling is not None
    if is_scaled and scaling.type.name != _LINEAR:
        raise _UnusableError(f"its scaling is {scaling.type.name}")
    sample_type = (scaling.input_sample_type if is_scaled else value.sample_type).name
    if sample_type not in _TYPES:
        raise _UnusableError(f"its samples are {sample_type}")
    line = dict(scaling.parameters) if is_scaled else {"scale": 1.0, "offset": 0.0}
    resolution, unit = domain.tick_resolution, domain.unit
    if resolution is None or resolution.numerator <= 0 or unit is None or str(unit.symbol) != _SECOND:
        raise _UnusableError("its domain does not count seconds")
    spelled = "" if value.unit is None else str(value.unit.symbol)
    said = {"id": identifier, "values": sample_type}
    if (span := value.value_range) is not None:
        low, high = (f"{float(one):.10g} {spelled}".strip() for one in (span.low_value, span.high_value))
        said["Range"] = f"{low} to {high}"
    stated = domain.reference_domain_info
    scale = "Unknown" if stated is None else stated.reference_time_protocol.name
    ahead = 0 if stated is None or stated.reference_domain_offset is None else int(stated.reference_domain_offset)
    if stated is not None:
        said["reference domain"] = str(stated.reference_domain_id)
    if scale != "Unknown":
        said["time scale"] = scale
    origin = str(domain.origin)
    channel = TickChannel(
        name,
        spelled,
        Fraction(int(resolution.denominator), int(resolution.numerator)),
        _step(domain),
        float(line["scale"]),
        float(line["offset"]),
        said | ({"origin": origin} if origin else {}),
    )
    # TAI and GPS differ from UTC by leap seconds, and whether the origin is meant in them was never seen: not guessed
    start = _utc_ns(origin) if scale in ("Unknown", "Utc") else None
    if start is not None:
        start += round(Fraction(10**9 * ahead) / channel.tick_rate)
    return _Form(channel, sample_type, is_scaled, start)


def _step(domain: Any) -> int:
    """Return the ticks from one sample to the next; 0 where each has its own."""
    rule = domain.rule
    if rule is None or rule.type.name == _EXPLICIT:
        return 0
    if rule.type.name != _LINEAR:
        raise _UnusableError(f"its ticks follow the rule {rule.type.name}")
    step = int(dict(rule.parameters)["delta"])
    if step <= 0:
        raise _UnusableError(f"its ticks are {step} apart")
    return step


def _utc_ns(origin: str) -> int | None:
    """Return an instant in ISO 8601 as ns since 1970; None if it is none, or says nothing of its zone."""
    try:
        instant = datetime.fromisoformat(origin)
    except ValueError:
        return None
    if instant.tzinfo is None:
        return None
    since = instant - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * 10**9 + since.microseconds * 1000
