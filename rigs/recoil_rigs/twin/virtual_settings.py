"""The settings of a virtual rig by what moves on it, and rigs with other ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from recoil_acquisition.errors import Fault, FaultCode, RigError
from recoil_acquisition.files.bounded_toml import parse_toml
from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.mechanism.line import Line
from recoil_rigs.mechanism.mechanism_parameters import Mechanism
from recoil_rigs.rig import Rig
from recoil_rigs.twin.line_settings import LineSettings, read_line_settings
from recoil_rigs.twin.recorder_settings import TWIN
from recoil_rigs.twin.settings import TwinSettings, read_settings

_SETTINGS: Mapping[type[Mechanism], Callable[[Rig], TwinSettings | LineSettings]] = {
    Gun: read_settings,
    Line: read_line_settings,
}


def virtual_settings(rig: Rig) -> TwinSettings | LineSettings:
    """Validate a rig's table ``[twin]`` by its mechanism.

    Raises
    ------
    RigError
        With every fault, keyed ``twin.<key>``, ``mechanism.<symbol>`` or by the source.
    """
    return _SETTINGS[type(rig.mechanism)](rig)


def with_settings(rig: Rig, given: Mapping[str, Any]) -> Rig:
    """Give a rig other settings of its virtual rig; the text of its file stays what it was.

    Parameters
    ----------
    given
        Key of ``[twin]`` -> value; a key of a table within it is written with a dot, ``unread.packing_share``.

    Raises
    ------
    RigError
        With every fault of the settings, as `virtual_settings`.
    """
    twin: dict[str, Any] = dict(rig.twin)
    for key, value in given.items():
        *tables, last = key.split(".")
        within = twin
        for table in tables:
            inner = within.get(table, {})
            if not isinstance(inner, Mapping):
                problem = f"{table} is no table, it has no key within it"
                raise RigError(rig.path, [Fault((TWIN, *key.split(".")), problem, FaultCode.UNKNOWN)])
            within[table] = dict(inner)
            within = within[table]
        within[last] = value
    other = replace(rig, twin=twin)
    virtual_settings(other)
    return other


def set_apart(rig: Rig) -> dict[str, Any]:
    """Return the settings of a rig's virtual rig that its file does not have, or has otherwise, by dotted key."""
    own = parse_toml(rig.text).get(TWIN, {})
    return dict(_differing(own, rig.twin, ""))


def _differing(own: Any, other: Any, key: str) -> Iterator[tuple[str, Any]]:
    if isinstance(other, Mapping) and isinstance(own, Mapping):
        for name in other:
            yield from _differing(own.get(name, {} if isinstance(other[name], Mapping) else None), other[name],
                                  f"{key}.{name}" if key else name)  # fmt: skip
    elif own != other:
        yield key, other
