"""Layout of a shot file: where each value of a `Shot` stands in the HDF5 tree.

::

    /                          NXroot; attributes default, schema, creator, complete, seal (written last)
    /entry                     NXentry; attribute default names the group of the main plot
        entry_identifier       name of the shot; title; start_time if a source states one
        <clock>                NXdata, one per time base, named after its clock (can, can_2, ...)
            time               float64, s: the dimension scale of every signal in the group
            <channel>          one signal, SI, NaN where a sample was lost
        raw/<clock>/<channel>  what the source stored, as integers, on the same time
        rig                    name, reference_clock, text; databases/*: NXnote
        inputs                 one row per file: name, sha256, size, source, reader
        alignment/<clock>      offset_s, u_offset_s, drift, u_drift, status, method, reasons and their figures, details
        quality                one row per check: channel, check, verdict, detail, figures of the detail (JSON);
                               attribute state (usable, record only, not usable)
        against_mass           one row per reason against the mass beside failed checks: code, about, text, figures
        acquisition            NXnote: how it was acquired live, JSON; absent if it is not known
        clock_fits/<source>    NXnote: how a device's clock relates to the host's, JSON; absent if there is none
        history/step_<k>       NXprocess: program, version, sequence_index, what, parameters
        history/channels       one row per step of one channel

The tree follows the NeXus classes (NeXus manual, NXroot to NXprocess) for the viewers that plot
NXdata, and the dimension scales of the HDF5 Dimension Scales specification for netCDF readers.
Four points are decisions:

- ``start_s`` and ``step_s`` stand beside a uniform ``time``, so that exactly this
  `recoil_acquisition.clocks.timebase.TimeBase` returns.
- The uncertainty of a sensor's scale is the attribute ``u_rel``, not a ``<name>_errors`` dataset.
  It is one number that all samples share: as error bars it would look like independent noise,
  and it would cost as much space as the signal.
- Raw counts carry ``gain`` and ``offset`` under names that no reader applies unasked.
- Names that HDF5, netCDF or NeXus do not allow are replaced; the true one is in an attribute.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import metadata
from typing import Any

import numpy as np

from recoil_acquisition.channel import Step
from recoil_acquisition.devices.tick_clock import TICK_ANCHORS
from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.measured import Worded, beside, with_figures
from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.acquisition import Acquisition
from recoil_acquisition.shot.quality_check import QualityCheck
from recoil_acquisition.shot.shot import ClockAlignment, InputFile, Shot, doubted_clocks
from recoil_acquisition.shot.usability import usability
from recoil_acquisition.store.channel_layout import read_channels, write_channels
from recoil_acquisition.store.table import (
    json_text,
    new_group,
    read_table,
    read_text,
    tree_names,
    write_table,
    write_text,
)

SCHEMA = "recoil-daq/shot/1"
PROGRAM = "recoil-daq"
AGAINST_MASS = "against_mass"
FIGURES = "figures"
"""Group of what speaks against the mass although no check failed."""

ENTRY_NAMES = frozenset(
    {"entry_identifier", "title", "start_time", "raw", "rig", "inputs", "alignment", "quality", "history"}
    | {"acquisition", "clock_fits", AGAINST_MASS}
)
"""Names in ``/entry`` that no clock's group may have."""


