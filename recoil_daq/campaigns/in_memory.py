"""Results in memory to one answer; nothing is read or written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import IdentificationError
from recoil_daq.reports.identify_folder import band_of, options_of_bands
from recoil_daq.reports.result import Result, identified_in_memory
from recoil_daq.version import __version__
from recoil_identification.campaign.campaign_shot import CampaignShot, alike
from recoil_identification.campaign.combination import combine, refuse_too_few
from recoil_identification.report.document.campaign_document import campaign_document
from recoil_identification.report.document.report_files import REPORT_FILE, SEAL
from recoil_identification.shot.identified import Options
from recoil_rigs.tables.issue import Issue


def split_results(shots: Iterable[str | Path | Result]) -> tuple[list[Result], list[Path]]:
    """Return the results in memory among the shots of a campaign, and the files.

    Raises
    ------
    TypeError
        If one is neither, or there are both.
    """
    results, places = [], []
    for one in shots:
        if isinstance(one, Result):
            results.append(one)
        elif isinstance(one, str | Path):
            places.append(Path(one))
        else:
            raise TypeError(f"shots must be files, folders or results of `identify`, not {type(one).__name__}")
    if results and places:
        raise TypeError("shots must be files and folders, or results in memory, not both: read the files, or save them")
    return results, places


def campaign_of_results(results: Sequence[Result]) -> dict[str, Any]:
    """Return the document of a campaign of results in memory.

    Results that were found with cut-offs of their own are found anew with one for all, chosen from the spectra of all,
    as a campaign of files does.

    Raises
    ------
    IdentificationError
        If the shots cannot be combined, or a result of another cut-off was read from its report.
    """
    refuse_too_few(len(results), str(len(results)))
    shared = _with_one_cutoff(results)
    combined = combine([CampaignShot.of_report(one.document) for one in shared])
    inputs = [{"file": f"{one.shot}/{REPORT_FILE}", "sha256": one.document["provenance"][SEAL]} for one in shared]
    issued = Issue.model_validate(alike([one.shot for one in combined.shots])).of_another()
    return campaign_document(combined, version=__version__, inputs=inputs, parameters={}, issued=issued)


def _with_one_cutoff(results: Sequence[Result]) -> list[Result]:
    cutoffs_hz = {(one.document.get("campaign") or {}).get("cutoff_hz") for one in results}
    if len(cutoffs_hz) == 1:
        return list(results)
    fired = [one.fired for one in results if one.fired is not None]
    if len(fired) < len(results):
        read = next(one.shot for one in results if one.fired is None)
        raise IdentificationError(
            f"shots were found with other cut-offs, and shot {read} was read from its report",
            expected="one cut-off for all shots",
            found=", ".join(sorted(f"{one:.4g} Hz" if one else "none" for one in cutoffs_hz)),
            remedy="identify the shots anew with Options(mass_cutoff_hz=..), or give campaign() the shot files",
        )
    options = options_of_bands([band_of(one) for one in fired], Options())
    return [identified_in_memory(one, its) for one, its in zip(fired, options, strict=True)]
