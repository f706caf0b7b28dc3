"""Ready-made framings of inertial sensors.

Magnetometers are left out: close to a mechanism of steel they do not measure its motion.
"""

from __future__ import annotations

from collections.abc import Collection
from types import MappingProxyType
from typing import Any

from recoil_acquisition.frames.vectornav_groups import fields_of_header
from recoil_acquisition.quantity import STANDARD_GRAVITY_M_S2

_XYZ = ("x", "y", "z")

_XBUS_DATA = bytes.fromhex("FAFF36")
_XDI_TYPES = MappingProxyType(
    {"f32": (0, "f32", 1.0), "fp12.20": (1, "i32", 2.0**-20), "fp16.32": (2, "fp1632", 1.0), "f64": (3, "f64", 1.0)}
)
"""Precision -> lowest bits of a data identifier, type of the numbers, and their scale."""


def _of_axes(name: str) -> list[str]:
    return [f"{name}_{axis}" for axis in _XYZ]


def check_number(key: str, value: Any, lowest: float, highest: float, *, whole: bool = False) -> None:
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
    values = {"type": type_, "scale": scale}
    return {
        "kind": "sync",
        "sync": _XBUS_DATA.hex(" ").upper(),
        "length": {"at": 3, "type": "u8", "add": 5},
        "max": 259,
        "endian": "big",
        "checksum": {"algo": "neg-sum8", "from": 1},
        "tlv": {"from": 4, "id": "u16", "len": "u8", "id_first": True},
        "fields": [
            {"name": "packet_counter", "id": 0x1020, "type": "u16"},
            {"name": "sample_time_fine", "id": 0x1060, "type": "u32"},
            {"name": _of_axes("acceleration"), "id": 0x4020 | code, "unit": "m/s^2", **values},
            {"name": _of_axes("rate_of_turn"), "id": 0x8020 | code, "unit": "rad/s", **values},
            {"name": "status_word", "id": 0xE020, "type": "u32"},
        ],
        "counter": {"field": "packet_counter", "modulo": 65536},
        "device_time": {"field": "sample_time_fine", "tick_s": 1e-4, "modulo": 2**32},
        "baudrate": 115200,
        "start_commands": [{"hex": "FA FF 10 00", "checksum": {"algo": "neg-sum8", "from": 1}}],
        "stop_commands": [{"hex": "FA FF 30 00", "checksum": {"algo": "neg-sum8", "from": 1}}],
    }


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
    found = {identifier & 3 for identifier in present if identifier >> 2 == wanted >> 2} if sync == _XBUS_DATA else ()
    return " and ".join(name for name, (code, _, _) in _XDI_TYPES.items() if code in found)


def vectornav_ascii() -> dict[str, Any]:
    """VectorNav VN-100, asynchronous ASCII message VNIMU.

    Source: VectorNav, VN-100 User Manual (UM001), asynchronous output IMU measurements: magnetic field,
    acceleration in m/s2, angular rate in rad/s, temperature in degC, pressure in kPa; the checksum is the
    exclusive or of all between the dollar sign and the asterisk. For the 16-bit checksum declare
    ``checksum = { algo = "crc16-xmodem", from = 1 }``.
    """
    return {
        "kind": "delimiter",
        "start": "$",
        "max": 256,
        "checksum": {"algo": "xor8", "from": 1},
        "when": {"at": 0, "equals": "$VNIMU"},
        "fields": [
            {"name": _of_axes("acceleration"), "at": 4, "unit": "m/s^2"},
            {"name": _of_axes("angular_rate"), "at": 7, "unit": "rad/s"},
            {"name": "temperature", "at": 10, "unit": "degC"},
            {"name": "pressure", "at": 11, "unit": "kPa"},
        ],
        "baudrate": 115200,
    }


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
    return {
        "kind": "sync",
        "sync": "75 65",
        "length": {"at": 3, "type": "u8", "add": 6},
        "max": 261,
        "endian": "big",
        "checksum": {"algo": "fletcher16", "order": "big"},
        "frames": [
            {
                "when": {"at": 2, "equals": 0x80},
                "tlv": {"from": 4, "len": "u8", "len_includes": 2, "id": "u8"},
                "fields": [
                    {
                        "name": _of_axes("acceleration"),
                        "id": 0x04,
                        "type": "f32",
                        "scale": STANDARD_GRAVITY_M_S2,
                        "unit": "m/s^2",
                    },
                    {"name": _of_axes("angular_rate"), "id": 0x05, "type": "f32", "unit": "rad/s"},
                    {"name": "reference_time", "id": 0xD5, "type": "u64"},
                ],
            }
        ],
        "baudrate": 115200,
    }


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
    check_number("acceleration_range_g", acceleration_range_g, 0.1, 1e5)
    check_number("angular_rate_range_deg_s", angular_rate_range_deg_s, 0.1, 1e5)

    def vector(type_: int, name: str, scale: float, unit: str) -> dict[str, Any]:
        field = {"name": _of_axes(name), "at": 2, "type": "i16", "scale": scale, "unit": unit}
        return {"when": {"at": 1, "equals": type_}, "fields": [field]}

    frames = [
        vector(0x51, "acceleration", acceleration_range_g / 32768 * STANDARD_GRAVITY_M_S2, "m/s^2"),
        vector(0x52, "angular_rate", angular_rate_range_deg_s / 32768, "deg/s"),
        vector(0x53, "angle", 180 / 32768, "deg"),
        *({"when": {"at": 1, "equals": type_}} for type_ in (0x50, *range(0x54, 0x5B))),
    ]
    frames[0]["fields"].append({"name": "temperature", "at": 8, "type": "i16", "scale": 0.01, "unit": "degC"})
    return {
        "kind": "sync",
        "sync": "55",
        "length": {"fixed": 11},
        "checksum": {"algo": "sum8"},
        "frames": frames,
        "only_known": True,
        "look_ahead": True,
        "baudrate": 9600,
    }
