"""Reports of the shots of a campaign, as far as a campaign reads them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from recoil_daq import __version__
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.report.document.report_files import sealed


def write_report(folder: Path, shot: CampaignShot, **changes: Any) -> None:
    """Write the report of a shot into ``folder/<shot>``; `changes` go before its keys."""
    assert shot.summary is not None
    document = {
        "schema": "recoil-daq/report/1",
        "shot": shot.name,
        "rig": shot.rig,
        "started": None,
        "mass": {
            "value": shot.mass_kg,
            "u": shot.u_kg,
            "specification": 900.0 + shot.added_mass_kg,
            "u_specification": 0,
        },
        "rpe_percent": None,
        "valid": True,
        "reasons": [],
        "campaign": shot.summary.to_json(cutoff_hz=300.0, zero_shift=False),
        "shot_log": {"added_mass_kg": shot.added_mass_kg, "charge": "full"},
        "provenance": {"version": __version__, "inputs": [{"file": "a shot", "sha256": "0" * 64}], "parameters": {}},
        **changes,
    }
    (folder / shot.name).mkdir(parents=True)
    (folder / shot.name / "report.json").write_text(json.dumps(sealed(document)), encoding="utf-8")


def write_reports(folder: Path, shots: Sequence[CampaignShot], **changes: Any) -> Path:
    """Write the reports of several shots into a folder, which is returned."""
    for shot in shots:
        write_report(folder, shot, **changes)
    return folder
