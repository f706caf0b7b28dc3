"""The mechanism as a drawing of characters, with its symbols, and what the rig says of each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from recoil_daq.terminal.tables import print_table, say

GUN = r"""
                                     b - x
                               |<----------->|        x <---   ---> e5, muzzle
            ___________________|_____________|___________________
  P <======|  B3 recoiling     |            (+) m3, J3c          |- - -  phi2
           |___________________|_____________|___________________|
                  |  B2        |           d |                 |  R_f ===>
                  |  tipping   A     (+)     |                 |
                  |__________ /|\__ m2, J2 __|_________________|
                            _/ | \_
      (+) m1, J1         __/   |   \__  M_C turns B2
    ____________________/      |YA    \__________________________
   C__ B1 carriage ____________|_________________________________D- - -  phi1
   |                           |                                 |
   |<---------- XA ----------->|                                 |
   |<------------------------------ L -------------------------->|

C and D stand on the ground, A is the trunnion, (+) a centre of mass. XA, YA,
X1 and Y1 are taken from C, along and across the carriage; b, d, s2 and d2 from
A, along and across the bore. phi10 and phi20 are phi1 and phi2 in battery, over
the horizontal; here they are drawn level. P acts e above the centre of B3.
"""
"""Three bodies of a gun, drawn level: lengths along and across the axes of the bodies that they belong to."""

LINE = r"""
                      x, velocity, acceleration --->
                      ______________
  driving_force ====>|              |<==== resisting_force
                     |   (+)  m3    |<---- friction, slide_friction
  ___________________|______________|_________________________________
                           phi20: the driving direction over the horizontal
"""
"""One body on a line: everything is positive along the driving force, but the forces that resist."""


def print_mechanism(document: Mapping[str, Any]) -> None:
    """Print the drawing of a rig's mechanism, and a row for each symbol.

    Parameters
    ----------
    document
        Document of `recoil_daq.recording.mechanism_summary.mechanism_document`.
    """
    drawing = GUN if document["model"] == "gun" else LINE
    for line in drawing.strip("\n").split("\n"):
        say(line)
    rows = [
        (one["symbol"], _shown(one), "" if one["u"] is None else f"{one['u']:g}", one["meaning"])
        for one in document["symbols"]
    ]
    print_table("The mechanism, SI units, angles in rad", ("symbol", "value", "u", "what it is"), rows, numeric=(1, 2))
    missing = [one["symbol"] for one in document["symbols"] if one["needed"] and not isinstance(one["value"], float)]
    if missing:
        say(f"still to be stated in [mechanism]: {', '.join(missing)}")


def _shown(one: Mapping[str, Any]) -> str:
    value = one["value"]
    if value is None:
        return "missing" if one["needed"] else "-"
    return f"{value:g}" if isinstance(value, float) else str(value)
