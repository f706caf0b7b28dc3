"""Earlier campaigns of a season: their answers, read for comparison with a new one."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError, RecoilDaqError
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.strict_json import told_in_one_line
from recoil_daq.campaigns.sources import CampaignReport
from recoil_daq.reports.report_folder import way_inside, way_to_page
from recoil_identification.report.content.result_table import Row
from recoil_identification.report.document.campaign_document import CAMPAIGN_FILE, LARGEST_ANSWER, SCHEMA
from recoil_identification.report.document.report_files import REPORT_FILE, of_schema, seal_fault
from recoil_identification.report.page.html import CAMPAIGN_PAGE
from recoil_identification.report.results.history import THIS, history_document, row_of, shared_kg2

HISTORY_FILE = "earlier campaign"
"""Source of an earlier campaign's answer among the inputs of an answer."""


@dataclass(frozen=True)
class Past:
    """An earlier campaign.

    Attributes
    ----------
    path
        Path of its ``campaign.json``.
    root
        Folder beyond which its reports are not looked for.
    sha256
        SHA-256 of that file.
    name
        Way to its folder from that of the history.
    document
        Contents of the file.
    row
        Row of it among the others.
    """

    path: Path
    root: Path
    sha256: str
    name: str
    document: Mapping[str, Any]
    row: Row

    @classmethod
    def read(cls, path: Path, name: str, root: Path) -> Past:
        """Read an answer.

        Raises
        ------
        ReadError
            If it is none, or lacks what it takes to compare it.
        """
        content = read_small(path, LARGEST_ANSWER, "a campaign's answer")
        with told_in_one_line(
            "this is no answer of a campaign that can be compared", path,
            remedy="combine its shots anew, or take it out of the history",
        ):  # fmt: skip
            document = of_schema(content, SCHEMA)
            row = row_of(document, name)
            fault = seal_fault(document)
            shared_kg2(document, document)
            _shots(document)
            remark = f"it {fault}" if fault else None if document["valid"] else "it is not valid"
        return cls(path, root, hashlib.sha256(content).hexdigest(), name, document, {**row, "remark": remark})


@dataclass(frozen=True)
class History:
    """Earlier campaigns, in the order of firing."""

    past: tuple[Past, ...]

    @classmethod
    def read(cls, folder: Path, out: Path) -> History:
        """Read every answer below a folder.

        Parameters
        ----------
        out
            Folder of the new answer: the one that it replaces is no earlier one.

        Raises
        ------
        ReadError
            If there is none at all, or one cannot be read.
        """
        if not folder.is_dir():
            raise ReadError("no such folder", path=folder, remedy="check the name of the history")
        own = os.path.realpath(out / CAMPAIGN_FILE)
        paths = [path for path in sorted(folder.rglob(CAMPAIGN_FILE)) if not _is_hidden(path.relative_to(folder))]
        if not paths:
            raise ReadError("no campaign's answer in this folder", path=folder, expected=f"a {CAMPAIGN_FILE}")
        found: dict[str, Past] = {}
        for path in paths:
            if os.path.realpath(path) != own:
                name = path.parent.relative_to(folder).as_posix()
                one = Past.read(path, folder.resolve().name if name == "." else name, folder.absolute().parent)
                found.setdefault(one.sha256, one)  # a copy is no other campaign
        return cls(tuple(sorted(found.values(), key=lambda one: (one.row["first"] or "", one.name))))

    @property
    def inputs(self) -> list[dict[str, Any]]:
        """Name and digest of each answer."""
        return [
            {"file": f"{one.name}/{CAMPAIGN_FILE}", "sha256": one.sha256, "source": HISTORY_FILE} for one in self.past
        ]

    def beside(self, document: Mapping[str, Any], home: Path) -> dict[str, Any]:
        """Compare the campaigns with a new one.

        Parameters
        ----------
        document
            Contents of the new ``campaign.json``.
        home
            Folder that gets it.

        Raises
        ------
        ReadError
            If they cannot be compared.
        """
        with told_in_one_line("these campaigns cannot be compared", self.past[0].path if self.past else home):
            new = Past(home / CAMPAIGN_FILE, Path(home.absolute().anchor), "", THIS, document, row_of(document, THIS))
            compared, rows = [new], [new.row]
            for one in reversed(self.past):  # of two with shots in common the newer one is taken
                remark = one.row["remark"] or next(_apart(one, compared), None)
                compared += [one] if remark is None else []
                page = way_to_page(home, one.path.parent, CAMPAIGN_PAGE)
                rows.append({**one.row, "remark": remark, "page": page})
            documents = [one.document for one in reversed(compared)]
            covariance = [
                [a["mass"]["u"] ** 2 if a is b else shared_kg2(a, b) for b in documents] for a in documents
            ]  # fmt: skip
            return history_document(rows[::-1], covariance)


def _apart(one: Past, compared: Sequence[Past]) -> Iterator[str]:
    """Yield why a campaign is not compared with those that are, the new one first."""
    this = compared[0].document
    rig, built = one.document["rig"], one.document["mass"].get("configuration")
    if rig != this["rig"]:
        yield f"it is of another rig, {rig}"
    if built != this["mass"]["configuration"]:
        yield f"its mass is of another configuration, {built}"
    for other in compared:
        if common := _common(one, other):
            yield f"{common} of its shots {'are' if common > 1 else 'is'} in {other.name}, too"


def _common(one: Past, other: Past) -> int:
    """Count the shots that two campaigns have in common.

    Shots of one name and instant are one if they were made of one recorded file; where the report of one of them is not
    at hand, if anything tells the instant.
    """
    ours, theirs = _shots(one.document), _shots(other.document)
    count = 0
    for key in ours.keys() & theirs.keys():
        files = _recorded(one, ours[key]), _recorded(other, theirs[key])
        count += bool(files[0] & files[1]) if all(files) else bool(key[1])
    return count


def _shots(document: Mapping[str, Any]) -> dict[tuple[str, str], object]:
    """Return the way to the page of each shot's report, by its name and instant."""
    return {(str(one["shot"]), str(one["started"] or "")): one["report"] for one in document["shots"]}


def _recorded(one: Past, page: object) -> frozenset[str]:
    """Return the digests of the recorded files of a shot; none where its report is not at hand."""
    place = way_inside(one.path.parent, page, one.root)
    if place is None:
        return frozenset()
    try:
        report = CampaignReport.read(place.parent / REPORT_FILE)
    except RecoilDaqError:
        return frozenset()
    return frozenset(file.sha256 for file in report.recorded if file.sha256)


def _is_hidden(path: Path) -> bool:
    """Whether a path lies in a folder that is not whole, or that is nobody's to look into."""
    return any(part.startswith(".") for part in path.parts)
