"""Several shots of one rig together: one cut-off for all of them, their reports, and whether they repeat."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import IdentificationError, RecoilDaqError, StoreError
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.shot.quality_check import Verdict
from recoil_acquisition.shot.recorded_file import Double
from recoil_acquisition.store import shot_summary
from recoil_daq.recording.doubles import set_aside
from recoil_daq.reports.comparison import Beside
from recoil_daq.reports.identify import FILES, Reported, find_shot_files, write_report
from recoil_daq.reports.output import Output
from recoil_daq.reports.report_folder import refuse_existing
from recoil_daq.reports.stored_shot import read_stored
from recoil_daq.reports.targets import TargetReported, files_of, identify_targets
from recoil_daq.terminal.result import Progress
from recoil_daq.workers import Workers
from recoil_identification.campaign.peaks import fired_alike
from recoil_identification.report.results.shot_index import INDEX, row_of_report
from recoil_identification.shot.default_method import default_method
from recoil_identification.shot.filter_choice import campaign_band_hz, campaign_choice, force_band_hz, force_spectra
from recoil_identification.shot.identified import Options
from recoil_identification.shot.preparation import prepare
from recoil_processing.quality.repeatability import ShotPeaks, check_repeat_peaks
from recoil_processing.spectra.cutoff import CutoffChoice
from recoil_processing.spectra.spectral_gap import ShotSpectrum
from recoil_rigs.rig import find_rig
from recoil_rigs.shots.fired_shot import FiredShot

if TYPE_CHECKING:
    import pandas as pd

TOGETHER = ("shot", "rig", "mass", "E_n", "valid", "deviation", "reasons", "shot_log", "peak_acceleration")
"""Keys of a report by which several are judged and printed together."""
LEAST_SHOTS = 2
"""Number of shots from which on a cut-off is shared and repeatability judged: one shot is no campaign."""


def shared_options(
    paths: Sequence[Path],
    options: Options,
    *,
    rig: str | Path | None = None,
    workers: Workers | None = None,
    progress: Progress = lambda _: None,
) -> Mapping[Path, Options]:
    """Return the options of each shot file: with one cut-off for all shots of a rig, unless one is asked for.

    A rig with one shot, or none with a spectrum, leaves each shot to find its own.

    Parameters
    ----------
    options
        Options that were asked for.
    rig
        Corrected rig file, as `recoil_daq.reports.identify.identify_file` takes it; None if nothing is corrected.
    workers
        Workers that look at the shots; None to do it in this process.
    progress
        Function called with how many shots are done.

    Raises
    ------
    StoreError, ReadError, RigError
        If a shot file or the shot log cannot be read.
    """
    if len(paths) < LEAST_SHOTS or options.cutoff_hz is not None:
        return dict.fromkeys(paths, options)
    workers = workers or Workers(1)
    looked_at = workers.map(
        partial(shot_band, rig_file=_place(rig, workers)),
        [workers.place(path) for path in paths],
        [path.name for path in paths],
        progress=progress,
    )
    return dict(zip(paths, options_of_bands(list(looked_at), options), strict=True))


def options_of_bands(bands: Sequence[ShotBand], options: Options) -> list[Options]:
    """Return the options of shots with one cut-off for all of a rig, by the spectra of all."""
    chosen: dict[str, tuple[CutoffChoice | None, float | None]] = {}
    for rig in {band.rig for band in bands}:
        several = [band for band in bands if band.rig == rig and band.spectra is not None]
        if len(several) >= LEAST_SHOTS:
            choice = campaign_choice([band.spectra or {} for band in several])
            mass_hz = campaign_band_hz([band.band_hz for band in several if band.band_hz is not None], choice)
            chosen[rig] = choice, options.mass_cutoff_hz or mass_hz
    found = [chosen.get(band.rig, (None, options.mass_cutoff_hz)) for band in bands]
    return [replace(options, campaign=one, mass_cutoff_hz=mass_hz) for one, mass_hz in found]


@dataclass(frozen=True)
class ShotBand:
    """Spectrum of a shot, by which a common cut-off is chosen.

    Attributes
    ----------
    spectra
        Spectra of both sides of the equation of motion; None for a shot whose mass is the camera's, since a
        displacement has a low-pass of its own and no spectrum to choose it by, and for one that allows no mass.
    band_hz
        Band that the force fills, Hz; None where there are no spectra.
    """

    rig: str
    spectra: Mapping[str, ShotSpectrum] | None = None
    band_hz: float | None = None


@on_one_thread
def shot_band(path: Path, rig_file: str | Path | None = None) -> ShotBand:
    """Return what of a shot file a common cut-off is chosen by; errors as of `shared_options`."""
    return band_of(read_stored(path, rig_file, judge=False))


def band_of(fired: FiredShot) -> ShotBand:
    """Return what of a shot a common cut-off is chosen by."""
    rig_name = fired.shot.rig_name
    if default_method(fired) != "calibrated":
        return ShotBand(rig_name)
    try:
        recorded = prepare(fired).recorded
    except IdentificationError:
        # it has no say in the cut-off, and says why when it is identified itself
        return ShotBand(rig_name)
    return ShotBand(rig_name, force_spectra(recorded), force_band_hz(recorded))


@dataclass(frozen=True)
class Identified:
    """Result of one shot file.

    Attributes
    ----------
    report
        Report of the mass; None if that was not asked for.
    targets
        Findings of the other targets that were asked for.
    """

    report: Reported | None
    targets: tuple[TargetReported, ...]

    @property
    def folder(self) -> Path:
        """The folder that the report was written to."""
        return self.targets[0].folder if self.report is None else self.report.folder

    def at(self, folder: Path) -> Identified:
        """Return it with the folder as this process names it."""
        report = None if self.report is None else replace(self.report, folder=folder)
        return Identified(report, tuple(replace(one, folder=folder) for one in self.targets))


def outlined(report: Reported) -> Reported:
    """Return a report with what several are judged by alone: a season's reports as a whole would fill the memory."""
    return replace(report, document={key: report.document[key] for key in TOGETHER})


