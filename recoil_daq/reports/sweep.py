"""A shot identified at each of several values of one option: whether its mass hangs on the choice."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import IdentificationError, RecoilDaqError
from recoil_acquisition.files.regular_file import read_beginning, read_small
from recoil_acquisition.files.strict_json import told_in_one_line
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.packages.extras import PDF
from recoil_acquisition.quantities.typed_quantity import typed_quantity
from recoil_acquisition.shot.shot import InputFile
from recoil_daq.reports.output import Output, Pages
from recoil_daq.reports.stored_shot import read_stored
from recoil_daq.terminal.result import PagedDocument, Progress
from recoil_daq.version import __version__
from recoil_identification.report.content.result_table import Row
from recoil_identification.report.document.document import provenance_inputs
from recoil_identification.report.document.report_files import (
    LARGEST_REPORT,
    computer,
    json_bytes,
    of_schema,
    seal_fault,
    write_files,
)
from recoil_identification.report.document.reproduction import Comparison, Difference, NotCompared
from recoil_identification.report.page.html import render_results_page
from recoil_identification.report.paper.paper import sweep_pdf
from recoil_identification.report.results.sweep import (
    OPTIONS,
    SCHEMA,
    SWEEP,
    found_row,
    stem,
    sweep_document,
    sweep_figures,
)
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.tables.issue import NOTHING_STATED

if TYPE_CHECKING:
    import pandas as pd

ENDINGS = ("html", "json", "csv", "pdf")
"""Endings of the files of a sweep."""
MOST_VALUES = 200
"""Number of values of one sweep: each is a whole identification."""


@dataclass(frozen=True)
class Sweep:
    """Values that an option is given one after another.

    Attributes
    ----------
    key
        Option, one of `OPTIONS`.
    values
        Values in ascending order, in the option's unit.
    """

    key: str
    values: tuple[float, ...]

    @classmethod
    def of(cls, text: str) -> Sweep:
        """Read ``KEY=LO:HI:STEP``; both ends belong to it, as far as steps reach them.

        >>> Sweep.of("window_s=0.01:0.03:0.01").values
        (0.01, 0.02, 0.03)

        Raises
        ------
        ValueError
            If it is none.
        """
        key, _, span = text.partition("=")
        if key not in OPTIONS:
            raise ValueError(f"{text!r} sweeps none of {', '.join(OPTIONS)}: it is KEY=LO:HI:STEP")
        try:
            # as they are written: steps of 0.1 would not meet their end
            low, high, step = (Decimal(repr(typed_quantity(one, OPTIONS[key][1]))) for one in span.split(":"))
        except ValueError as error:
            raise ValueError(f"{text!r} is not KEY=LO:HI:STEP: {error}") from error
        if not 0 < low <= high or step <= 0:
            raise ValueError(f"{text!r} is not KEY=LO:HI:STEP with 0 < LO <= HI and STEP > 0")
        if high - low >= MOST_VALUES * step:
            raise ValueError(f"{text!r} has more than {MOST_VALUES} values, each a whole identification")
        count = int((high - low) / step) + 1
        values = tuple(float(low + k * step) for k in range(count))
        return cls(key, values)


@dataclass(frozen=True, repr=False)
class Swept(PagedDocument):
    """A shot identified at each value of a sweep, and where that was written.

    Attributes
    ----------
    document
        Contents of the JSON file.
    page
        Page; the JSON file and the table (CSV) stand beside it under the same name.
    """

    @property
    def moves(self) -> bool | None:
        """Whether the mass moves by more than its u; None where no value allows a mass."""
        moved: bool | None = self.document["moves"]
        return moved

    @property
    def valid(self) -> bool:
        """Whether the mass by the shot's own options is valid."""
        return bool(self.document["own"]["valid"])

    @property
    def rows(self) -> pd.DataFrame:
        """One row a value, that of the shot's own options first, as the CSV file."""
        return SWEEP.frame(self.document)

    def show(self) -> None:
        """Print a row a value, whether the mass moves, and where the page is."""
        from recoil_daq.terminal.report import print_results

        d = self.document
        title = f"Shot {d['shot']} on rig {d['rig']}: {d['option']}"
        print_results(title, SWEEP, d, d["detail"], f"-> {self.page}", value=d["key"])

    def __repr__(self) -> str:
        return f"Swept({self.document['shot']!r}, {self.document['key']}: {self.document['detail']} -> {self.page})"


