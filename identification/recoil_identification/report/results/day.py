"""A day at the range as it is handed over: its shots and their masses, the shot log, what was lost, what to copy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from recoil_identification.report.content.result_table import Document, ResultHead, Row
from recoil_identification.report.content.section import Column, Section
from recoil_identification.report.results import shot_index

SCHEMA = "recoil-daq/day/1"


def day_document(
    index: Document,
    *,
    campaign: Mapping[str, Any],
    log: Mapping[str, Any],
    lost: Sequence[Mapping[str, str]],
    copied: Sequence[Mapping[str, Any]],
    archive: str,
) -> dict[str, Any]:
    """Return the document of a day, JSON types.

    Parameters
    ----------
    index
        Document of `recoil_identification.report.results.shot_index.index_document`.
    campaign
        Answer of the shots together: ``text``, and ``page``, None where there is none.
    log
        The shot log: ``columns`` and ``rows``, texts.
    lost
        Losses, each with ``of`` and ``text``.
    copied
        Files to copy, each with ``path``, ``what``, ``files`` and ``bytes``.
    archive
        Command that packs all of it.
    """
    beside = {"campaign": dict(campaign), "log": dict(log), "lost": [dict(one) for one in lost]}
    return {**index, "schema": SCHEMA, **beside, "copy": [dict(one) for one in copied], "archive": archive}


def head(document: Document) -> ResultHead:
    """Return the head of the page."""
    together = str(document["campaign"]["text"])
    words = (shot_index.summary(document), *([f"{together[:1].upper()}{together[1:]}."] if together else []))
    faults = tuple(one["error"] for one in document["failed"])
    return ResultHead(
        "Day at the range",
        ", ".join(document["rigs"]),
        words,
        bool(document["lost"]) or shot_index.head(document).doubtful,
        faults,
    )


def _campaign(document: Document) -> list[Row]:
    found = document["campaign"]
    return [{"name": "campaign", "page": found["page"], "text": found["text"]}] if found["page"] else []


def _copied(document: Document) -> list[Row]:
    return [{**one, "files": str(one["files"]), "size": f"{one['bytes'] / 1e6:.1f}"} for one in document["copy"]]


def log_section(document: Document) -> Section:
    """Return the shot log as it is: its columns are the rig's own."""
    columns = tuple(
        Column(str(n), name, "name" if n == 0 else "text") for n, name in enumerate(document["log"]["columns"])
    )
    rows = [{str(n): cell for n, cell in enumerate(row)} for row in document["log"]["rows"]]
    return Section("log", "Shot log", "As it stands in shotlog.csv.", columns, lambda _: rows, sparse=True)


CAMPAIGN = Section(
    "campaign", "Campaign", "What the shots say together.",
    (Column("name", "Answer", "link"), Column("text", "Mass", "long")), _campaign, link=None,
)  # fmt: skip
LOST = Section(
    "lost", "What was lost", "What a shot's verdict counts as lost, and what is in no shot file, as far as is known.",
    (Column("of", "Of", "name"), Column("text", "What", "long")), lambda document: document["lost"],
)  # fmt: skip
NOTHING_LOST = Section("lost", "What was lost", sentences=lambda _: ("Nothing that is known.",))
COPY = Section(
    "copy", "What to copy", lambda document: f"Or all of it as one archive with digests: {document['archive']}",
    (Column("path", "Path", "name"), Column("what", "What it is", "long"), Column("files", "Files", "number"),
     Column("size", "Size", "number", "MB")), _copied,
)  # fmt: skip