def write_layout(file: Any, shot: Shot, *, compressed: bool = True) -> None:
    """Write a shot into an empty, open `h5py.File`, and seal it.

    Raises
    ------
    TypeError
        If a history parameter, an alignment detail or a clock fit is not of a JSON type.
    """
    # the file is open, so that the library is at hand; without one nobody should wait for it
    from recoil_acquisition.store.file_tree import seal

    file.attrs["NX_class"] = "NXroot"
    file.attrs["default"] = "entry"
    file.attrs["schema"] = SCHEMA
    file.attrs["creator"] = f"{PROGRAM} {_version()}"
    entry = new_group(file, "entry", "NXentry")
    write_text(entry, "entry_identifier", shot.name)
    write_text(entry, "title", f"shot {shot.name} on rig {shot.rig_name}")
    if shot.started:
        write_text(entry, "start_time", shot.started)
        entry["start_time"].attrs["source"] = shot.started_source
    write_channels(entry, shot, ENTRY_NAMES, compressed=compressed)
    _write_rig(entry, shot)
    write_table(
        new_group(entry, "inputs", "NXcollection"),
        {
            "name": [i.name for i in shot.inputs],
            "sha256": [i.sha256 for i in shot.inputs],
            "size": np.array([i.size for i in shot.inputs], dtype=np.int64),
            "source": [i.source for i in shot.inputs],
            "reader": [i.reader for i in shot.inputs],
        },
    )
    _write_alignments(entry, shot.alignments)
    _write_quality(entry, shot)
    _write_against_mass(entry, shot)
    _write_history(entry, shot)
    _write_acquisition(entry, shot)
    file.attrs["complete"] = 1
    seal(file)


def read_layout(file: Any) -> Shot:
    """Read a shot from the tree of a file that bears the schema.

    Raises
    ------
    KeyError, ValueError, TypeError, OSError
        If the tree is not what `write_layout` writes.
    """
    entry = file["entry"]
    rig = entry["rig"]
    databases = None
    if "databases" in rig:
        notes = sorted(rig["databases"].values(), key=lambda note: int(note.attrs["order"]))
        databases = {read_text(note, "file_name"): read_text(note, "data") for note in notes}
    started, started_source = read_started(entry)
    in_order = read_channels(entry, ENTRY_NAMES)
    channels = {channel.name: channel for channel in in_order}
    if len(channels) < len(in_order):
        raise ValueError("two channels have one name")
    return Shot(
        name=read_text(entry, "entry_identifier"),
        rig_name=read_text(rig, "name"),
        rig_text=read_text(rig, "text"),
        reference_clock=read_text(rig, "reference_clock"),
        channels=channels,
        alignments=read_alignments(entry),
        quality=read_quality(entry),
        against_mass=read_against_mass(entry),
        inputs=read_inputs(entry),
        started=started,
        started_source=started_source,
        history=read_history(entry),
        databases=databases,
        acquisition=read_acquisition_of(entry),
        clock_fits=read_clock_fits(entry),
    )


def _json(group: Any, name: str) -> Any:
    return read_json(read_text(group, name), finite=False)


def read_started(entry: Any) -> tuple[str, str]:
    """Read when the shot started and where that comes from; both empty if the file does not say."""
    if "start_time" not in entry:
        return "", ""
    return read_text(entry, "start_time"), str(entry["start_time"].attrs.get("source", ""))


def read_acquisition_of(entry: Any) -> Acquisition | None:
    """Read how the shot was acquired live; None if the file does not say."""
    note = _own(entry, "acquisition")
    return None if note is None else Acquisition.from_json(_json(note, "data"))


def read_clock_fits(entry: Any) -> dict[str, Any]:
    """Read how the devices' clocks relate to the host's, by source."""
    notes = sorted((_own(entry, "clock_fits") or {}).values(), key=lambda note: int(note.attrs["order"]))
    fits = {read_text(note, "clock"): _json(note, "data") for note in notes}
    for clock, fit in fits.items():
        if TICK_ANCHORS in fit:  # an instrument's own count of its samples, which is no fit
            numbers = [fit["rate_hz"]] + [one[key] for one in fit[TICK_ANCHORS] for key in ("tick", "host_ns", "u_ns")]
        else:
            numbers = [fit[key] for key in ("drift", "u_offset_s", "typical_delay_s", "largest_delay_s")]
            numbers += [step["step_s"] for step in fit["steps"]] + ([] if fit["u_drift"] is None else [fit["u_drift"]])
        if not all(type(number) in (int, float) for number in numbers):
            raise ValueError(f"the clock fit of {clock!r} is none")
    return fits


def _own(entry: Any, name: str) -> Any | None:
    """Return a group that files of before do not have; a clock of the same name is another one."""
    group = entry.get(name)
    return None if group is None or group.attrs.get("NX_class") == "NXdata" else group


