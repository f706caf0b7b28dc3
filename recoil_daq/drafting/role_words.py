"""Words in German and English by which the name of a signal speaks for a role, each with a weight."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from recoil_rigs.tables.rig_tables import ROLES

STRONG_WORD = 3
"""Weight of a word that stands for one part of the mechanism."""
_AGAINST = -3
"""Points that a word takes off which stands for another part."""


@dataclass(frozen=True)
class _Words:
    """Patterns of words and their weights, and those that speak against a role."""

    spoken: Mapping[str, int]
    against: tuple[str, ...] = ()


_CARRIAGE = r"carriage|lafette|cradle|mount"
_ACCELERATION = r"acc|beschl|\ba_"
_ALONG, _ACROSS = r"along|longit|horiz|l(ä|ae)ngs", r"across|vert|hoch|quer|senkr"
_RATE = r"gyro|rate|omega"
_WORDS: Mapping[str, _Words] = {
    "recoil_acceleration": _Words(
        {r"recoil|ruecklauf|rücklauf|barrel|rohr": 3, _ACCELERATION: 1}, (r"carriage|lafette|can$|imu",)
    ),
    "carriage_acceleration_x": _Words({_CARRIAGE: 3, rf"x$|{_ALONG}": 2, _ACCELERATION: 1}, (rf"[yz]$|{_ACROSS}",)),
    "carriage_acceleration_y": _Words({_CARRIAGE: 3, rf"y$|{_ACROSS}": 2, _ACCELERATION: 1}, (rf"[xz]$|{_ALONG}",)),
    "carriage_rate": _Words({r"carriage|lafette": 3, _RATE: 1}, (r"tipping|wiege|elev",)),
    "tipping_rate": _Words({r"tipping|cradle|wiege|elev": 3, _RATE: 1}, (r"carriage|lafette",)),
    "breech_pressure": _Words(
        {r"\bp_|press|druck": 1, r"breech|chamber|gas|verschluss|kammer|p_max": 3}, (r"brake|brems|recup|vorhol",)
    ),
    "brake_pressure": _Words(
        {r"\bp_|press|druck": 1, r"brake|brems|buffer": 3}, (r"breech|chamber|verschluss|kammer|recup|vorhol",)
    ),
    "recuperator_pressure": _Words(
        {r"\bp_|press|druck": 1, r"recup|vorhol|run.?out": 3}, (r"breech|chamber|verschluss|kammer|brake|brems",)
    ),
    "recoil_displacement": _Words({r"travel|weg|recoil|displ|feature|\bmark|encoder": 3, r"x$": 2}, (r"y$",)),
    "recoil_velocity": _Words({r"vel|speed|geschw|\bv_": 3}),
    "driving_force": _Words(
        {r"push|driv|thrust|motor|actuator|antrieb|schub": 3, r"\bf_|force|kraft": 1}, (r"brake|brems|resist|drag",)
    ),
    "resisting_force": _Words(
        {r"brake|brems|resist|drag|buffer": 3, r"\bf_|force|kraft": 1}, (r"push|driv|thrust|motor|antrieb|schub",)
    ),
    "trigger": _Words({r"trig|fire|ttl|sync": 4}),
}
"""Role -> words of it."""
GUN_ROLES = (
    "recoil_acceleration", "carriage_acceleration_x", "carriage_acceleration_y", "carriage_rate", "tipping_rate",
    "breech_pressure", "brake_pressure", "recuperator_pressure", "recoil_displacement",
)  # fmt: skip
"""Roles of a gun that are proposed."""
LINE_ROLES = ("driving_force", "resisting_force", "recoil_acceleration", "recoil_velocity", "recoil_displacement")
"""Roles of one body on a line that are proposed."""


def own_part(signal: str) -> str:
    """Return what a signal's name says of itself: without the recorder's slot, or the message that it came in."""
    return re.split(r"[/.]", signal)[-1] if not re.fullmatch(r"[\d.]+", signal) else signal


def score(signal: str, role: str, quantity: str) -> int:
    """Return how much a name speaks for a role: weights of its words, and one where the quantity is the role's.

    Parameters
    ----------
    quantity
        Quantity of the signal; another one than the role's excludes it.

    Returns
    -------
    int
        0 where no word stands for the role's part of the mechanism.
    """
    if quantity != ROLES[role]:
        return 0
    words, name = _WORDS[role], own_part(signal).casefold()
    found = [weight for pattern, weight in words.spoken.items() if re.search(pattern, name)]
    if max(found, default=0) < STRONG_WORD:
        return 0
    return max(sum(found) + 1 + sum(_AGAINST for pattern in words.against if re.search(pattern, name)), 0)


_QUANTITY_WORDS: Mapping[str, str] = {
    "acceleration": r"acc|beschl", "force": r"force|kraft|load\b|last\b", "pressure": r"press|druck",
    "velocity": r"veloc|speed|geschw", "displacement": r"displ|travel|weg\b|hub\b",
}  # fmt: skip
"""Quantity -> words of it."""


def quantity_by_name(signal: str) -> str:
    """Return the quantity that a name alone speaks for; empty if it speaks for none, or for two."""
    name = own_part(signal).casefold()
    found = [quantity for quantity, words in _QUANTITY_WORDS.items() if re.search(words, name)]
    return found[0] if len(found) == 1 else ""


def role_by_name(signal: str) -> str:
    """Return the role that a name alone speaks for, whatever it measures; empty if it speaks for none, or for two."""
    roles = dict.fromkeys((*GUN_ROLES, *LINE_ROLES))
    points = sorted(((score(signal, role, ROLES[role]), role) for role in roles), reverse=True)
    best, role = points[0]
    # a word of the part alone does not tell what of it is measured
    return role if best > STRONG_WORD + 1 and best > points[1][0] else ""
