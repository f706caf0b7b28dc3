"""Summary of a shot file, read from its headers and small tables alone."""

from __future__ import annotations

import json
from typing import Any

from recoil_acquisition.acquisition import AT_TRIGGER
from recoil_acquisition.shot import reasons_of
from recoil_acquisition.shot_name import check_shot_name
from recoil_acquisition.store.channel_layout import signals_of, time_groups
from recoil_acquisition.store.layout import (
    ENTRY_NAMES,
    SCHEMA,
    read_acquisition_of,
    read_against_mass,
    read_alignments,
    read_clock_fits,
    read_inputs,
    read_quality,
    read_started,
)
from recoil_acquisition.store.table import finite, json_text, read_text
from recoil_acquisition.usability import Usability, usability


def summarise_layout(file: Any) -> dict[str, Any]:
    """Say what is in an open shot file in JSON types; only headers and small tables are read.

    Raises
    ------
    KeyError, ValueError, TypeError, OSError
        As `read_layout`.
    """
    entry = file["entry"]
    name = read_text(entry, "entry_identifier")
    check_shot_name(name)
    channels = [
        (int(signal.attrs["order"]), _channel_summary(signal.attrs, group["time"].attrs, int(signal.shape[0])))
        for _, group in time_groups(entry, ENTRY_NAMES)
        for _, signal in signals_of(group)
    ]
    quality = read_quality(entry)
    acquisition = read_acquisition_of(entry)
    started, source = read_started(entry)
    if not started and acquisition is not None:
        started, source = acquisition.trigger_utc, AT_TRIGGER
    against_mass = read_against_mass(entry)
    state = usability([check for check in quality if check.verdict == "fail"], against_mass)
    return {
        "schema": SCHEMA,
        "shot": name,
        "rig": read_text(entry["rig"], "name"),
        "reference_clock": read_text(entry["rig"], "reference_clock"),
        "started": started or None,
        "started_source": source or None,
        "usable": state is Usability.USABLE,
        "state": state.value,
        "reasons": list(reasons_of(quality, against_mass)),
        "channels": [row for _, row in sorted(channels, key=lambda placed: placed[0])],
        "alignments": [a.to_json() for a in read_alignments(entry)],
        "quality": [c.to_json() for c in quality],
        "inputs": [
            {"file": i.name, "sha256": i.sha256, "size": i.size, "source": i.source, "reader": i.reader}
            for i in read_inputs(entry)
        ],
        "acquisition": None if acquisition is None else json.loads(json_text(acquisition.to_json())),
        "clock_fits": finite(read_clock_fits(entry)),
    }


def _channel_summary(signal: Any, time: Any, count: int) -> dict[str, Any]:
    return {
        "name": str(signal["channel"]),
        "quantity": str(signal["quantity"]),
        "unit": str(signal["units"]),
        "role": str(signal["role"]),
        "clock": str(signal["clock"]),
        "signal": str(signal["source_signal"]),
        "count": count,
        "lost": int(signal["lost"]),
        "rate_hz": finite(float(time["rate_hz"])),
        "start_s": finite(float(time["start_s"])),
        "end_s": finite(float(time["end_s"])),
        "u_rel": finite(float(signal["u_rel"])),
    }
