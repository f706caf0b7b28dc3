"""A shot in memory to its mass and all that is said of it, and a report that was written, read again."""

from __future__ import annotations

import hashlib
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.strict_json import told_in_one_line
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.packages.extras import NOTEBOOK
from recoil_acquisition.shot.shot import InputFile, Shot
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from recoil_acquisition.store.shot_log_row import ShotLogRow
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.identify import FILES, report_pages, reported
from recoil_daq.reports.output import Output
from recoil_daq.reports.stored_shot import StoredShot, fired_in_memory
from recoil_daq.reports.targets import find_target
from recoil_daq.terminal.result import OfShot
from recoil_identification.report.document.report_files import (
    CURVES_FILE,
    LARGEST_CURVES,
    LARGEST_TRACE,
    REPORT_FILE,
    TRACE_FILE,
    read_curves,
    read_document,
    read_trace,
    write_document,
    write_files,
)
from recoil_identification.report.document.spreadsheet import write_workbook
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import TargetResult
from recoil_rigs.rig import Rig, load_rig
from recoil_rigs.tables.specification import mass_decimals

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

IN_MEMORY = "in memory"
"""Reader of a shot that was identified without a file, among the inputs of its report."""
SHEETS = ("mass", "peaks", "budget", "trace", "curves", "methods", "correlation", "findings")
"""Sheets of a workbook, in their order."""


