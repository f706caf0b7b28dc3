"""The page of a day at the range: its shots, their campaign, the shot log, what was lost, and what to copy."""

from __future__ import annotations

import contextlib
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import RecoilDaqError, StoreError, quoted
from recoil_acquisition.files.new_file import give_name, partial_path
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from recoil_daq.campaigns.campaign import REPORTS, campaign
from recoil_daq.campaigns.running import CAMPAIGN
from recoil_daq.handover.day_files import DayFiles
from recoil_daq.reports.report_folder import way_to_page
from recoil_daq.reports.shot_index import listed
from recoil_daq.terminal.result import PagedDocument, Progress
from recoil_identification.campaign.combination import LEAST_SHOTS
from recoil_identification.report.document.campaign_document import CAMPAIGN_FILE
from recoil_identification.report.page.html import CAMPAIGN_PAGE, DAY_PAGE, render_results_page
from recoil_identification.report.results.day import SCHEMA, day_document
from recoil_rigs.tables.specification import mass_decimals

DAY_FILE = "day.json"
_LARGEST = 1 << 26


@dataclass(frozen=True, repr=False)
class Day(PagedDocument):
    """A day that is handed over, and its page, ``day.html``; ``day.json`` stands beside it."""

    @property
    def valid(self) -> bool:
        """Whether every shot that is not excluded has a valid mass."""
        return all(one["valid"] for one in self.document["shots"] if not one["exclude"])

    def show(self) -> None:
        """Print a row a shot, what was lost, what to copy, and where the page is."""
        from recoil_daq.terminal.handover import print_day

        print_day(self.to_json())

    def __repr__(self) -> str:
        return f"Day({len(self.document['shots'])} shots, {len(self.document['lost'])} losses -> {self.page})"


def make_day(folder: str | Path, *, overwrite: bool = False, progress: Progress = lambda _: None) -> Day:
    """Write the page of a day into the folder of its shot files.

    Where two shots or more have a shot file and nobody combined them into ``campaign``, they are combined there, as
    ``recoil-daq campaign`` does it; an answer that this function made is made again, anybody else's is left.

    Parameters
    ----------
    folder
        Folder of the shot files: the ``--out`` of ``recoil-daq ingest``.
    overwrite
        Whether a page that is there is replaced.
    progress
        Function called with each step.

    Raises
    ------
    ReadError
        If there is no such folder, or no shot in it.
    StoreError
        If the page is there already, or cannot be written; nothing of it is left then.
    """
    out = Path(folder)
    DayFiles.of(out)
    before = _made_before(out)
    if not overwrite:
        for name in (DAY_PAGE, DAY_FILE):
            if (out / name).exists():
                raise StoreError.exists(out / name, "give --overwrite, or remove it", "the page of the day")
    progress("campaign")
    together, sha256 = _combined(out, before, progress)
    index, _ = listed([out], out, progress)
    log = ShotLog.read(out / SHOT_LOG)
    rows = [[log.cells(row.shot).get(name, "") for name in log.columns] for row in log.rows]
    progress("what was lost")
    files = DayFiles.of(out)
    document = day_document(
        index, campaign=together, log={"columns": list(log.columns), "rows": rows}, lost=files.lost(),
        copied=files.copied(), archive=f"recoil-daq pack {quoted(out.absolute())}",
    )  # fmt: skip
    document["provenance"] = {**document["provenance"], "campaign_sha256": sha256}
    progress("page")
    _write(out, {DAY_PAGE: render_results_page(document), DAY_FILE: json.dumps(document, indent=1) + "\n"})
    return Day(document, out / DAY_PAGE)


def day_page(out: Path) -> str:
    """Make the page of a day anew at the end of a live session, and return its path: it is the session's own."""
    return str(make_day(out, overwrite=True).page)


def _made_before(out: Path) -> str | None:
    """Return the digest of the campaign's answer that was made with the page that is there; None if there is none."""
    try:
        document = read_json(read_small(out / DAY_FILE, _LARGEST, "the page of a day"))
        return str(document["provenance"]["campaign_sha256"]) if document["schema"] == SCHEMA else None
    except (RecoilDaqError, ValueError, LookupError, TypeError, RecursionError):
        return None


def _combined(out: Path, before: str | None, progress: Progress) -> tuple[dict[str, Any], str | None]:
    """Return what the shots say together with its page, and the digest of the answer if it was made here."""
    folder, answer = out / CAMPAIGN, out / CAMPAIGN / CAMPAIGN_FILE
    shots = sorted(out.glob("*.h5"))
    own = not answer.exists() or _sha256(answer) == before
    if own and len(shots) < LEAST_SHOTS:
        return {"text": "", "page": None}, None
    try:
        if own:
            made = campaign(shots, reports=out / REPORTS, out=folder, overwrite=True, progress=progress)
            document = made.document
        else:
            document = read_json(read_small(answer, _LARGEST, "the answer of a campaign"))
        text = _together(document)
    except (RecoilDaqError, ValueError, LookupError, TypeError) as error:
        return {"text": f"the shots have no mass together: {error}", "page": None}, None
    page = way_to_page(out, folder, CAMPAIGN_PAGE)
    return {"text": text, "page": page}, _sha256(answer) if own else None


def _together(document: dict[str, Any]) -> str:
    mass = document["mass"]
    low, high = mass["U95"]
    places = mass_decimals(mass["u"], 1)
    text = f"{len(document['shots'])} shots together: {mass['value']:.{places}f} kg, 95 % {low:.{places}f} to "
    text += f"{high:.{places}f} kg, {'valid' if document['valid'] else 'NOT VALID'}"
    return f"{text}: {document['reasons'][0]}" if document["reasons"] else text


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _write(out: Path, texts: dict[str, str]) -> None:
    """Write files that appear whole, or not at all; StoreError if they cannot be written."""
    partials = {partial_path(out / name): (out / name, text) for name, text in texts.items()}
    try:
        for partial, (_, text) in partials.items():
            partial.write_text(text, encoding="utf-8", newline="\n")
        for partial, (path, _) in partials.items():
            give_name(partial, path, overwrite=True)
    except OSError as error:
        raise StoreError(
            f"cannot be written: {error.strerror or error}", path=out / DAY_PAGE, remedy="check space and permissions"
        ) from error
    finally:
        for partial in partials:
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)
