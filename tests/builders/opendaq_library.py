"""The part of the openDAQ library that signals are read by, made by hand: descriptors, events, scripted readers."""

from __future__ import annotations

from types import SimpleNamespace as Made

import numpy as np


def named(name):
    return Made(name=name)


def value(sample_type="Float64", unit="V", span=(-10.0, 10.0), scaling=None, rule="Explicit", dimensions=()):
    return Made(
        sample_type=named(sample_type), unit=None if unit is None else Made(symbol=unit), dimensions=list(dimensions),
        value_range=None if span is None else Made(low_value=span[0], high_value=span[1]),
        rule=Made(type=named(rule), parameters={}),
        post_scaling=None if scaling is None else Made(
            type=named(scaling[0]), input_sample_type=named(scaling[1]),
            parameters={"scale": scaling[2], "offset": scaling[3]},
        ),
    )  # fmt: skip


def domain(step=5, rule="Linear", rate=(1, 1_000_000), origin="1970-01-01T00:00:00Z", scale=None, ahead=None, unit="s"):
    return Made(
        sample_type=named("Int64"), unit=None if unit is None else Made(symbol=unit), origin=origin,
        tick_resolution=Made(numerator=rate[0], denominator=rate[1]),
        rule=Made(type=named(rule), parameters={"delta": step, "start": 0}),
        reference_domain_info=None if scale is None else Made(
            reference_domain_id="dev", reference_domain_offset=ahead, reference_time_protocol=named(scale)
        ),
    )  # fmt: skip


def signal(name, described=None, counted=None, path=None, public=True):
    time = None if counted == "none" else Made(descriptor=counted or domain())
    return Made(
        name=name, global_id=path or f"/dev/{name}", public=public, domain_signal=time,
        descriptor=described or value(),
    )  # fmt: skip


def device(*signals):
    return Made(signals_recursive=list(signals))


def changed(described=None, counted=None):
    """What a reader returns of a change: an event packet."""
    parameters = {"DataDescriptor": described, "DomainDataDescriptor": counted}
    return Made(event_id="DATA_DESCRIPTOR_CHANGED", parameters=parameters)


_SAMPLE_TYPES = (
    *("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Float32", "Float64"), "Null"
)  # fmt: skip
GAP = Made(event_id="IMPLICIT_DOMAIN_GAP_DETECTED", parameters={"GapDiff": 1})


class Library:
    """The library; each signal's reader gives what a script has: ticks, a pair of ticks and an event, or ``"fail"``."""

    SampleType = Made(**{name: named(name) for name in _SAMPLE_TYPES})
    ReadMode = Made(Unscaled="unscaled", Scaled="scaled")
    ReadTimeoutType = Made(Any="any")
    ReadStatus = Made(Ok="ok", Event="event", Fail="fail")
    IDataDescriptor = Made(cast_from=lambda given: given)

    def __init__(self, **scripts):
        self._scripts = {name: list(script) for name, script in scripts.items()}
        self.asked = {}

    def StreamReader(self, one, sample_type, _domain, mode, _timeout, skip_events):
        assert skip_events == 0
        self.asked[one.name] = sample_type.name, mode
        script = self._scripts.setdefault(one.name, [])

        def read(most, timeout_ms, with_status):
            assert (timeout_ms, with_status) == (0, True)
            given = script.pop(0) if script else np.array([], dtype=np.int64)
            if isinstance(given, str):
                return np.array([]), np.array([], dtype=np.int64), Made(read_status=given, event_packet=None)
            ticks, event = given if isinstance(given, tuple) else (given, None)
            ticks = np.asarray(ticks, dtype=np.int64)
            assert len(ticks) <= most
            status = Made(read_status="ok" if event is None else "event", event_packet=event)
            return ticks.astype(float), ticks, status

        return Made(read_with_domain=read)
