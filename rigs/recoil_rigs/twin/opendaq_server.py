"""The process of a virtual openDAQ device: a real server of the library, which sends what it is told to.

    python -m recoil_rigs.twin.opendaq_server

Its requests are messages of `recoil_acquisition.processes.child_process`: first ``c``, a description in JSON, which is
answered by ``o`` once the server listens, or by ``x`` and why not; then ``s``, samples of its channels, ``d``, another
description, and ``n``, which is answered by the number of clients. It ends with its parent. The library listens on all
interfaces of the computer, and has no setting for fewer.
"""

from __future__ import annotations

import json
import os
import struct
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib import import_module
from typing import IO, Any, cast

import numpy as np

from recoil_acquisition.processes.child_process import put, take

CONFIGURE, SEND, CHANGE, CLIENTS, LISTENS, REFUSES = b"c", b"s", b"d", b"n", b"o", b"x"
SAMPLES_HEAD = struct.Struct("<qIi")
"""Head of samples: tick of the first, how many of each channel, and the place of a channel that is not sent, or a
negative number; then the bytes of the channels, one by one."""
TYPES = {"f32": ("<f4", "Float32"), "f64": ("<f8", "Float64"), "i32": ("<i4", "Int32"), "i16": ("<i2", "Int16")}


@dataclass
class _Channel:
    value: Any
    domain: Any
    value_descriptor: Any
    domain_descriptor: Any
    dtype: np.dtype[Any]
    own_ticks: bool


class _Server:
    """The library's server and its signals."""

    def __init__(self, stated: Mapping[str, Any]) -> None:
        self._daq: Any = import_module("opendaq")
        builder = self._daq.InstanceBuilder()
        builder.global_log_level = self._daq.LogLevel.Off
        self._instance = builder.build()
        self._step = int(stated["step"])
        device = self._instance.root_device
        self._folder = self._daq.IFolderConfig.cast_from(device.get_item("Sig"))
        self._channels = {one["place"]: self._channel(stated, one) for one in stated["channels"]}
        kinds = self._instance.available_server_types
        kind = self._daq.IComponentType.cast_from(kinds["OpenDAQNativeStreaming"])
        config = self._daq.IPropertyObject.cast_from(kind.create_default_config())
        config.set_property_value("NativeStreamingPort", int(stated["port"]))
        self._instance.add_server("OpenDAQNativeStreaming", config)

    def _channel(self, stated: Mapping[str, Any], one: Mapping[str, Any]) -> _Channel:
        daq, folder = self._daq, self._folder
        described = self._descriptor(one)
        origin = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=int(stated["start_utc_ns"]) // 1000)
        domain = daq.DataDescriptorBuilder()
        domain.sample_type = daq.SampleType.Int64
        domain.unit = daq.Unit(-1, "s", "second", "time")
        domain.tick_resolution = daq.Ratio(1, int(stated["tick_rate"]))
        domain.origin = origin.isoformat().replace("+00:00", "Z")
        domain.rule = daq.ExplicitDataRule() if one["own_ticks"] else daq.LinearDataRule(self._step, 0)
        counted, context, place = domain.build(), self._instance.context, one["place"]
        ticks = daq.SignalWithDescriptor(context, counted, folder, f"time{place}", None)
        signal = daq.SignalWithDescriptor(context, described, folder, f"value{place}", None)
        signal.name, signal.domain_signal = one["name"], ticks
        folder.add_item(ticks)
        folder.add_item(signal)
        return _Channel(signal, ticks, described, counted, np.dtype(TYPES[one["type"]][0]), one["own_ticks"])

    def _descriptor(self, one: Mapping[str, Any]) -> Any:
        daq = self._daq
        name = TYPES[one["type"]][1]
        value = daq.DataDescriptorBuilder()
        value.name, value.unit = one["name"], daq.Unit(-1, one["unit"], "", "")
        value.sample_type = getattr(daq.SampleType, name)
        if (one["factor"], one["offset"]) != (1.0, 0.0):
            value.sample_type = daq.SampleType.Float64
            raw = getattr(daq.SampleType, name)
            value.post_scaling = daq.LinearScaling(one["factor"], one["offset"], raw, daq.ScaledSampleType.Float64)
        if one["range"] is not None:
            value.value_range = daq.Range(*one["range"])
        return value.build()

    def change(self, stated: Mapping[str, Any]) -> None:
        """Describe the channels anew; those that are not described are there no more."""
        left = {one["place"]: one for one in stated["channels"]}
        for place in set(self._channels) - set(left):
            gone = self._channels.pop(place)
            self._folder.remove_item(gone.value)
            self._folder.remove_item(gone.domain)
        for place, one in left.items():
            self._channels[place].value_descriptor = self._channels[place].value.descriptor = self._descriptor(one)

    @property
    def clients(self) -> int:
        """Number of clients that are connected."""
        return len(self._instance.root_device.info.connected_clients_info)

    def send(self, content: bytes) -> None:
        """Send samples of all channels."""
        daq = self._daq
        first, count, without = SAMPLES_HEAD.unpack_from(content)
        at = SAMPLES_HEAD.size
        for place, one in self._channels.items():
            if place == without:
                at += count * one.dtype.itemsize
                continue
            ticks = daq.DataPacket(one.domain_descriptor, count, 0 if one.own_ticks else first)
            if one.own_ticks:
                held = np.frombuffer(ticks.raw_data, np.int64)
                held[:] = first + self._step * np.arange(count)
            values = daq.DataPacketWithDomain(ticks, one.value_descriptor, count, 0)
            held = np.frombuffer(values.raw_data, one.dtype)
            held[:] = np.frombuffer(content, one.dtype, count, at)
            at += held.nbytes
            one.domain.send_packet(ticks)
            one.value.send_packet(values)


def main() -> None:
    """Serve until the parent is gone."""
    answers, requests = os.fdopen(os.dup(1), "wb"), cast("IO[bytes]", sys.stdin.buffer)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(nowhere, descriptor)
    try:
        _, stated = take(requests)
        server = _Server(json.loads(stated))
    except (RuntimeError, ImportError, KeyError, ValueError) as error:
        put(answers, REFUSES, str(error).encode())
        answers.flush()
        os._exit(1)
    put(answers, LISTENS)
    answers.flush()
    try:
        while True:
            kind, content = take(requests)
            if kind == SEND:
                server.send(content)
            elif kind == CHANGE:
                server.change(json.loads(content))
            else:
                put(answers, CLIENTS, str(server.clients).encode())
                answers.flush()
    except EOFError:
        os._exit(0)  # the library's threads are not waited for


if __name__ == "__main__":
    main()
