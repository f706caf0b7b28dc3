"""Sources of a certificate: the document that it is of, the reports of its shots, the shot files behind these."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from recoil_acquisition.errors import ReadError, quoted
from recoil_acquisition.files.regular_file import read_small, require_name
from recoil_acquisition.files.strict_json import told_in_one_line
from recoil_acquisition.shot.shot import InputFile
from recoil_daq.arguments import named_report
from recoil_identification.report.document.campaign_document import CAMPAIGN_FILE, LARGEST_ANSWER
from recoil_identification.report.document.campaign_document import SCHEMA as CAMPAIGN_SCHEMA
from recoil_identification.report.document.certificate_document import Behind
from recoil_identification.report.document.report_files import LARGEST_REPORT, REPORT_FILE, of_schema, seal_fault
from recoil_identification.report.document.report_files import SCHEMA as REPORT_SCHEMA

KINDS = {
    CAMPAIGN_FILE: (CAMPAIGN_SCHEMA, LARGEST_ANSWER, "answer of a campaign"),
    REPORT_FILE: (REPORT_SCHEMA, LARGEST_REPORT, "report of a shot"),
}
"""File of a document that a certificate can be of -> its schema, its largest size, and what it is called."""
WITHIN = ("", "reports", "shots", "campaign", "campaign/reports")
"""Folders, in one that is looked through, in which documents and shot files usually stand."""


@dataclass(frozen=True)
class Sealed:
    """A document whose digest of itself holds, as it stands on the disk.

    Attributes
    ----------
    path
        Path of its file.
    sha256
        Digest of that file.
    document
        Contents.
    """

    path: Path
    sha256: str
    document: Mapping[str, Any]

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a report or a campaign's answer.

        Raises
        ------
        ReadError
            If it is none, or was changed after it was written.
        """
        schema, largest, called = KINDS.get(path.name, KINDS[REPORT_FILE])
        content = read_small(path, largest, called)
        with told_in_one_line(f"this is no {called}", path, expected=f"schema {schema}"):
            document = of_schema(content, schema)
            fault = seal_fault(document)
        if fault:
            raise ReadError(f"this {called} {fault}", path=path, remedy="make it anew, and look who changed it")
        return cls(path, hashlib.sha256(content).hexdigest(), document)

    @property
    def kind(self) -> Behind:
        """Kind of the document."""
        return Behind.ANSWER if self.document["schema"] == CAMPAIGN_SCHEMA else Behind.REPORT

    @property
    def named(self) -> str:
        """Name of its file with that of its folder, with a slash."""
        return f"{self.path.absolute().parent.name}/{self.path.name}"


@dataclass(frozen=True)
class Sources:
    """Documents that a certificate is made of.

    Attributes
    ----------
    of
        Report of the shot, or answer of the campaign.
    reports
        Reports of the shots, in the order of that document; the report itself of a single shot.
    """

    of: Sealed
    reports: tuple[Sealed, ...]

    @classmethod
    def find(cls, place: Path) -> Self:
        """Read the document of a place, and the reports of its shots.

        Parameters
        ----------
        place
            A ``report.json`` or ``campaign.json``, its folder, or the name of a shot whose report is in ``reports``.

        Raises
        ------
        ReadError
            If there is none, or a report that an answer was made of is not found.
        """
        place = named_report(place)
        if place.is_dir():
            there = [place / name for name in KINDS if (place / name).is_file()]
            if not there:
                raise ReadError(
                    "neither a report nor the answer of a campaign in this folder", path=place,
                    expected=f"{REPORT_FILE} or {CAMPAIGN_FILE}",
                    remedy="name the folder of one report, or that of a campaign",
                )  # fmt: skip
            place = there[0]
        if place.suffix == ".h5":
            raise ReadError(
                "a certificate is made of a report, and this is a shot file", path=place,
                remedy=f"identify it first: `recoil-daq identify {quoted(place)}`, then name its report",
            )  # fmt: skip
        return cls.behind(Sealed.read(place), ())

    @classmethod
    def behind(cls, of: Sealed, folders: Sequence[Path]) -> Self:
        """Return a document with the reports that it was made of, by their digests.

        Parameters
        ----------
        folders
            Folders in which to look before the document's own.
        """
        if of.document["schema"] == REPORT_SCHEMA:
            return cls(of, (of,))
        listed = {str(one["file"]): str(one["sha256"]) for one in of.document["provenance"]["inputs"]}
        wanted = {
            file.partition("/")[0]: (file, sha256) for file, sha256 in listed.items() if file.endswith(REPORT_FILE)
        }
        found = []
        for one in of.document["shots"]:
            file, sha256 = wanted[str(one["shot"])]
            path = found_by_digest(file, sha256, of.path.absolute().parent, folders)
            if path is None:
                raise ReadError(
                    f"the report of shot {one['shot']} that this answer was made of is not found", path=of.path,
                    expected=f"{file} with SHA-256 {sha256}", remedy="put the reports beside the answer, as they were",
                )  # fmt: skip
            found.append(Sealed.read(path))
        return cls(of, tuple(found))

    @property
    def inputs(self) -> list[dict[str, str]]:
        """File, kind and digest of each document, and of the shot file that each report says it was made of."""
        found = [{"file": self.of.named, "kind": self.of.kind, "sha256": self.of.sha256}]
        for one in self.reports:
            if one is not self.of:
                found.append({"file": one.named, "kind": one.kind, "sha256": one.sha256})
            shot_file = one.document["provenance"]["inputs"][0]
            stated = {"file": str(shot_file["file"]), "kind": Behind.SHOT, "sha256": str(shot_file["sha256"])}
            found.append(stated | ({"seal": str(shot_file["seal"])} if shot_file.get("seal") else {}))
        return found


def candidates(file: str, home: Path, folders: Sequence[Path], *, far: bool = True) -> Iterator[Path]:
    """Yield the files that may be the one that a document names, each once.

    Parameters
    ----------
    file
        Name of the file, with or without that of its folder.
    home
        Folder of the document.
    folders
        Folders that are looked through before it.
    far
        Whether those above the one that it stands in are looked through, too, and those beside it.

    Raises
    ------
    ValueError
        If the name is more than that, and could lead out of these folders.
    """
    *above, name = file.split("/")
    for part in (*above, name):
        require_name(part)
    if len(above) > 1:
        raise ValueError(f"a file called {file[:40]!r}, which is no name of one in a folder")
    beside = sorted(path for path in home.parent.glob("*") if path.is_dir())
    further = [*home.parents[1:3], *beside, Path.cwd()] if far else []
    places = [*folders, home, home.parent, *further]
    ways = dict.fromkeys(
        place / within / way for place in places for within in WITHIN for way in ("/".join((*above, name)), name)
    )
    yield from (path for path in ways if path.is_file())


def found_by_digest(file: str, sha256: str, home: Path, folders: Sequence[Path]) -> Path | None:
    """Return the file that a document names and whose digest it states; None where it is not found."""
    return next((path for path in candidates(file, home, folders) if InputFile.of(path).sha256 == sha256), None)
