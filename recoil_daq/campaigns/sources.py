"""Sources of a campaign: its shots' files and reports, the shot logs, and the cut-off that the shots share.

The cut-off is kept in a file from when it is chosen until the answer is there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.files.new_file import give_name, partial_path
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.strict_json import read_json, told_in_one_line
from recoil_acquisition.remark import Note, NoteCode, Remark
from recoil_acquisition.shot.recorded_file import RecordedFile
from recoil_acquisition.shot.shot import InputFile
from recoil_acquisition.store import recorded_files
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from recoil_acquisition.store.shot_log_row import ShotLogRow
from recoil_daq.reports.identify import find_shot_files
from recoil_daq.reports.reproduction.places import reports_in
from recoil_daq.reports.stored_shot import BESIDE, RIG_FILE
from recoil_daq.version import __version__
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.report.document.report_files import (
    LARGEST_REPORT,
    REPORT_FILE,
    SCHEMA,
    json_bytes,
    read_document,
    seal_fault,
)
from recoil_identification.shot.identified import Options
from recoil_processing.spectra.cutoff import CutoffChoice

CUTOFF_FILE = "cutoff.json"
CUTOFF_SCHEMA = "recoil-daq/cutoff/1"
LARGEST = 1_000_000
"""Bytes of a campaign's cut-off file, beyond which it is none."""


@dataclass(frozen=True)
class SharedCutoff:
    """The cut-off of a campaign's shots; who chose it need not do so again, and cannot choose another one.

    Attributes
    ----------
    choice
        Choice of the trace's low-pass from the spectra of all shots; None where each shot finds its own.
    mass_cutoff_hz
        Cut-off of the low-pass in the fit of the mass, Hz; None where there is none.
    """

    choice: CutoffChoice | None
    mass_cutoff_hz: float | None

    @classmethod
    def of(cls, options: Collection[Options]) -> SharedCutoff | None:
        """Return that of several shots; None where they share none."""
        shared = {cls(one.campaign, one.mass_cutoff_hz) for one in options}
        return shared.pop() if len(options) > 1 and len(shared) == 1 else None

    @property
    def options(self) -> Options:
        """With which each of the shots is identified."""
        return Options(campaign=self.choice, mass_cutoff_hz=self.mass_cutoff_hz)

    @classmethod
    def read(cls, folder: Path) -> SharedCutoff | None:
        """Return what an earlier run kept in a folder; None if there is nothing.

        Raises
        ------
        ReadError
            If the file is damaged.
        """
        path = folder / CUTOFF_FILE
        if not path.exists():
            return None
        try:
            stated = read_json(read_small(path, LARGEST, "a campaign's cut-off"))
            if stated["schema"] != CUTOFF_SCHEMA:
                raise ValueError(f"schema {stated['schema']!r}")
            choice, mass_hz = stated["choice"], stated["mass_cutoff_hz"]
            choice = None if choice is None else CutoffChoice.of_json(choice)
            kept = cls(choice, None if mass_hz is None else float(mass_hz))
            kept.options  # noqa: B018 - refuses what is no cut-off
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise ReadError(
                "this is no cut-off of a campaign", path=path, expected=f"schema {CUTOFF_SCHEMA}", found=str(error),
                remedy="remove it, or choose --out",
            ) from error  # fmt: skip
        return kept

    def write(self, folder: Path) -> None:
        """Keep it in a folder, which is made if it is not there.

        Raises
        ------
        StoreError
            If it cannot be written; what was there is there still.
        """
        path = folder / CUTOFF_FILE
        choice = None if self.choice is None else self.choice.to_json()
        document = {"schema": CUTOFF_SCHEMA, "mass_cutoff_hz": self.mass_cutoff_hz, "choice": choice}
        temporary = partial_path(path)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            try:
                temporary.write_bytes(json_bytes(document))
                give_name(temporary, path, overwrite=True)
            finally:
                temporary.unlink(missing_ok=True)
        except OSError as error:
            raise StoreError(
                f"cannot be written: {error.strerror or error}", path=path, remedy="check space and permissions"
            ) from error


class Outdated(StrEnum):
    """Kind of a reason why a report is not taken as it is, and the shot identified anew."""

    MISSING = "missing"
    OTHER_SHOT = "other shot"
    VERSION = "version"
    CHANGED = "changed"
    NO_SUMMARY = "no summary"
    CORRECTION = "correction"
    CUTOFF = "cutoff"
    THINNED = "thinned"
    FILTER = "filter"