def identify_document(
    reports: Sequence[Reported],
    targets: Sequence[TargetReported] = (),
    *,
    repeats: Mapping[str, tuple[Verdict, str]],
    aside: Mapping[Path, Double],
    without_mass: Sequence[RecoilDaqError] = (),
    besides: Sequence[Beside] = (),
) -> dict[str, Any]:
    """Return the document of ``identify --json``.

    Parameters
    ----------
    repeats
        Verdicts of `repeatability`.
    aside
        Shot files that were not identified, each with what it has of another one.
    without_mass
        Errors of the shots that allow no mass.
    besides
        Pages on which new reports are laid beside others.
    """
    return {
        "schema": "recoil-daq/identify/1",
        "reports": [{"folder": str(r.folder), **r.document} for r in reports],
        "targets": [{"folder": str(t.folder), **t.document} for t in targets],
        "repeatability": [
            {"rig": rig, "verdict": verdict, "detail": detail} for rig, (verdict, detail) in repeats.items()
        ],
        "set_aside": [
            {"file": str(path), "of": one.of, "files": list(one.files), "detail": str(one)}
            for path, one in aside.items()
        ],
        "failed": [{"file": str(error.path), "error": str(error)} for error in without_mass],
        **({"beside": [one.to_json() for one in besides]} if besides else {}),
    }


@dataclass(frozen=True)
class _Task:
    """Work to be done on a shot file."""

    path: Path
    output: Output
    options: Options
    targets: tuple[str, ...]
    rig: Path | None

    def refuse_existing(self) -> None:
        names = [one for target in self.targets for one in (FILES if target == "mass" else files_of(target))]
        refuse_existing(self.output.out / str(shot_summary(self.path)["shot"]), names)

    def identified(self) -> Identified:
        report, others = None, [target for target in self.targets if target != "mass"]
        if "mass" in self.targets:
            report = write_report(self.path, self.output, options=self.options, rig=self.rig)
        found = []
        if others:
            found = identify_targets(self.path, others, self.output, options=self.options, rig=self.rig)
        return Identified(report, tuple(found))


def identify_shots(
    options: Mapping[Path, Options],
    output: Output,
    targets: Sequence[str] = ("mass",),
    *,
    rig: str | Path | None = None,
    workers: Workers | None = None,
    without_mass: Callable[[Path, IdentificationError], None] | None = None,
    progress: Progress = lambda _: None,
) -> Iterator[Identified]:
    """Identify shot files and write their reports; one after another is yielded, in the order of the files.

    A shot that allows no mass does not keep the others from theirs.

    Parameters
    ----------
    options
        Options of each shot file.
    targets
        Names of targets: ``mass``, or those of `recoil_identification.targets.target_names`.
    rig
        Corrected rig file, as `recoil_daq.reports.identify.identify_file` takes it; None if nothing is corrected.
    workers
        Workers that share the shots; None to do it in this process.
    without_mass
        Function called with each shot that allows no mass, and why; None to raise the first of these errors once the
        others are done.
    progress
        Function called with how many shots are done, and how long the others may take.

    Yields
    ------
    Identified

    Raises
    ------
    StoreError
        If two files are of shots with one name, or as `recoil_daq.reports.identify.identify_file`.
    RigError, WorkerError
        Of the first file at fault: the reports before it are written.
    IdentificationError
        Of the first shot that allows no mass, or target, once the reports of all others are written.
    """
    workers = workers or Workers(1)
    # a worker may do a shot again, and then finds what it wrote itself
    theirs = replace(output, out=workers.place(output.out), overwrite=output.overwrite or workers.may_repeat)
    tasks = [
        _Task(workers.place(path), theirs, one, tuple(targets), _place(rig, workers)) for path, one in options.items()
    ]
    names = [path.name for path in options]
    if workers.may_repeat and not output.overwrite:
        # before the first of them is done: a report that is there when one is done again is of this run
        list(workers.map(_Task.refuse_existing, tasks, names, progress=lambda done: progress(f"look, {done}")))
    written: dict[str, Path] = {}
    missed: list[IdentificationError] = []
    for path, done in zip(options, workers.outcomes(_Task.identified, tasks, names, progress=progress), strict=True):
        if isinstance(done, IdentificationError):
            done.path = done.path or path
            if without_mass is None:
                missed.append(done)
            else:
                without_mass(path, done)
            continue
        if isinstance(done, RecoilDaqError):
            raise done
        name = done.folder.name
        if name in written:
            raise StoreError(
                f"this file and {written[name]} are both of a shot {name!r}, and their reports would be one",
                path=path,
                remedy="give another --out for one of them",
            )
        written[name] = path
        yield done.at(output.out / name)
    if missed:
        raise missed[0]


