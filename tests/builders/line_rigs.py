"""Rig files of one body on a line, as somebody would type them."""

from __future__ import annotations

from pathlib import Path

from recoil_rigs.rig import Rig, parse_rig

PATH = Path("line.toml")
SHORTEST = """\
schema = "recoil-daq/rig/1"
name = "sled"
reference_clock = "recorder"

[mechanism]
model = "line"
m3 = 95.1
phi20 = 0.0
friction = 20.4
u_friction = 5.0

[[source]]
name = "recorder"
kind = "recorder"
"""
"""Head, mechanism and source of a rig that has no channels yet."""
ROLES = {
    "driving_force": ("force", "N", 0.01),
    "resisting_force": ("force", "N", 0.01),
    "recoil_acceleration": ("acceleration", "m/s2", 0.005),
    "recoil_velocity": ("velocity", "m/s", 0.002),
    "recoil_displacement": ("displacement", "mm", 0.001),
    "breech_pressure": ("pressure", "MPa", 0.005),
    "brake_pressure": ("pressure", "MPa", 0.004),
    "carriage_rate": ("angular_rate", "rad/s", 0.01),
}
"""Role -> quantity, unit and relative standard uncertainty of its channels here."""


def line_text(*roles: str, **mechanism: float | str) -> str:
    """Write a line rig with a channel of each role in turn, named by the role and its number, and further values."""
    keys = "".join(f"{key} = {value}\n" for key, value in mechanism.items())
    head = SHORTEST.replace("u_friction = 5.0\n", "u_friction = 5.0\n" + keys)
    return head + "".join(_channel(role, roles[:n].count(role)) for n, role in enumerate(roles))


def _channel(role: str, before: int) -> str:
    quantity, unit, u_rel = ROLES[role]
    name = f"{role}_{before + 1}" if before else role
    return (
        f'\n[[channel]]\nname = "{name}"\nsource = "recorder"\nsignal = "{name}"\nquantity = "{quantity}"\n'
        f'unit = "{unit}"\nrole = "{role}"\nsensor = {{ u_rel = {u_rel} }}\n'
    )


def line_rig(*roles: str, **mechanism: float | str) -> Rig:
    """Return such a rig."""
    return parse_rig(line_text(*roles, **mechanism), PATH)