def read_history(entry: Any) -> tuple[Step, ...]:
    """Read the steps that a shot has been through."""
    steps = [entry["history"][name] for name in entry["history"] if name != "channels"]
    steps.sort(key=lambda step: int(step["sequence_index"][()]))
    return tuple(Step(read_text(s, "what"), read_text(s, "version"), _object(_json(s, "parameters"))) for s in steps)


def read_inputs(entry: Any) -> tuple[InputFile, ...]:
    """Read the digests of the files that went into a shot."""
    return tuple(
        InputFile(**row)
        for row in read_table(entry["inputs"], ("name", "sha256", "size", "source", "reader"), integers=("size",))
    )


def read_quality(entry: Any) -> tuple[QualityCheck, ...]:
    """Read the outcomes of the checks."""
    rows = read_table(entry["quality"], ("channel", "check", "verdict", "detail"))
    for row in rows:
        _one_of(row["verdict"], ("ok", "warn", "fail"))
    details = _worded(entry["quality"], [row["detail"] for row in rows])
    return tuple(QualityCheck.named(**row | {"detail": detail}) for row, detail in zip(rows, details, strict=True))


def read_against_mass(entry: Any) -> tuple[Reason, ...]:
    """Read what speaks against the mass beside failed checks; files of before say it of their clocks only.

    Raises
    ------
    ValueError
        If a code is none, or the state is not that of checks and reasons.
    """
    group, quality = _own(entry, AGAINST_MASS), entry["quality"]
    if group is None:
        return doubted_clocks([a for a in read_alignments(entry) if a.status == "ambiguous"])
    rows = read_table(group, ("code", "about", "text"))
    texts = _worded(group, [row["text"] for row in rows])
    found = tuple(Reason(ReasonCode(row["code"]), row["about"], text) for row, text in zip(rows, texts, strict=True))
    state = usability([check for check in read_quality(entry) if check.verdict == "fail"], found)
    if str(quality.attrs.get("state")) != state:
        raise ValueError(f"the state {str(quality.attrs.get('state'))!r:.40} is not that of its checks, {state.value}")
    return found


def _worded(group: Any, texts: list[str]) -> list[Worded]:
    """Return the texts of a table with their figures; files of before state none."""
    if FIGURES not in group:
        return [Worded(text) for text in texts]
    return _with_figures(texts, [row[FIGURES] for row in read_table(group, (FIGURES,))])


def _reasons(group: Any) -> tuple[str, ...]:
    """Read the doubts of an alignment with their figures; files of before state none."""
    texts = _texts(_json(group, "reasons"))
    return tuple(_with_figures(texts, _texts(_json(group, FIGURES)))) if FIGURES in group else texts


def _with_figures(texts: Sequence[str], figures: Sequence[str]) -> list[Worded]:
    return [with_figures(text, {FIGURES: read_json(one)}) for text, one in zip(texts, figures, strict=True)]


def _figures(texts: Iterable[str]) -> list[str]:
    """Return the column of the figures of texts."""
    return [json_text(beside(text).get(FIGURES, [])) for text in texts]


def read_alignments(entry: Any) -> tuple[ClockAlignment, ...]:
    """Read how the clocks map to the reference clock."""
    groups = sorted(entry["alignment"].values(), key=lambda group: int(group.attrs["order"]))
    numbers = ("offset_s", "u_offset_s", "drift", "u_drift")
    return tuple(
        ClockAlignment(
            clock=read_text(group, "clock"),
            **{name: float(group[name][()]) for name in numbers},
            status=_one_of(read_text(group, "status"), ("ok", "ambiguous", "failed")),
            method=read_text(group, "method"),
            reasons=_reasons(group),
            details=_object(_json(group, "details")) if "details" in group else None,
        )
        for group in groups
    )


def _one_of(word: str, words: tuple[str, ...]) -> Any:
    if word not in words:
        raise ValueError(f"{word!r} is none of {', '.join(words)}")
    return word


def _texts(value: Any) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise ValueError(f"{value!r:.40} is no list of texts")
    return tuple(value)


