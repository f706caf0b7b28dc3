"""The running campaign: what the shots of a range day say together, after each of them, in the process that stays warm.

Its shots are identified once more with one cut-off for all, into ``OUT/campaign/reports``, as ``recoil-daq campaign``
does it; what was done after the last shot is not done again.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.shot.shot import InputFile
from recoil_daq.campaigns.campaign import REPORTS, current_reports
from recoil_daq.campaigns.sources import CampaignLogs, CampaignReport, SharedCutoff, Source
from recoil_daq.workers import Workers
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.combination import LEAST_SHOTS, combine
from recoil_identification.campaign.prediction import NominalShot, Plan, predicted_u_rel
from recoil_identification.report.document.report_files import REPORT_FILE

CAMPAIGN = "campaign"
"""Folder, in that of the shot files, of the reports with one cut-off."""
_MOST_SHOTS = 512


@on_one_thread
def running_campaign(task: tuple[Path, tuple[str, ...]]) -> dict[str, Any] | None:
    """Combine the shots of a folder that have a report there.

    Parameters
    ----------
    task
        Folder of the shot files, in whose ``reports`` the reports stand, and the names of the shots.

    Returns
    -------
    dict or None
        ``shots``, the names of those that were used; ``value``, ``u`` and ``U95``, kg, of the mechanism without what
        was added; ``changes``, a sentence each; ``valid`` and ``reason``; ``expected``, with ``shots`` and ``u`` in kg,
        for twice as many shots. None where fewer than two can be used.

    Raises
    ------
    RecoilDaqError
        As `recoil_daq.campaigns.campaign.campaign`.
    """
    out, names = task
    folder = out / CAMPAIGN
    sources = [_source(out / f"{name}.h5", (out / "reports", folder / REPORTS)) for name in names]
    if len(sources) < LEAST_SHOTS:
        return None
    whole, _ = current_reports(sources, SharedCutoff.read(folder), folder, None, Workers(1), lambda _: None)
    logs = CampaignLogs.of(None, sources)
    shots = [logs.applied(source, one.shot()) for source, one in zip(sources, whole, strict=True)]
    if sum(not shot.set_aside for shot in shots) < LEAST_SHOTS:
        return None
    combined = combine(shots)
    used = [one.shot.name for one in combined.shots if one.excluded is None]
    mass = combined.mass
    return {
        "shots": used,
        "value": mass.mass_kg,
        "u": mass.u_kg,
        "U95": list(mass.interval_kg),
        "changes": [str(change) for change in combined.changes],
        "valid": combined.valid,
        "reason": next(iter(combined.reasons), ""),
        "expected": _expected([shot for shot in shots if shot.name in used], 2 * len(used), mass.mass_kg),
    }


def _expected(shots: list[CampaignShot], number: int, mass_kg: float) -> dict[str, Any]:
    """Predict the campaign of so many shots like the last one."""
    last = shots[-1]
    if last.summary is None:
        raise ValueError(f"shot {last.name} has no summary")
    bare_kg = last.mass_kg - last.added_mass_kg
    nominal = NominalShot.of(bare_kg, last.added_mass_kg, last.summary)
    return {"shots": number, "u": mass_kg * predicted_u_rel([nominal], Plan(number))}


def _source(path: Path, reports: tuple[Path, ...]) -> Source:
    """Return a shot with its report: with that of one cut-off, where it is of this shot file."""
    sha256 = _digest(path, *_state(path))
    there = [at for folder in reversed(reports) if (at := folder / path.stem / REPORT_FILE).exists()]
    read = [_report(at, *_state(at)) for at in there]
    return Source(path, sha256, next((one for one in read if not one.why_not(sha256, None)), next(iter(read), None)))


def _state(path: Path) -> tuple[int, int, int]:
    """Return what differs of a file that was written anew."""
    state = path.stat()
    return state.st_mtime_ns, state.st_size, state.st_ino


@lru_cache(_MOST_SHOTS)
def _digest(path: Path, *_state: int) -> str:
    return InputFile.of(path).sha256


@lru_cache(_MOST_SHOTS)
def _report(path: Path, *_state: int) -> CampaignReport:
    return CampaignReport.read(path)
