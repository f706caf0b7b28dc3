"""Rigs as people write them: the one that the docs describe, and bundled ones without one optional key or another."""

from __future__ import annotations

import copy
import datetime as dt
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.rig import find_rig

Tables = dict[str, Any]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "rig-file.md"
OF_EVERY_SENSOR = ("u_rel", "time_constant_s", "filter_hz", "filter_type", "filter_order", "delay_s")
"""Keys of a sensor that must be stated, or that another record than the sensor's is described without."""


def documented_rig() -> str:
    """Return the rig of the page of the rig file, as somebody would type it."""
    parts = re.findall(r"<!-- rig -->\n^```toml\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    return "\n".join(parts)


def with_virtual_values(text: str, **settings: float | bool) -> str:
    """Add what a virtual rig needs beside what a rig states: the bodies of the bundled one, and a table ``[twin]``."""
    tables, bundled = tomllib.loads(text), bundled_tables("field-2013")
    tables["mechanism"] = bundled["mechanism"] | tables["mechanism"]
    tables["twin"] = bundled["twin"] | settings
    return toml_of(tables)


def bundled_tables(name: str) -> Tables:
    """Return a bundled rig's tables."""
    return tomllib.loads(find_rig(name).read_text(encoding="utf-8"))


def bare(tables: Tables) -> Tables:
    """Return a rig with what must be stated alone: no virtual values, nothing of a sensor but its chain, no trigger."""
    without = copy.deepcopy(tables)
    without["mechanism"] = {name: without["mechanism"][name] for name in Gun.required()}
    for channel in without["channel"]:
        sensor = channel.pop("sensor", {})
        channel |= {"sensor": {name: sensor[name] for name in OF_EVERY_SENSOR if name in sensor}}
    for table in ("trigger", "twin"):
        without.pop(table, None)
    return without


def variants(tables: Tables) -> Iterator[tuple[str, Tables]]:
    """Yield a rig's tables without each key of each role, each channel and each source in turn, and what is gone."""
    yield "all that may lack", bare(tables)
    for source in tables["source"]:
        rows = {
            key: [one for one in tables[key] if one[of] != source["name"]]
            for key, of in (("source", "name"), ("channel", "source"))
        }
        yield f"source {source['name']} and its channels", copy.deepcopy(tables | rows)
    seen = set()
    for place in _places(tables):
        role = tables["channel"][place[1]].get("role", "") if place[0] == "channel" and len(place) > 2 else ""
        kind = (role, *("" if isinstance(step, int) and len(place) > 2 else step for step in place))
        if kind in seen:
            continue
        seen.add(kind)
        without = copy.deepcopy(tables)
        holder: Any = without
        for step in place[:-1]:
            holder = holder[step]
        gone = holder.pop(place[-1])
        named = f" {gone['name']}" if isinstance(gone, dict) and "name" in gone else ""
        yield ".".join(map(str, place)) + named + (f" of {role}" if role else ""), without


def _places(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if place:
        yield place
    if place[:1] == ("twin",) or "framing" in place:
        return
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in inner:
        if isinstance(key, str) or isinstance(one, dict):
            yield from _places(one, (*place, key))


def toml_of(tables: Tables) -> str:
    """Write tables as TOML, each on a line."""
    return "".join(f"{key} = {_inline(value)}\n" for key, value in tables.items())


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_inline(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return value.isoformat() if isinstance(value, dt.date) else json.dumps(value, ensure_ascii=False)