@dataclass(frozen=True, eq=False)
class CampaignReport:
    """Parts of a report that a campaign needs: a season's reports as a whole would fill the memory.

    Attributes
    ----------
    sha256, of_sha256
        SHA-256 digests of the report and of its shot file.
    version
        Version of this program that made the report.
    rig_sha256
        Digest of the corrected rig file that the report was made with; empty if it was made with the shot file's rig.
    recorded
        Recorded files that the shot was made of.
    taken
        Shot as a campaign takes it, or a sentence on why it cannot.
    seal_fault
        Sentence on why the report is not what was written; empty if it is.
    outputs
        Digests of the files beside the report; keys are their names.
    thinned
        Whether the fastest channels were thinned for its number.
    filter
        Name of its low-pass; empty of the usual one.
    """

    path: Path
    sha256: str
    of_sha256: str
    version: str
    rig_sha256: str
    recorded: tuple[RecordedFile, ...]
    taken: CampaignShot | str
    seal_fault: str = ""
    outputs: Mapping[str, str] = field(default_factory=dict)
    thinned: bool = False
    filter: str = ""

    @classmethod
    def read(cls, path: Path) -> CampaignReport:
        """Read what a campaign needs of a ``report.json``; ReadError if it is no report of a shot."""
        content = read_small(path, LARGEST_REPORT, "a report")
        document = read_document(path, content)
        with told_in_one_line("this is no report of a shot", path, expected=f"schema {SCHEMA}"):
            provenance = document["provenance"]
            rigs = [str(one["sha256"]) for one in provenance["inputs"] if one.get("source") == RIG_FILE]
            recorded = tuple(
                RecordedFile.of_json(one) for one in provenance["inputs"][1:] if one.get("source") not in BESIDE
            )
            stated = str(provenance["inputs"][0]["sha256"]), str(provenance["version"]), "".join(rigs), recorded
            outputs = {str(one["file"]): str(one["sha256"]) for one in provenance.get("outputs", ())}
            fault = seal_fault(document)
            options = provenance["parameters"].get("options", {})
            thin, low_pass = bool(options.get("thin")), str(options.get("filter", ""))
        try:
            taken: CampaignShot | str = CampaignShot.of_report(document)
        except ValueError as error:
            taken = str(error)
        return cls(path, hashlib.sha256(content).hexdigest(), *stated, taken, fault, outputs, thin, low_pass)

    @property
    def cutoff_hz(self) -> float | None:
        """Cut-off of the rows that its summary stands for."""
        return self.taken.cutoff_hz if isinstance(self.taken, CampaignShot) else None

    def shot(self) -> CampaignShot:
        """Return the shot as a campaign takes it.

        Raises
        ------
        ReadError
            If the report is damaged.
        """
        if isinstance(self.taken, str):
            raise ReadError(
                "this report cannot be combined", path=self.path, found=self.taken, remedy="identify the shot anew"
            )
        return self.taken

    def why_not(self, sha256: str | None, cutoff_hz: float | None, rig_sha256: str = "") -> Remark | None:
        """Say why it is not taken as it is, with a code of `Outdated`; None if it is.

        Parameters
        ----------
        sha256
            Digest of the shot file that the report must be of; None if that is not at hand.
        cutoff_hz
            Cut-off that the report must have been found with, Hz; None for any.
        rig_sha256
            Digest of the corrected rig file that the report must have been found with; empty for any, or none.
        """
        if sha256 is not None and self.of_sha256 != sha256:
            return Remark(Outdated.OTHER_SHOT, None, "is of another shot file")
        if self.version != __version__:
            return Remark(Outdated.VERSION, None, f"was made by another version than {__version__}")
        if self.seal_fault:
            return Remark(Outdated.CHANGED, None, self.seal_fault)
        if self.thinned:
            return Remark(Outdated.THINNED, None, "is of thinned channels")
        if self.filter:
            return Remark(Outdated.FILTER, None, f"is behind another filter, {self.filter}")
        if self.shot().summary is None:
            return Remark(Outdated.NO_SUMMARY, None, "has no summary for campaigns")
        if rig_sha256 and rig_sha256 != self.rig_sha256:
            return Remark(Outdated.CORRECTION, None, "was made without this corrected rig file")
        if cutoff_hz is not None and self.cutoff_hz not in (None, cutoff_hz):
            other = f"was found with a cut-off of {self.cutoff_hz:g} Hz, the campaign's is {cutoff_hz:g} Hz"
            return Remark(Outdated.CUTOFF, None, other)
        return None


