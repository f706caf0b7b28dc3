"""Where the numbers of a report come from, and whether they come again from the shot file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError, quoted
from recoil_daq.reports.reproduction.kept_document import KeptDocument
from recoil_daq.reports.reproduction.places import ANEW
from recoil_daq.reports.reproduction.recomputed import recompute
from recoil_daq.terminal.result import Printed, Progress
from recoil_daq.version import __version__
from recoil_identification.report.document.explanation import Entry, explained
from recoil_identification.report.document.report_files import computer
from recoil_identification.report.document.reproduction import ELSEWHERE, Comparison, Difference
from recoil_rigs.shots.fired_shot import FiredShot

MOST_LISTED = 1000
"""Number of differences that a document lists; all are counted."""


@dataclass(frozen=True, repr=False)
class Explained(Printed):
    """A part of a report explained, and what came of the report again.

    Attributes
    ----------
    report
        Path of the ``report.json``.
    shot, rig
        Names of the shot and of its rig.
    key
        Key path that was asked for; None for what most ask for.
    entries
        Parts of the report that are explained, each a tree.
    steps
        Steps from the recorded files to the report with their parameters, one line each.
    parameters
        Parameters of the identification.
    made, now
        Versions and kinds of computer: `made` of when the report was made, `now` of when it was made again.
    files
        Files that the report was made of, each with ``file``, ``sha256``, ``found``, ``sha256_now`` and ``state``.
    exact
        Whether numbers must come again to the last bit; else within 1e-9.
    comparison
        Comparison of all numbers of the report and of the tables beside it, of page, paper copy and figures.
    """

    report: Path
    shot: str
    rig: str
    key: str | None
    entries: tuple[Entry, ...]
    steps: tuple[str, ...]
    parameters: Mapping[str, Any]
    made: Mapping[str, str]
    now: Mapping[str, str]
    files: tuple[Mapping[str, Any], ...]
    exact: bool
    comparison: Comparison

    @property
    def again(self) -> bool:
        """Whether everything comes again, and nothing that the report says was written with it was left unlooked at."""
        return self.comparison.again

    @property
    def differences(self) -> tuple[Difference, ...]:
        """Numbers that do not come again, the worst first."""
        return self.comparison.differences

    def to_json(self) -> dict[str, Any]:
        """Return the document that ``explain --json`` prints."""
        return {
            "schema": "recoil-daq/explain/1",
            "report": str(self.report),
            "shot": self.shot,
            "rig": self.rig,
            "key": self.key,
            "explained": [one.to_json() for one in self.entries],
            "steps": list(self.steps),
            "parameters": dict(self.parameters),
            "versions": {"made": dict(self.made), "now": dict(self.now)},
            "files": [dict(one) for one in self.files],
            "recomputed": _outcome(self.comparison, exact=self.exact),
        }

    def show(self) -> None:
        """Print it as a tree: on a terminal with its branches drawn, else indented."""
        from recoil_daq.terminal.explanation import print_explained

        print_explained(self.to_json())

    def __repr__(self) -> str:
        came = "all again" if self.again else f"{len(self.differences)} differ"
        return f"Explained({self.shot!r}: {self.comparison.numbers} numbers, {came}, {self.report})"


def explained_again(
    kept: KeptDocument, key: str | None, folders: Sequence[Path], progress: Progress = lambda _: None
) -> Explained:
    """Explain the numbers of a document, and make it again, with errors as of `recompute`.

    Parameters
    ----------
    key
        Key path of what is to be explained; None for what most ask for.
    folders
        Folders in which to look for what it was made of first.
    progress
        Function called with the name of each step.
    """
    done = recompute(kept, folders, progress=progress)
    entries = entries_of(kept.path, kept.document, key, done.again.fired, done.comparison)
    provenance = kept.document["provenance"]
    return Explained(
        report=kept.path,
        shot=", ".join(kept.shots),
        rig=str(kept.document["rig"]),
        key=key,
        entries=entries,
        steps=done.again.steps,
        parameters=provenance["parameters"],
        made={"recoil-daq": provenance["version"], **provenance.get("computer", {})},
        now={"recoil-daq": __version__, **computer()},
        files=tuple(state for one in done.again.ingredients for state in one.states()),
        exact=kept.same_computer,
        comparison=done.whole(folders),
    )


def entries_of(
    path: Path, document: Mapping[str, Any], key: str | None, fired: FiredShot | None, comparison: Comparison
) -> tuple[Entry, ...]:
    """Explain the keys of a document that was read and made again.

    Raises
    ------
    ReadError
        If there is no such key, or the document has something else where a number or a name belongs.
    """
    try:
        return explained(document, key, fired)
    except LookupError as error:
        raise ReadError(str(error.args[0]), path=path) from error
    except (TypeError, AttributeError, ValueError) as error:
        raise ReadError(
            "this document has something else where a number or a name belongs",
            path=path,
            found=f"{len(comparison.differences)} differences to what comes again",
            remedy=f"see them with `recoil-daq explain {quoted(path)} --check`, or {ANEW}",
        ) from error


def folders_of(shots: str | Path | None) -> list[Path]:
    """Return the folder in which to look for shot files first; ReadError if there is no such folder."""
    if shots is not None and not Path(shots).is_dir():
        raise ReadError("no such folder", path=Path(shots), remedy="check --shots")
    return [] if shots is None else [Path(shots)]


def _outcome(found: Comparison | None, *, exact: bool) -> dict[str, Any]:
    """State what came of a comparison; None of one that could not be made."""
    differences = () if found is None else found.differences
    return {
        "again": found is not None and found.again,
        "tolerance": 0.0 if exact else ELSEWHERE,
        "numbers": None if found is None else found.numbers,
        "largest_relative": None if found is None else found.largest,
        "differing": None if found is None else len(differences),
        "differences": [one.to_json() for one in differences[:MOST_LISTED]],
        "drawings": [] if found is None else list(found.drawings),
        "not_compared": [] if found is None else [one.to_json() for one in found.not_compared],
    }


@dataclass(frozen=True, repr=False)
class CheckedReport:
    """A report that was checked.

    Attributes
    ----------
    report
        Path of the document: ``report.json``, a target's, or ``campaign.json``.
    shot
        Name of the shot, or of the campaign's rig; empty where the document cannot be read.
    exact
        Whether numbers had to come again to the last bit.
    comparison
        Comparison of all numbers of the report; None where it could not be made again.
    fault
        Sentence on why it could not be made again; empty if it could.
    """

    report: Path
    shot: str = ""
    exact: bool = False
    comparison: Comparison | None = None
    fault: str = ""

    @property
    def again(self) -> bool:
        """Whether everything comes again."""
        return self.comparison is not None and self.comparison.again

    def __repr__(self) -> str:
        came = self.fault or ("all again" if self.again else "differs")
        return f"CheckedReport({self.shot!r}: {came}, {self.report})"


@dataclass(frozen=True, repr=False)
class CheckedReports(Printed):
    """Reports of a folder that were checked, in the order of their names."""

    reports: tuple[CheckedReport, ...]

    @property
    def again(self) -> bool:
        """Whether every report comes again, with its tables, page and paper copy."""
        return all(one.again for one in self.reports)

    @property
    def faults(self) -> tuple[str, ...]:
        """The reasons why some could not be made again."""
        return tuple(one.fault for one in self.reports if one.fault)

    def to_json(self) -> dict[str, Any]:
        """Return the document that ``explain --check --json`` prints."""
        rows = [
            {
                "report": str(one.report),
                "shot": one.shot or None,
                **_outcome(one.comparison, exact=one.exact),
                "fault": one.fault or None,
            }
            for one in self.reports
        ]
        return {"schema": "recoil-daq/explain-check/1", "again": self.again, "reports": rows}

    def show(self) -> None:
        """Print a row a report, and what differs."""
        from recoil_daq.terminal.explanation import print_checked

        print_checked(self.to_json())

    def __repr__(self) -> str:
        count = sum(one.again for one in self.reports)
        return f"CheckedReports({count} of {len(self.reports)} reports come again)"