class Reports(tuple[Reported, ...]):
    """Reports of several shots, in the order of their files."""

    @property
    def frame(self) -> pd.DataFrame:
        """One row a shot, as ``index.csv`` has it: mass, u, verdict, what the log says, peaks and their u."""
        import pandas as pd

        rows = [{**row_of_report(one.document), "report": str(one.folder)} for one in self]
        return pd.DataFrame(rows, columns=list(INDEX.cells))


def identify_folder(
    folder: str | Path,
    *,
    out: str | Path = "reports",
    options: Options | None = None,
    rig: str | Path | None = None,
    pdf: bool = False,
    figures: bool = False,
    standalone: bool = False,
    overwrite: bool = False,
    workers: int | Workers | None = None,
    executor: Executor | None = None,
    progress: Progress = lambda _: None,
) -> Reports:
    """Identify every shot file of a folder, with one cut-off for all shots of a rig unless one is asked for.

    A shot file that is made of recorded files of another is set aside.

    Parameters
    ----------
    out, options, rig, pdf, figures, standalone, overwrite
        Parameters as `recoil_daq.reports.identify.identify_file` takes them.
    workers, executor
        Workers that share the shots, as `recoil_daq.workers.Workers` takes them: the digits are the same, whoever does
        it.
    progress
        Function called with what is set aside, how many shots are done, and how long the others may take.

    Raises
    ------
    ReadError
        If the folder holds no shot file.
    StoreError, RigError, IdentificationError, WorkerError
        As `identify_shots`.
    """
    output = Output(Path(out), pdf, figures, standalone, overwrite)
    output.refuse_missing_extra()
    paths = find_shot_files([Path(folder)])
    aside = set_aside(paths)
    for path, double in aside.items():
        progress(f"{path} is set aside: {double}")
    paths = [path for path in paths if path not in aside]
    with Workers.of(workers, executor) as crew:
        shared = shared_options(paths, options or Options(), rig=rig, workers=crew, progress=progress)
        done = identify_shots(shared, output, rig=rig, workers=crew, progress=progress)
        return Reports(one.report for one in done if one.report is not None)


def _place(rig: str | Path | None, workers: Workers) -> Path | None:
    """Return the path of a rig file, or of a bundled rig, as the workers are told it."""
    return None if rig is None else workers.place(find_rig(str(rig)))


def repeatability(documents: Sequence[Mapping[str, Any]]) -> dict[str, tuple[Verdict, str]]:
    """Judge, for shots of each kind, whether the rigid body's peak repeats from shot to shot.

    Shots are of one kind that are of one rig, configuration, added mass and charge, as the shot log has them: another
    mass or charge has another peak. Those that are not valid, or excluded, are not compared.

    Parameters
    ----------
    documents
        Contents of the shots' ``report.json``.

    Returns
    -------
    dict of str to (verdict, detail)
        Verdicts on kinds of at least two shots; keys are rigs' names, with the kind where a rig's shots are of several.
    """
    peaks: dict[tuple[str, str], list[ShotPeaks]] = {}
    for d in documents:
        figures, row = d["peak_acceleration"], d.get("shot_log") or {}
        # a camera's shot recorded none
        if figures["recorded_m_s2"] is None or row.get("exclude") or not d.get("valid", True):
            continue
        one = ShotPeaks(d["shot"], figures["recorded_m_s2"], figures["filtered_m_s2"])
        peaks.setdefault((d["rig"], fired_alike(row)), []).append(one)
    rigs = [rig for rig, _ in peaks]
    return {
        rig if rigs.count(rig) == 1 else f"{rig}, {kind}": check_repeat_peaks(shots)
        for (rig, kind), shots in peaks.items()
        if len(shots) >= LEAST_SHOTS
    }