@dataclass(frozen=True, eq=False)
class Source:
    """A shot of a campaign: its file with its digest, its report, or both."""

    shot_file: Path | None
    sha256: str | None
    report: CampaignReport | None

    @property
    def name(self) -> str:
        """The shot's name, by its report if there is one."""
        if self.report is not None and isinstance(self.report.taken, CampaignShot):
            return self.report.taken.name
        return self.place.stem

    @property
    def recorded(self) -> tuple[RecordedFile, ...]:
        """Recorded files that the shot was made of, by its own file if that is at hand; errors as of that."""
        if self.shot_file is not None:
            return recorded_files(self.shot_file)
        return () if self.report is None else self.report.recorded

    @property
    def place(self) -> Path:
        """The file by which it is named to people."""
        if self.shot_file is not None:
            return self.shot_file
        return Path() if self.report is None else self.report.path

    def why_not(self, cutoff_hz: float | None, rig_sha256: str = "") -> Remark | None:
        """Say why its report is not taken as it is, as `CampaignReport.why_not`; None if it is."""
        if self.report is None:
            return Remark(Outdated.MISSING, None, "is missing")
        return self.report.why_not(self.sha256, cutoff_hz, rig_sha256)


def sources_of(places: Sequence[Path], reports: Sequence[Path]) -> Iterator[Source]:
    """List the shots of files and folders, each with its report where one is there.

    Parameters
    ----------
    reports
        Folders in which to look for the report of a shot file, the last one first.
    """
    for place in places:
        inside = [place]
        if place.is_dir() and not any(place.glob("*.h5")):
            inside = reports_in(place)
            if not inside:
                raise ReadError(
                    "neither shot files nor reports in this folder",
                    path=place,
                    expected=f"files that end in .h5, or folders with a {REPORT_FILE}",
                )
        for path in inside:
            if path.suffix == ".json":
                yield Source(None, None, CampaignReport.read(path))
                continue
            for shot_file in find_shot_files([path]):
                at = [folder / shot_file.stem / REPORT_FILE for folder in reversed(reports)]
                there = [CampaignReport.read(one) for one in at if one.exists()]
                sha256 = InputFile.of(shot_file).sha256
                of_file = [one for one in there if not one.why_not(sha256, None)]
                yield Source(shot_file, sha256, next(iter([*of_file, *there]), None))


@dataclass(frozen=True, eq=False)
class CampaignLogs:
    """The shot logs of a campaign.

    Attributes
    ----------
    given
        Path of the one log for all shots; None if none is given.
    read
        Logs that are there; keys are their paths.
    """

    given: Path | None
    read: Mapping[Path, ShotLog]

    @classmethod
    def of(cls, given: Path | None, sources: Sequence[Source]) -> CampaignLogs:
        """Read the log that is given, or those beside the shot files."""
        if given is not None:
            if not given.exists():
                raise ReadError("no such file", path=given, remedy="check the name and the folder")
            return cls(given, {given: ShotLog.read(given)})
        beside = dict.fromkeys(one.shot_file.parent / SHOT_LOG for one in sources if one.shot_file is not None)
        logs = {path: ShotLog.read(path) for path in beside}
        return cls(None, {path: log for path, log in logs.items() if log.sha256 is not None})

    def applied(self, source: Source, shot: CampaignShot) -> CampaignShot:
        """Take what the log says of a shot, instead of what it said when the shot was identified."""
        path = self.given
        if path is None and source.shot_file is not None:
            path = source.shot_file.parent / SHOT_LOG
        log = None if path is None else self.read.get(path)
        if log is None:
            return shot
        row = log.row(shot.name) or ShotLogRow(shot.name)
        if row.added_mass_kg >= shot.mass_kg:
            raise ReadError(
                f"{row.added_mass_kg:g} kg are added in shot {shot.name}, whose whole mass is {shot.mass_kg:.4g} kg",
                path=log.path, remedy="correct `added_mass_kg` in the shot log",
            )  # fmt: skip
        return replace(
            shot,
            configuration=row.configuration,
            added_mass_kg=row.added_mass_kg,
            u_added_mass_kg=row.u_added_mass_kg,
            excluded=row.exclude,
            log=row.to_json(),
        )

    def strangers(self, names: Sequence[str]) -> list[Note]:
        """Say which rows are of no shot at all."""
        return [
            Note(NoteCode.LOG_ROW, name, f"{path}: shot {name} is in the shot log, but there is no such shot")
            for path, log in self.read.items()
            for name in log.without_shot([*names, *log.shots])
        ]
