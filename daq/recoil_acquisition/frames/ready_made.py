"""Framings of devices that many use, by name: ``framing = { ready_made = "xsens-mti" }``.

Each is a function that returns the table a rig file would hold; its docstring names the manual the layout is
from. A rig gives the parameters of the function beside ``ready_made``, replaces whole keys of the table by its
own, and leaves keys out with ``without = ["device_time"]``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from recoil_acquisition.errors import Fault, FaultCode, nearest_first
from recoil_acquisition.frames.ready_made_inertial import (
    check_number,
    microstrain_mip,
    vectornav_ascii,
    vectornav_binary,
    witmotion,
    xsens_mti,
)

_KELLER_CHANNELS = MappingProxyType(
    {1: ("pressure_1", "bar"), 2: ("pressure_2", "bar"), 3: ("temperature", "degC"), 4: ("temperature_1", "degC")}
)


def keller(address: int = 1, channel: int = 1, every_s: float = 0.02) -> dict[str, Any]:
    """Keller pressure transmitters, polled by function 73.

    Source: Keller, Communication protocol for X-line products, version 3.7, and for series 30, version 3.5:
    a reply repeats address and function, then holds a big-endian value and a status byte, and ends with the
    Modbus CRC, high byte first. Function 48 must have been asked once; a function above 128 is an error, of
    which number 32 says that it was not. A reply does not name its channel: poll one.

    Parameters
    ----------
    address
        Address of the transmitter, from 1 to 249.
    channel
        Channel: 1 and 2 for pressure, 3 and 4 for temperature.
    every_s
        Time from one request to the next, s.
    """
    check_number("address", address, 1, 249, whole=True)
    check_number("channel", channel, min(_KELLER_CHANNELS), max(_KELLER_CHANNELS), whole=True)
    name, unit = _KELLER_CHANNELS[channel]
    checksum = {"algo": "crc16-modbus", "order": "big"}
    value = {"name": name, "at": 2, "type": "f32", "unit": unit}
    return {
        "kind": "sync",
        "sync": f"{address:02X}",
        "length": {"at": 1, "of": {"30": 10, "49": 9, "B0": 5, "C9": 5}},
        "endian": "big",
        "checksum": checksum,
        "frames": [
            {"when": {"at": 1, "equals": 0x49}, "fields": [value, {"name": "status", "at": 6, "type": "u8"}]},
            {"when": {"at": 1, "equals": 0xC9}, "fields": [{"name": "error", "at": 2, "type": "u8"}]},
            {"when": {"at": 1, "equals": 0x30}},
            {"when": {"at": 1, "equals": 0xB0}},
        ],
        "timeout_s": 0.2,
        "baudrate": 9600,
        "start_commands": [{"hex": f"{address:02X} 30", "checksum": checksum}],
        "poll": {
            "hex": f"{address:02X} 49 {channel:02X}",
            "checksum": checksum,
            "every_s": every_s,
            "timeout_s": 0.2,
        },
    }


def csv_lines(columns: Sequence[str] = (), units: Sequence[str] = ()) -> dict[str, Any]:
    """Lines of numbers with a separator between them; lines that begin with ``#`` are comments.

    Parameters
    ----------
    columns
        Names of the numbers of a line, which must be given; one with an empty name is left out.
    units
        Units of the columns, one for each, or none at all.
    """
    given: dict[str, Any] = {"columns": columns, "units": units}
    for key, value in given.items():
        if not isinstance(value, list | tuple) or not all(isinstance(text, str) for text in value):
            raise ValueError(f"{key} must be a list of texts, found {value!r}")
    if not any(columns):
        raise ValueError('columns is missing; such as ["t_ms", "ax", "pressure"]')
    if units and len(units) != len(columns):
        raise ValueError(f"units must be as many as columns, {len(columns)}, found {len(units)}")
    fields = [
        {"name": name, "at": at, **({"unit": units[at]} if units and units[at] else {})}
        for at, name in enumerate(columns)
        if name
    ]
    return {"kind": "delimiter", "comment": "#", "fields": fields, "baudrate": 115200}


READY_MADE: Mapping[str, Callable[..., dict[str, Any]]] = MappingProxyType(
    {
        "xsens-mti": xsens_mti,
        "vectornav-vn100-ascii": vectornav_ascii,
        "vectornav-vn100-binary": vectornav_binary,
        "microstrain-mip": microstrain_mip,
        "witmotion": witmotion,
        "keller": keller,
        "csv-lines": csv_lines,
    }
)
"""Ready-made framings by the names that they have in a rig file."""


def from_ready_made(table: Mapping[str, Any], faults: list[Fault]) -> Mapping[str, Any]:
    """Return the table that a ready-made framing and what a rig declares beside its name stand for.

    Parameters
    ----------
    table
        Table with the key ``ready_made``.
    faults
        List that what is wrong is appended to.

    Returns
    -------
    mapping
        Table as a whole; empty if the name, a parameter or ``kind`` is at fault.
    """
    name = table["ready_made"]
    if not isinstance(name, str) or name not in READY_MADE:
        nearest = nearest_first(str(name), list(READY_MADE))
        problem = f"no framing {name!r}; there are {', '.join(nearest)}"
        faults.append(Fault(("framing", "ready_made"), problem, FaultCode.UNKNOWN))
        return {}
    build = READY_MADE[name]
    parameters = inspect.signature(build).parameters
    own = {key: value for key, value in table.items() if key not in parameters and key not in ("ready_made", "without")}
    try:
        made = build(**{key: value for key, value in table.items() if key in parameters})
    except (ValueError, TypeError) as error:
        faults.append(Fault(("framing", "ready_made"), str(error), FaultCode.VALUE))
        return {}
    without = table.get("without", [])
    if not isinstance(without, list | tuple) or not all(isinstance(key, str) and key in made for key in without):
        problem = f"must be a list of {', '.join(made)}, found {without!r}"
        faults.append(Fault(("framing", "without"), problem, FaultCode.VALUE))
        without = []
    if "kind" in own:
        problem = "is that of the ready-made framing; leave it out"
        faults.append(Fault(("framing", "kind"), problem, FaultCode.CONTRADICTION))
        return {}
    return {**{key: value for key, value in made.items() if key not in without}, **own}
