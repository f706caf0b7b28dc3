"""Texts of a file of DEWETRON OXYGEN: its segments, its setup, its events and its start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import BinaryIO

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.oxygen.blocks import BlockIndex
from recoil_acquisition.readers.oxygen.embedded_text import read_xml
from recoil_acquisition.readers.oxygen.setup import SegmentSetup, Setup, read_segments, read_setup, read_start
from recoil_acquisition.readers.oxygen.storing import Event, read_events
from recoil_acquisition.timebase import AbsoluteStart

_SETUPS = "oxy_config"
_WHOLE_TEXTS = (_SETUPS, "oxy_event")
"""Segments of which the last text says everything; those of ``oxy_event_recovery`` add to each other."""


@dataclass(frozen=True, eq=False)
class Description:
    """Description of a file by its texts.

    Attributes
    ----------
    setup
        The last one.
    start
        Of the acquisition.
    """

    segments: Mapping[int, SegmentSetup]
    setup: Setup
    events: list[Event]
    start: AbsoluteStart | None


def read_description(index: BlockIndex, file: BinaryIO) -> Description:
    """Read the last description of the segments, the last setup, and all events.

    Raises
    ------
    CorruptFileError
        If the setup is missing, or a text is damaged.
    ReadError
        If setups state several starts.
    """
    path = index.path
    try:
        segments = read_segments(read_xml(path, file, index.configs[-1])) if index.configs else {}
        setup: Setup | None = None
        final: list[Event] | None = None
        recovery: set[Event] = set()
        starts: list[AbsoluteStart | None] = []
        latest = {block.segment: block for block in index.texts}
        for block in index.texts:
            name = segments[block.segment].name if block.segment in segments else ""
            if name in _WHOLE_TEXTS and block is not latest[block.segment]:
                if name == _SETUPS:
                    starts.append(read_start(read_setup(read_xml(path, file, block)).properties))
                continue  # a later one says all of this again, but for another start
            text = read_xml(path, file, block)
            kind = text.tag.rpartition("}")[2]
            if kind == "MeasurementConfig":
                setup = read_setup(text)
            elif kind == "Events" and name == "oxy_event":
                final = list(read_events(text))
            elif kind == "Events":
                recovery.update(read_events(text))
        if setup is None:
            raise CorruptFileError(
                "the setup of the measurement is missing", path=path, expected="MeasurementConfig",
                found=index.incomplete or "none",
            )  # fmt: skip
        start = read_start(setup.properties)
        _check_one_start(index, [*starts, start])
    except (ValueError, KeyError, OverflowError) as error:
        raise CorruptFileError(f"the setup is damaged: {error}", path=path) from error
    return Description(segments, setup, sorted(recovery) if final is None else final, start)


def _check_one_start(index: BlockIndex, starts: list[AbsoluteStart | None]) -> None:
    """Refuse a file whose setups state several starts: of the ticks of which one counts is not known."""
    stated = list(dict.fromkeys(start for start in starts if start is not None))
    if len(stated) > 1:
        raise ReadError(
            f"a second recording begins at {stated[1].text}", path=index.path,
            expected=f"one acquisition, that of {stated[0].text}", found=f"{len(stated)} in its setups",
            remedy="export each from OXYGEN as a file of its own",
        )  # fmt: skip
