"""Statements of a rig file on each symbol of its mechanism, whether the rest of it is sound or not."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.bounded_toml import LARGEST_BYTES, parse_toml
from recoil_acquisition.files.regular_file import read_small
from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.mechanism.mechanism_parameters import MEANINGS
from recoil_rigs.mechanism.mechanism_table import model_of, stated_values
from recoil_rigs.rig import find_rig


def mechanism_document(name_or_path: str | Path) -> dict[str, Any]:
    """Return the symbols of a rig's mechanism with their values and meanings, in JSON types.

    A value that is no number, such as what is still to be found out, stands as it is written.

    Raises
    ------
    ReadError
        If there is no such file, or it is no TOML.
    """
    path = find_rig(str(name_or_path))
    try:
        tables = parse_toml(read_small(path, LARGEST_BYTES, "a rig file").decode("utf-8-sig", errors="replace"))
    except ValueError as error:
        raise ReadError(f"is no TOML: {error}", path=path) from error
    stated = tables.get("mechanism")
    stated = {**stated, **stated_values(stated, [])} if isinstance(stated, Mapping) else {}
    channels = tables.get("channel")
    roles = {
        str(one["role"]) for one in (channels if isinstance(channels, list) else ())
        if isinstance(one, Mapping) and "role" in one
    }  # fmt: skip
    model = model_of(stated) or Gun
    needed = model.required(roles)
    return {
        "model": model.model.value,
        "symbols": [
            {
                "symbol": symbol,
                "value": _value(stated.get(symbol)),
                "u": _number(stated.get(f"u_{symbol}")),
                "needed": symbol in needed,
                "meaning": MEANINGS[symbol],
            }
            for symbol in model.symbols_of(roles)
        ],
    }


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _value(value: Any) -> float | str | None:
    number = _number(value)
    return number if number is not None or value is None else str(value)