@dataclass(frozen=True, repr=False)
class Result(OfShot):
    """A mass of one shot and all that is said of it, as a report has it.

    Attributes
    ----------
    texts
        Texts of the files that stand beside ``report.json``, by name.
    found
        Identification of the shot; None of a report that was read.
    fired
        Shot, its rig and what was added to it; None of a report that was read.
    targets
        Findings of the targets that were asked for, by name.
    """

    texts: Mapping[str, str]
    found: Identification | None = None
    fired: StoredShot | None = None
    targets: Mapping[str, TargetResult] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def trace(self) -> pd.DataFrame:
        """Mass over time: ``time_s``, ``mass_kg`` and ``u_kg`` (NaN where not identified), ``identified``."""
        table = _table(self.texts.get(TRACE_FILE, ""))
        return table.astype({"identified": bool}) if "identified" in table else table

    @property
    def curves(self) -> pd.DataFrame:
        """Thin curves of the shot over the time after the onset of force, SI."""
        return _table(self.texts.get(CURVES_FILE, ""))

    @property
    def budget(self) -> pd.DataFrame:
        """The uncertainty budget, the largest contribution first: ``source``, ``u_kg``, ``group``, ``scope``, ..."""
        return _rows(self.document["budget"])

    @property
    def methods(self) -> pd.DataFrame:
        """Masses by every method: ``name``, ``mass_kg``, ``u_kg``, ``rpe_percent``, ..."""
        return _rows(self.document["methods"])

    @property
    def correlation(self) -> pd.DataFrame:
        """The largest correlations of the estimated quantities: ``one``, ``other``, ``r``."""
        return _rows(self.document.get("correlations", ()), ("one", "other", "r"))

    def plot(self) -> Figure:
        """Draw the mass over time, the mass with its 95 % interval and the specification, by matplotlib.

        Raises
        ------
        StoreError
            If matplotlib is not installed.
        """
        try:
            from matplotlib.figure import Figure
        except ImportError as error:
            raise StoreError("a plot needs matplotlib", remedy=NOTEBOOK.remedy) from error
        trace, (low, high) = self.trace, self.interval_kg
        figure = Figure(figsize=(8.0, 4.0), layout="constrained")
        axes = figure.subplots()
        t = 1e3 * trace["time_s"]
        axes.fill_between(t, trace["mass_kg"] - trace["u_kg"], trace["mass_kg"] + trace["u_kg"], alpha=0.3, lw=0)
        axes.plot(t, trace["mass_kg"], lw=1.0, label="mass over time, with u")
        axes.axhspan(low, high, color="0.85", zorder=0, label="mass, 95 %")
        axes.axhline(self.mass_kg, color="black", lw=1.0)
        axes.axhline(self.document["mass"]["specification"], color="black", lw=1.0, ls="--", label="specification")
        axes.set(xlabel="time / ms", ylabel="mass / kg")
        axes.set_title(f"shot {self.shot}{'' if self.valid else ', NOT VALID'}", loc="left")
        axes.legend(frameon=False)
        return figure

    def save(self, folder: str | Path, *, overwrite: bool = False) -> Path:
        """Write the report into a folder, as the command does, and return the folder.

        Raises
        ------
        ValueError
            If it was read: it stands in its folder already.
        StoreError
            If a report is there, or it cannot be written.
        """
        if self.found is None:
            raise ValueError("this report was read: copy its folder")
        place = Path(folder)
        output = Output(place.parent, overwrite=overwrite)
        output.refuse_unwritable(place, FILES)
        pages = report_pages(self.document, output.forms, self.found)

        def write(partial: Path) -> None:
            write_document(partial, self.document)
            write_files(partial, self.texts)

        output.publish(place, pages, write)
        return place

    def to_excel(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write mass, peaks, budget, trace, curves, methods, correlations and findings into a workbook, a sheet each.

        Raises
        ------
        StoreError
            If the file exists, cannot be written, or openpyxl is not installed.
        """
        import pandas as pd

        place = Path(path)
        head = {key: value for key, value in self.document["mass"].items() if not isinstance(value, dict | list)}
        low, high = self.interval_kg
        head |= {"U95 low": low, "U95 high": high, "valid": self.valid, "shot": self.shot, "rig": self.document["rig"]}
        tables = (
            pd.DataFrame({"key": list(head), "value": list(head.values())}),
            self.peaks, self.budget, self.trace, self.curves, self.methods, self.correlation, _rows(self.findings),
        )  # fmt: skip
        write_workbook(place, dict(zip(SHEETS, tables, strict=True)), overwrite=overwrite)
        return place

    def show(self) -> None:
        """Print the mass, its methods, and what speaks against it."""
        from recoil_daq.terminal.report import print_report

        print_report(self.document, None)

    def __repr__(self) -> str:
        verdict, places = "valid" if self.valid else "not valid", mass_decimals(self.u_kg)
        return f"Result({self.shot!r}: {self.mass_kg:.{places}f} kg, u {self.u_kg:.{places}f} kg, {verdict})"


@on_one_thread
def identify(
    shot: Shot,
    rig: Rig | str | Path | None = None,
    options: Options | None = None,
    targets: Sequence[str] = (),
    *,
    added_mass_kg: float | None = None,
    u_added_mass_kg: float | None = None,
    log: str | Path | None = None,
    header: str | Path | None = None,
) -> Result:
    """Identify the mass of a shot in memory; nothing is written.

    The specification is the rig's, with what was added for the shot, as it is given here or stands in a shot log.

    Parameters
    ----------
    shot
        Shot that was read, or made of one that was: channels may be filtered, scaled or left out.
    rig
        Rig, or its file, that corrects the shot's own: calibrations, and values of the mechanism. None for its own.
    options
        Options of the command; None for its defaults.
    targets
        Names of `recoil_identification.targets.target_names` to be identified beside the mass.
    added_mass_kg, u_added_mass_kg
        Mass that was added to the recoiling part, negative if some was taken off, and its standard uncertainty; None
        if nothing was added, or where the uncertainty is not known.
    log
        Shot log that says it, a file or the folder of ``shotlog.csv``; None for none.
    header
        Header file with the identity of the report, the keys of a rig's ``[report]``, which goes before the rig's.

    Raises
    ------
    TypeError
        If the shot is a path, or an added mass no number.
    ValueError
        If a target is unknown, the added mass is not finite, or it is given beside a log.
    ReadError
        If the log or the header is at fault, or the log has no row of the shot.
    RigError
        If the shot's rig is at fault, or the corrected one differs by more than corrections.
    IdentificationError
        If no number can be given at all.
    """
    if not isinstance(shot, Shot):
        raise TypeError(f"shot must be a Shot, as read_shot(..) returns it, not {type(shot).__name__}")
    corrected = load_rig(rig) if isinstance(rig, str | Path) else rig
    row = _row_of(shot.name, added_mass_kg, u_added_mass_kg, None if log is None else Path(log))
    fired = fired_in_memory(shot, corrected, row, None if header is None else Path(header))
    return identified_in_memory(fired, options or Options(), targets)


def identified_in_memory(fired: StoredShot, options: Options, targets: Sequence[str] = ()) -> Result:
    """Identify a shot as it was fired; errors as of `identify`."""
    found = identify_shot(fired, options)
    document, texts = reported(fired, found, _described(fired.shot), forms=Forms.now())
    case = Case(fired, options).with_agreeing_gauges() if targets else None
    beside = {} if case is None else {name: find_target(name, fired, case) for name in targets}
    return Result(document, texts, found, fired, MappingProxyType(beside))


def _row_of(shot: str, added_kg: float | None, u_added_kg: float | None, log: Path | None) -> ShotLogRow | None:
    """Return what is said of a shot, by its caller or a log; None if nothing is."""
    stated = {"added_mass_kg": added_kg, "u_added_mass_kg": u_added_kg}
    for name, value in stated.items():
        if not isinstance(value, int | float | None):
            raise TypeError(f"{name} must be a number, not {value!r}")
        if value is not None and not math.isfinite(value):
            raise ValueError(f"{name} must be finite, not {value}")
    if u_added_kg is not None and not u_added_kg >= 0:
        raise ValueError(f"u_added_mass_kg must not be negative, not {u_added_kg}")
    if log is not None:
        if added_kg is not None or u_added_kg is not None:
            raise ValueError("added_mass_kg and log both say what was added: give one of them")
        path = log / SHOT_LOG if log.is_dir() else log
        row = ShotLog.read(path, [shot]).row(shot) if path.exists() else None
        if row is None:
            missing = f"no row of shot {shot!r}" if path.exists() else "no such file"
            raise ReadError(missing, path=path, remedy="give the log that has one, or added_mass_kg=")
        return row
    if added_kg is None and u_added_kg is None:
        return None
    row = ShotLogRow(shot, added_mass_kg=added_kg or 0.0)
    return row if u_added_kg is None else replace(row, u_added_mass_kg=u_added_kg, u_added_mass_stated=True)


def read_report(path: str | Path) -> Result:
    """Read a report that was written, by its folder or its ``report.json``.

    Raises
    ------
    ReadError
        If it is no report, has something else where a number or a text belongs, or a file beside it is none.
    """
    place = Path(path)
    folder = place if place.is_dir() else place.parent
    place = folder / REPORT_FILE if place.is_dir() else place
    document = read_document(place)
    texts = {}
    for name, largest in ((TRACE_FILE, LARGEST_TRACE), (CURVES_FILE, LARGEST_CURVES)):
        if (folder / name).exists():
            texts[name] = read_small(folder / name, largest, "a report's table").decode("utf-8", "replace")
    read_trace(folder)
    read_curves(folder)
    found = Result(document, texts)
    with told_in_one_line("this report cannot be shown", place, remedy="identify the shot anew"):
        # what it is asked for later would fail in the middle of a script
        str(found), found.interval_kg, found.reasons, found.findings
        for key in ("budget", "methods", "correlations"):
            [dict(row) for row in document.get(key, ())]
    return found


def _described(shot: Shot) -> InputFile:
    """Describe a shot in memory by a digest of its rig, samples and instants."""
    digest, size = hashlib.sha256(shot.rig_text.encode("utf-8")), 0
    for name, channel in shot.channels.items():
        for part in (name.encode("utf-8"), channel.samples.tobytes(), channel.time_base.times_s.tobytes()):
            digest.update(part)
        size += channel.samples.nbytes
    return InputFile(shot.name, digest.hexdigest(), size, "", IN_MEMORY)


def _table(text: str) -> pd.DataFrame:
    import pandas as pd

    return pd.read_csv(io.StringIO(text)) if text else pd.DataFrame()


def _rows(rows: Sequence[Mapping[str, Any]], columns: Sequence[str] = ()) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame([dict(row) for row in rows], columns=list(columns) or None)
