"""Framings of devices that many use, by name: ``framing = { ready_made = "xsens-mti" }``.

Each is a function that returns the table a rig file would hold, made of the one in ``ready_made.toml``; its docstring
names the manual the layout is from. A rig gives the parameters of the function beside ``ready_made``, replaces whole
keys of the table by its own, and leaves keys out with ``without = ["device_time"]``.
"""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import deepcopy
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from recoil_acquisition.errors import Fault, FaultCode, nearest_first
from recoil_acquisition.frames.vectornav_groups import fields_of_header
from recoil_acquisition.quantities.quantity import STANDARD_GRAVITY_M_S2

_XSENS_SYNC = bytes.fromhex("FAFF36")
_XDI_TYPES = MappingProxyType(
    {"f32": (0, "f32", 1.0), "fp12.20": (1, "i32", 2.0**-20), "fp16.32": (2, "fp1632", 1.0), "f64": (3, "f64", 1.0)}
)
"""Precision -> lowest bits of a data identifier, type of the numbers, and their scale."""

_KELLER_CHANNELS = MappingProxyType(
    {1: ("pressure_1", "bar"), 2: ("pressure_2", "bar"), 3: ("temperature", "degC"), 4: ("temperature_1", "degC")}
)


@cache
def _tables() -> dict[str, Any]:
    """Return the framings by their names, with the defaults of their parameters."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def _check_number(key: str, value: Any, lowest: float, highest: float, *, whole: bool = False) -> None:
    """Raise ValueError unless a parameter of a ready-made framing is a number within limits."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int if whole else int | float)
        or not lowest <= value <= highest
    ):
        what = "whole number" if whole else "number"
        raise ValueError(f"{key} must be a {what} from {lowest:g} to {highest:g}, found {value!r}")


def xsens_mti(precision: str = "f32") -> dict[str, Any]:
    """Xsens MTi, messages MTData2.

    Source: Xsens, MT Low Level Communication Protocol (MT0101P) and MTi User Manual (MT0605P): preamble FA,
    bus identifier FF, message identifier 36, length, data, checksum that brings the sum of all but the preamble
    to a multiple of 256. Data are packets of a 16-bit identifier, a length and big-endian values; the lowest
    two bits of the identifier are the number format. Messages above 254 bytes are not decoded.

    Parameters
    ----------
    precision
        Number format of the output configuration: ``f32``, ``fp12.20``, ``fp16.32`` or ``f64``.
    """
    if str(precision) not in _XDI_TYPES:
        raise ValueError(f"precision must be one of {', '.join(_XDI_TYPES)}, found {precision!r}")
    code, type_, scale = _XDI_TYPES[str(precision)]
    table: dict[str, Any] = deepcopy(_tables()["xsens-mti"])
    for field in table["fields"][2:4]:
        field |= {"id": field["id"] | code, "type": type_, "scale": scale}
    return table


def xsens_precision(sync: bytes, wanted: int, present: Collection[int]) -> str:
    """Return the precision in which an Xsens sends what is sought in another; empty if it is no Xsens, or sends none.

    Parameters
    ----------
    sync
        Sync bytes of the framing.
    wanted
        Data identifier, whose lowest bits are of the precision.
    present
        Identifiers of the data in the stream.
    """
    found = {identifier & 3 for identifier in present if identifier >> 2 == wanted >> 2} if sync == _XSENS_SYNC else ()
    return " and ".join(name for name, (code, _, _) in _XDI_TYPES.items() if code in found)


def vectornav_ascii() -> dict[str, Any]:
    """VectorNav VN-100, asynchronous ASCII message VNIMU.

    Source: VectorNav, VN-100 User Manual (UM001), asynchronous output IMU measurements: magnetic field,
    acceleration in m/s2, angular rate in rad/s, temperature in degC, pressure in kPa; the checksum is the
    exclusive or of all between the dollar sign and the asterisk. For the 16-bit checksum declare
    ``checksum = { algo = "crc16-xmodem", from = 1 }``.
    """
    return dict(_tables()["vectornav-vn100-ascii"])


def vectornav_binary(header: str = "FA 01 21 01") -> dict[str, Any]:
    """VectorNav VN-100, binary output.

    Source: VectorNav, VN-100 User Manual (UM001), user configurable binary output messages: sync byte FA, a
    byte of groups, a 16-bit word of fields for each group, little-endian values, CRC-16 (polynomial 0x1021,
    start value 0) of all behind the sync byte, high byte first. The length is not in the frame: it follows
    from the configuration, so the whole header is the sync word.

    Parameters
    ----------
    header
        Sync byte, groups and fields of the configured message in hexadecimal; by default time since startup,
        angular rate and acceleration of group 1.
    """
    try:
        sync = bytes.fromhex(header)
    except (ValueError, TypeError):
        sync = b""
    fields, length = fields_of_header(sync)
    table: dict[str, Any] = {
        "kind": "sync",
        "sync": sync.hex(" "),
        "length": {"fixed": length + 2},
        "checksum": {"algo": "crc16-xmodem", "from": 1, "order": "big"},
        "fields": fields,
        "baudrate": 115200,
    }
    if any(field["name"] == "time_startup" for field in fields):
        table["device_time"] = {"field": "time_startup", "tick_s": 1e-9}
    return table


def microstrain_mip() -> dict[str, Any]:
    """HBK MicroStrain inertial sensors, MIP packets with the sensor data set 80.

    Source: MicroStrain, 3DM-CV7 and 3DM-GX5 Data Communications Protocol manuals: 75 65, descriptor set,
    payload length, fields of length (its own two bytes counted), descriptor and big-endian values, Fletcher
    checksum of all before it. Acceleration is in g. ``device_time = { field = "reference_time", tick_s = 1e-9 }``
    dates by the shared reference timestamp (D5) where the device sends it in each packet.
    """
    return dict(_tables()["microstrain-mip"])


def witmotion(acceleration_range_g: float = 16.0, angular_rate_range_deg_s: float = 2000.0) -> dict[str, Any]:
    """WitMotion WT901 and its relatives, on a wire.

    Source: WitMotion, WT901, BWT61CL and HWT905 data sheets: 55, a type from 50 to 5A, four little-endian
    numbers, the sum of all before it. A sum of eight bits lets garbage pass; so types beyond these are refused,
    and a frame counts only if the next begins behind it.

    Parameters
    ----------
    acceleration_range_g, angular_rate_range_deg_s
        Values that the greatest number stands for.
    """
    _check_number("acceleration_range_g", acceleration_range_g, 0.1, 1e5)
    _check_number("angular_rate_range_deg_s", angular_rate_range_deg_s, 0.1, 1e5)
    table: dict[str, Any] = deepcopy(_tables()["witmotion"])
    acceleration, angular_rate = (frame["fields"][0] for frame in table["frames"][:2])
    acceleration["scale"] = acceleration_range_g / 32768 * STANDARD_GRAVITY_M_S2
    angular_rate["scale"] = angular_rate_range_deg_s / 32768
    return table


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
    _check_number("address", address, 1, 249, whole=True)
    _check_number("channel", channel, min(_KELLER_CHANNELS), max(_KELLER_CHANNELS), whole=True)
    name, unit = _KELLER_CHANNELS[channel]
    table: dict[str, Any] = deepcopy(_tables()["keller"])
    table["frames"][0]["fields"][0] |= {"name": name, "unit": unit}
    table["sync"] = f"{address:02X}"
    table["start_commands"][0]["hex"] = f"{address:02X} 30"
    table["poll"] |= {"hex": f"{address:02X} 49 {channel:02X}", "every_s": every_s}
    return table


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