@on_one_thread
def sweep_shot(
    path: str | Path,
    sweep: str | Sweep,
    *,
    out: str | Path = "reports",
    options: Options | None = None,
    rig: str | Path | None = None,
    pdf: bool = False,
    standalone: bool = False,
    overwrite: bool = False,
    header: str | Path | None = None,
    progress: Progress = lambda _: None,
) -> Swept:
    """Identify a shot file at each value of one option, and write a page, a JSON file and a table into ``out/<shot>``.

    Parameters
    ----------
    sweep
        Option and values: ``cutoff_hz=150:600:50``.
    options
        Options of the shot's own row, with which the others are compared; the others differ from it in one value.
    rig, pdf, standalone, overwrite, header
        Parameters as `recoil_daq.reports.identify.identify_file` takes them.
    progress
        Function called with which value is under way.

    Raises
    ------
    ValueError
        If the text is no sweep.
    StoreError, ReadError, RigError
        As `recoil_daq.reports.identify.identify_file`.
    IdentificationError
        If the shot's own options allow no mass; a value that allows none is a row that says why.
    """
    swept, own = sweep if isinstance(sweep, Sweep) else Sweep.of(sweep), options or Options()
    output = Output(
        Path(out), pdf, standalone=standalone, overwrite=overwrite, header=None if header is None else Path(header)
    )
    output.refuse_missing_extra()
    progress("read")
    fired = read_stored(Path(path), rig, header=output.header)
    folder = output.out / fired.shot.name
    name = stem(swept.key)
    page, data, table, paper = (f"{name}.{ending}" for ending in ENDINGS)
    output.refuse_unwritable(folder, (page, data, table, paper))
    specification_kg = 0.0

    def each() -> Iterator[tuple[float | None, Row | str]]:
        nonlocal specification_kg
        progress("its own options")
        found = identify_shot(fired, own)
        specification_kg = found.specification.mass_kg
        yield None, found_row(found)
        for number, value in enumerate(swept.values):
            progress(f"{number + 1} of {len(swept.values)}, {swept.key} {value:g}")
            change: dict[str, Any] = {swept.key: value}
            try:
                yield value, found_row(identify_shot(fired, replace(own, **change)))
            except IdentificationError as error:
                yield value, error.without_path()

    rows = dict(each())
    document = sweep_document(
        swept.key, rows, shot=fired.shot.name, rig=fired.shot.rig_name, specification_kg=specification_kg,
        version=__version__, inputs=provenance_inputs(fired.shot, InputFile.of(Path(path)), fired.beside),
        options=own.to_json(), issued=fired.issued.to_json() if fired.issued != NOTHING_STATED else None,
    )  # fmt: skip
    drawn = sweep_figures(document)
    # of the folder's other files none is the sweep's, and so none goes with it
    html = render_results_page(document, drawn, standalone=standalone)
    pages = Pages(page, html, paper, sweep_pdf(document, drawn) if pdf else None, drawn, f"{name}-")

    def write(partial: Path) -> None:
        (partial / data).write_bytes(json_bytes(document))
        write_files(partial, {table: SWEEP.csv(document)})

    output.publish(folder, pages, write)
    return Swept(document, folder / page)


@on_one_thread
def sweeps_again(folder: Path) -> tuple[Comparison, set[str]]:
    """Draw the sweeps of a folder again from their JSON files, and compare their pages and tables byte by byte.

    Returns
    -------
    Comparison
        With the names of those that hold what they should.
    set of str
        Names of all files of sweeps.
    """
    stems = [stem(key) for key in OPTIONS if (folder / f"{stem(key)}.json").is_file()]
    whole = Comparison.of(found for one in stems for found in _again(folder, one))
    names = {f"{one}.{ending}" for one in stems for ending in ENDINGS}
    return whole, {name for name in names if (folder / name).is_file()}


def _again(folder: Path, name: str) -> Iterator[Difference | NotCompared | str]:
    page, path, table, paper = (folder / f"{name}.{ending}" for ending in ENDINGS)
    try:
        with told_in_one_line("this is no sweep that can be drawn again", path):
            document = of_schema(read_small(path, LARGEST_REPORT, "a sweep"), SCHEMA)
            fault, drawn = seal_fault(document), sweep_figures(document)
            pages = [render_results_page(document, drawn, standalone=alone).encode() for alone in (False, True)]
            files = {page: pages, table: [SWEEP.csv(document).encode()]}
            if paper.is_file() and PDF.is_installed:
                files[paper] = [sweep_pdf(document, drawn)]
            here = (document["provenance"]["version"], document["provenance"]["computer"]) == (__version__, computer())
    except RecoilDaqError as error:
        yield NotCompared(path.name, str(error), stated=False)
        return
    if fault:
        yield Difference(f"the digest of {path.name}", "that of its content", "another")
    for one, may in files.items():
        if one.is_file() and read_beginning(one, max(map(len, may)) + 1) in may:
            yield one.name
        elif here:
            yield Difference(one.name, "a file", "another file")
        else:
            elsewhere = "it was drawn by another version, or on another kind of computer"
            yield NotCompared(one.name, elsewhere, stated=False)
