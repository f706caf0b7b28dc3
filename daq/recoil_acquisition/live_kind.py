"""Kinds of source that are read live: one line of a table each, loaded when it is needed.

What a rig's ``device`` table says chooses the kind, by a key that only this kind has, or by ``virtual = "KEY"``, which
has it played. Another package adds one by an entry point, which leads to a `LiveKind`::

    [project.entry-points."recoil_daq.live_kinds"]
    gauge = "recoil_gauge:KIND"
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from recoil_acquisition.packages.others import at_work, offered


@dataclass(frozen=True)
class LiveKind:
    """A kind of source that is read live.

    Attributes
    ----------
    key
        Key of a ``device`` table that chooses it.
    source_kinds
        Kinds of source that may have such a device.
    block
        Kind of the blocks that its device gives, of `recoil_acquisition.devices.device`.
    device
        Function, as ``module:name``, from a source's name, its ``device`` table and
        `recoil_acquisition.devices.declarations.DeviceDeclarations` to a `recoil_acquisition.devices.device.Device`.
    signals
        Function, as ``module:name``, from a `recoil_acquisition.capture.live_source.LiveSource` and some of its
        channels to a `recoil_acquisition.capture.live_source.LiveSignals`.
    capture
        Function, as ``module:name``, from a capture's path, a `recoil_acquisition.readers.captured.CapturedSource` and
        `recoil_acquisition.readers.reader.Declarations` to a `recoil_acquisition.readers.recording.Recording`.
    counted
        Unit of what its device counts as received, such as ``frames``.
    example
        Example of a ``device`` table.
    declared
        Attribute of the declarations that decodes it; empty if it needs none.
    decodes_all
        Whether all channels cost no more than one.
    tells_signals
        Whether its device tells its signals and their units once it is open: see
        `recoil_acquisition.devices.device.TellingDevice`.
    is_preview
        Whether its instrument writes a file of its own, of which what is read live is a preview.
    keeps_talk
        Whether its device lets all that passes be heard, to be kept and played back.
    is_default
        Whether a table without the key of any kind is of this one, which then says what is missing.
    """

    key: str
    source_kinds: tuple[str, ...]
    block: str
    device: str
    signals: str
    capture: str
    counted: str
    example: str
    declared: str = ""
    decodes_all: bool = False
    tells_signals: bool = False
    is_preview: bool = False
    keeps_talk: bool = False
    is_default: bool = False

    def load(self, part: str) -> Any:
        """Return the function that ``device``, ``signals`` or ``capture`` names."""
        module, name = getattr(self, part).split(":")
        return getattr(import_module(module), name)

    def at_work(self) -> AbstractContextManager[None]:
        """Let it do its work: a mistake of another package's is an error in one line."""
        own = any(one is self for one in _OWN)
        return nullcontext() if own else at_work(f"the live kind {self.key!r} of another package")


_OWN = (
    LiveKind(
        "interface", ("can",), "can",
        device="recoil_acquisition.devices.can_device:can_device",
        signals="recoil_acquisition.capture.can_signals:CanSignals",
        capture="recoil_acquisition.readers.can.captured_bus:open_bus",
        counted="frames", example='{ interface = "socketcan", channel = "can0" }', declared="database", is_default=True,
    ),
    LiveKind(
        "port", ("serial",), "serial",
        device="recoil_acquisition.devices.serial_device:serial_device",
        signals="recoil_acquisition.capture.serial_signals:SerialSignals",
        capture="recoil_acquisition.readers.serial.captured_port:open_port",
        counted="bytes", example='{ port = "/dev/ttyUSB0", baudrate = 921600 }', declared="framing", decodes_all=True,
        is_default=True,
    ),
    LiveKind(
        "oxygen", ("dewetron",), "stream",
        device="recoil_acquisition.devices.oxygen_device:oxygen_device",
        signals="recoil_acquisition.capture.oxygen_signals:oxygen_signals",
        capture="recoil_acquisition.capture.oxygen_signals:open_oxygen",
        counted="bytes", example='{ oxygen = "192.0.2.10" }', tells_signals=True, is_preview=True,
        keeps_talk=True,
    ),
    LiveKind(
        "opendaq", ("dewetron",), "stream",
        device="recoil_acquisition.devices.opendaq_device:opendaq_device",
        signals="recoil_acquisition.capture.opendaq_ticks:opendaq_signals",
        capture="recoil_acquisition.capture.opendaq_ticks:open_opendaq",
        counted="samples", example='{ opendaq = "daq.nd://192.0.2.20" }', tells_signals=True,
        is_preview=True,
    ),
)  # fmt: skip

_PARTS = tuple(LiveKind.__dataclass_fields__)


def live_kinds() -> tuple[LiveKind, ...]:
    """Return all kinds: those of this package, then those of others."""
    return (*_OWN, *offered("recoil_daq.live_kinds", _PARTS))


def live_kind_of(source_kind: str, device: Mapping[str, Any] | None) -> LiveKind | None:
    """Return the kind of a source's ``device`` table; None if such a source cannot be read live so."""
    fitting = [kind for kind in live_kinds() if source_kind in kind.source_kinds]
    table = device or {}
    chosen = [kind for kind in fitting if kind.key in table or kind.key == table.get("virtual")]
    chosen = chosen or [kind for kind in fitting if kind.is_default]
    return chosen[0] if chosen else None
