"""From the rig's ``device`` table to an open device."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from typing import Any

from recoil_acquisition.devices.declarations import DeviceDeclarations
from recoil_acquisition.devices.device import Device
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.live_kind import live_kind_of, live_kinds

NOTHING_DECLARED = DeviceDeclarations()


def make_device(
    source: str,
    kind: str,
    table: Mapping[str, Any] | None,
    declared: DeviceDeclarations = NOTHING_DECLARED,
) -> Device:
    """Make the device of a source, which is then to be opened.

    Parameters
    ----------
    source
        Name of the source.
    kind
        Kind of the source, such as ``can`` or ``serial``.
    table
        Table ``device`` of the source, whose keys say what device it is. Everything in that of a bus goes to
        python-can.
    declared
        Declarations of the rig about the source, beside its table.

    Raises
    ------
    DeviceError
        If the kind cannot be read live, or the table says nothing or something unknown.
    """
    live = live_kind_of(kind, table)
    if live is None:
        kinds = dict.fromkeys(one for each in live_kinds() for one in each.source_kinds)
        raise DeviceError(
            f"source '{source}': a {kind} source cannot be read live",
            expected=f"a source of kind {' or '.join(kinds)}",
            remedy="hand its file over after the shot",
        )
    if not table:
        raise DeviceError(
            f"source '{source}': the rig declares no device",
            remedy=f"write such as `device = {live.example}` in its table",
        )
    device: Device = live.load("device")(source, table, declared)
    return device


def open_device(
    source: str, kind: str, table: Mapping[str, Any] | None, declared: DeviceDeclarations = NOTHING_DECLARED
) -> Device:
    """Open the device of a source; parameters as of `make_device`.

    Raises
    ------
    DeviceError
        In one line: what is wrong (unknown interface, missing port, permission, in use), and what to do.
    IdentificationError
        In one line, if a kind of another package does not work.
    """
    live = live_kind_of(kind, table)
    with nullcontext() if live is None else live.at_work():
        device = make_device(source, kind, table, declared)
        device.open()
    return device
