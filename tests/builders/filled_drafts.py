"""Drafts of rig files as a person fills them in: a value in the place of a question, and nothing else is touched."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.files.bounded_toml import toml_value
from recoil_rigs.rig import find_rig

Typed = Mapping[str, Mapping[str, Any]]
"""Values by table: ``mechanism``, ``knowledge``, or the name of a source or a channel."""
_HEADING = re.compile(r"\[+([\w.]+)\]+")
_KEY = re.compile(r'([\w-]+) = "TODO')
_NAME = re.compile(r'name = "(.*)"')


def filled(text: str, typed: Typed) -> str:
    """Put each value in the place of its question; one that has no question there is a mistake."""
    left = {(table, key) for table, values in typed.items() for key in values}
    lines, table = [], ""
    for line in text.splitlines():
        heading, name, key = _HEADING.match(line), _NAME.match(line), _KEY.match(line)
        if heading:
            table = heading[1] if heading[1] in ("mechanism", "knowledge") else table
        if name:
            table = name[1]
        if key and key[1] in typed.get(table, {}):
            left.remove((table, key[1]))
            lines.append(f"{key[1]} = {toml_value(typed[table][key[1]])}")
        else:
            lines.append(line)
    assert not left, f"nothing asks for {left}"
    return "\n".join(lines) + "\n"


def without_channel(text: str, signal: str) -> str:
    """Delete the channel of a signal, as somebody does who does not need it."""
    head, *channels = text.split("\n[[channel]]\n")
    kept = [one for one in channels if f'signal = "{signal}"' not in one]
    assert len(kept) == len(channels) - 1
    return "\n[[channel]]\n".join([head, *kept])


MECHANISM = (
    "m3", "phi20", "friction", "u_friction", "XA", "YA", "b", "d", "phi10", "bore_area", "brake_area",
    "recuperator_area",
)  # fmt: skip
WEIGHT = {"weighed_mass_kg": 310.0, "u_weighed_mass_kg": 0.05}
"""Mass that is added to every second shot."""
_COLUMNS = (
    "serial", "model", "signal", "quantity", "unit", "range_low", "range_high", "U_percent", "k", "calibrated", "due",
    "calibration", "zero_percent", "filter_hz", "filter_type", "filter_order", "delay_s",
)  # fmt: skip


def mechanism_of(rig: str) -> dict[str, float]:
    """Return what a draft asks for of a bundled gun."""
    stated = tomllib.loads(find_rig(rig).read_text(encoding="utf-8"))["mechanism"]
    return {key: stated[key] for key in MECHANISM}


def certificates_of(rig: str, signals: Mapping[str, str]) -> str:
    """Write the table of certificates of a bundled rig's sensors.

    Parameters
    ----------
    signals
        Other names of signals than the rig has, by the rig's.
    """
    rows = [",".join(_COLUMNS)]
    for channel in tomllib.loads(find_rig(rig).read_text(encoding="utf-8"))["channel"]:
        sensor = channel["sensor"]
        cells = {key: sensor[key] for key in _COLUMNS if key in sensor}
        cells |= {key: channel[key] for key in ("quantity", "unit")}
        cells["signal"] = signals.get(channel["signal"], channel["signal"])
        cells |= {"U_percent": f"{200 * sensor['u_rel']:g}", "k": 2}
        if channel.get("role") == "breech_pressure":
            cells["calibration"] = "static"
        if "range" in sensor:
            cells["range_low"], cells["range_high"] = sensor["range"]
        if "u_zero_rel" in sensor:
            cells["zero_percent"] = f"{100 * sensor['u_zero_rel']:g}"
        rows.append(",".join(str(cells.get(key, "")) for key in _COLUMNS))
    return "\n".join(rows) + "\n"


def write_certificates(rig: str, folder: Path, signals: Mapping[str, str]) -> Path:
    """Write that table into a folder."""
    path = folder / "sensors.csv"
    path.write_text(certificates_of(rig, signals), encoding="utf-8")
    return path