def _object(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{value!r:.40} is no JSON object")
    return value


def _version() -> str:
    try:
        return metadata.version(PROGRAM)
    except metadata.PackageNotFoundError:
        return "(not installed)"


def _write_rig(entry: Any, shot: Shot) -> None:
    rig = new_group(entry, "rig", "NXcollection")
    write_text(rig, "name", shot.rig_name)
    write_text(rig, "reference_clock", shot.reference_clock)
    write_text(rig, "text", shot.rig_text)
    if shot.databases is not None:
        databases = new_group(rig, "databases", "NXcollection")
        for order, (name, text) in enumerate(shot.databases.items()):
            note = new_group(databases, f"database_{order + 1}", "NXnote")
            note.attrs["order"] = order
            write_text(note, "file_name", name)
            write_text(note, "type", "text/plain")
            write_text(note, "data", text)


def _write_alignments(entry: Any, alignments: tuple[ClockAlignment, ...]) -> None:
    group = new_group(entry, "alignment", "NXcollection")
    names = tree_names((alignment.clock for alignment in alignments), ())
    for order, (name, alignment) in enumerate(zip(names, alignments, strict=True)):
        own = new_group(group, name, "NXcollection")
        own.attrs["order"] = order
        write_text(own, "clock", alignment.clock)
        for key, unit in (("offset_s", "s"), ("u_offset_s", "s"), ("drift", "1"), ("u_drift", "1")):
            own.create_dataset(key, data=float(getattr(alignment, key)), track_times=False).attrs["units"] = unit
        write_text(own, "status", alignment.status)
        write_text(own, "method", alignment.method)
        write_text(own, "reasons", json_text(list(alignment.reasons)))
        write_text(own, FIGURES, json_text(_figures(alignment.reasons)))
        if alignment.details is not None:
            write_text(own, "details", json_text(alignment.details))


def _write_quality(entry: Any, shot: Shot) -> None:
    group = new_group(entry, "quality", "NXcollection")
    group.attrs["state"] = shot.state.value
    rows = [check.to_json() for check in shot.quality]
    columns = {key: [row[key] for row in rows] for key in ("channel", "check", "verdict", "detail")}
    write_table(group, columns | {FIGURES: _figures(check.detail for check in shot.quality)})


def _write_against_mass(entry: Any, shot: Shot) -> None:
    columns = {key: [str(one.to_json()[key]) for one in shot.against_mass] for key in ("code", "about", "text")}
    write_table(new_group(entry, AGAINST_MASS, "NXcollection"), columns | {FIGURES: _figures(shot.against_mass)})


def _write_history(entry: Any, shot: Shot) -> None:
    history = new_group(entry, "history", "NXcollection")
    for k, step in enumerate(shot.history, start=1):
        process = new_group(history, f"step_{k}", "NXprocess")
        write_text(process, "program", PROGRAM)
        write_text(process, "version", step.version)
        index = process.create_dataset("sequence_index", data=k, track_times=False)
        index.attrs["units"] = "1"
        write_text(process, "what", step.what)
        write_text(process, "parameters", json_text(step.parameters))
    rows = [(c.name, s.what, s.version, json_text(s.parameters)) for c in shot.channels.values() for s in c.history]
    columns = ("channel", "what", "version", "parameters")
    write_table(
        new_group(history, "channels", "NXcollection"),
        {column: [row[i] for row in rows] for i, column in enumerate(columns)},
    )


def _write_acquisition(entry: Any, shot: Shot) -> None:
    if shot.acquisition is not None:
        _write_json(new_group(entry, "acquisition", "NXnote"), shot.acquisition.to_json())
    if not shot.clock_fits:
        return
    group = new_group(entry, "clock_fits", "NXcollection")
    names = tree_names(shot.clock_fits, ())
    for order, (name, (clock, fit)) in enumerate(zip(names, shot.clock_fits.items(), strict=True)):
        note = new_group(group, name, "NXnote")
        note.attrs["order"] = order
        write_text(note, "clock", clock)
        _write_json(note, fit)


def _write_json(note: Any, value: Any) -> None:
    write_text(note, "type", "application/json")
    write_text(note, "data", json_text(value))
