"""Session of a journal in which all that it states of it is damaged: a rig file and the records stand in for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from recoil_acquisition.capture.session_record import KINDS, LiveRecord, RecordedSource, wall_of_name
from recoil_acquisition.clocks.host_clock import Anchor
from recoil_acquisition.errors import StoreError
from recoil_acquisition.live_kind import live_kind_of
from recoil_acquisition.log.folder import Log
from recoil_acquisition.log.record import OWN, Kind
from recoil_acquisition.quantities.declaration import checked
from recoil_rigs.rig import load_rig

_OF_ALL = (Kind.EVENT, Kind.IDLE)
"""Kinds of records that every source may give."""


def with_rig(journal: Log, rig: Path | str | None) -> tuple[Log, str]:
    """Return a journal whose session a rig states in place of what is damaged, and how that came about.

    The sources of a session are those of its rig that have a device, in its order: records of another kind than their
    source's are refused.
    """
    if rig is None:
        raise StoreError(
            "what it says of its session is damaged wherever it stands", path=journal.folder,
            remedy="name the rig that it was acquired with: `recoil-daq recover FOLDER --rig FILE`",
        )  # fmt: skip
    loaded = load_rig(rig)
    live = [source for source in loaded.sources if source.device is not None]
    live = live or [source for source in loaded.sources if live_kind_of(source.kind, None) is not None]
    kinds = [live_kind_of(source.kind, source.device) for source in live]
    given = [(*_OF_ALL, *([] if kind is None else [KINDS[kind.block]])) for kind in kinds]
    for one in journal.records():
        if one.source == OWN or (one.source < len(live) and one.kind in given[one.source]):
            continue
        named = f"{live[one.source].name} ({live[one.source].kind})" if one.source < len(live) else "none"
        raise StoreError(
            f"was not acquired with rig {loaded.name!r}", path=journal.folder, place=f"record {one.number}",
            expected=f"what source {one.source} of the rig gives, {named}", found=f"a record of kind {one.kind}",
            remedy="name the rig file as it was on that day",
        )  # fmt: skip
    anchor, known = _anchor_of(journal)
    sources = tuple(RecordedSource.of(source.name, source.kind, source.device) for source in live)
    record = LiveRecord(loaded.name, loaded.text, str(loaded.path), dict(loaded.databases), anchor, sources)
    return replace(journal, session=record.to_json()), f"what it says of its session is damaged: read by {rig}{known}"


def _anchor_of(journal: Log) -> tuple[Anchor, str]:
    """Return an instant on both clocks of the host, and what is to be said of it.

    A record of the clocks states it. Without one, the folder is named after the beginning, which was before the first
    record was appended, and the last file was written at or after its last record: the truth is between the two.
    """
    first = last = None
    for one in journal.records():
        if one.source == OWN and one.kind == Kind.CLOCK:
            try:
                return checked(Anchor, one.said), ""
            except ValueError:
                continue
        # one that waited for more than an hour was read then, and no more is known of when it was appended
        seen = one.host_ns if one.logged_ns is None else one.logged_ns
        first, last = (seen if first is None else first), seen
    begun = wall_of_name(journal.folder.name)
    if begun is None or first is None or last is None:
        raise StoreError(
            "no record of the host's clocks is sound, and the folder is not named after its beginning: when it was is"
            " not known", path=journal.folder, remedy="give the folder back its name, such as 20261120T081244.120000Z",
        )  # fmt: skip
    written = max(segment.path.stat().st_mtime_ns for segment in journal.segments)
    within = max(written - begun - (last - first), 0) // 2
    note = f"; no record of the host's clocks is sound: its times of day are known within {within / 1e9:.3g} s"
    return Anchor(begun + within, first, within), note
