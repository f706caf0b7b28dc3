"""The machine-readable result of a target: ``<target>.json`` and ``<target>.csv``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.measured import beside as figures_beside
from recoil_acquisition.remark import Remark, findings_of
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.shot import InputFile, Shot
from recoil_acquisition.store.shot_log_row import ShotLogRow
from recoil_identification.estimate.conformity import stated_conformity
from recoil_identification.report.document.document import outputs_of, provenance_inputs, started
from recoil_identification.report.document.report_files import DRAWN, computer, json_bytes, sealed, stated, to_json
from recoil_identification.report.document.traceability import channels_of, constants_of, rig_of
from recoil_identification.shot.identified import Options
from recoil_identification.targets.target_result import Quantity, Series, TargetResult
from recoil_rigs.rig import Rig
from recoil_rigs.shots.rig_correction import Correction
from recoil_rigs.tables.issue import NOTHING_STATED, Issue

SCHEMA = "recoil-daq/target/1"


def target_document(
    shot: Shot,
    found: TargetResult,
    *,
    version: str,
    shot_file: InputFile,
    row: ShotLogRow | None = None,
    beside: Sequence[InputFile] = (),
    corrections: Sequence[Correction] = (),
    rig: Rig | None = None,
    issued: Issue = NOTHING_STATED,
    rig_text: str | None = None,
    options: Options | None = None,
    files: Mapping[str, str] | None = None,
    drawn: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Build the document of one target of one shot, JSON types only.

    Parameters
    ----------
    version
        Version of the package.
    shot_file
        The shot file itself, for the provenance.
    row, beside, corrections, rig, issued, rig_text, files, drawn
        Arguments of `recoil_identification.report.document.document.report_document`.
    options
        Options with which the target was identified; None for the usual ones.

    Returns
    -------
    dict
        Keys as published in the README; numbers that are not finite are null.
    """
    series = None
    if found.series is not None:
        series = {"file": series_file(found.target), "columns": list(found.series.columns)}
    document = {
        "schema": SCHEMA,
        **stated(found, "target", "title", "summary"),
        **figures_beside(found.summary),
        "shot": shot.name,
        "rig": shot.rig_name,
        **started(shot),
        "shot_log": None if row is None else row.to_json(),
        "corrections": [one.to_json() for one in corrections],
        "quantities": [_quantity(one) | _conformity(one, issued, rig, valid=found.valid) for one in found.quantities],
        "series": series,
        "tables": [
            {"title": t.title, "caption": t.caption, "columns": list(t.columns), "rows": [list(r) for r in t.rows]}
            for t in found.tables
        ],
        "valid": found.valid,
        "reasons": list(found.reasons),
        "notes": list(found.notes),
        "findings": findings_of(found.reasons, _dated(shot), found.notes),
        "issued": issued.to_json(),
        "channels": [] if rig is None else channels_of(shot, rig),
        "constants": [] if rig is None else constants_of(rig),
        "provenance": {
            "version": version,
            "computer": computer(),
            "inputs": provenance_inputs(shot, shot_file, beside),
            "outputs": outputs_of(files or {}),
            **({} if drawn is None else {DRAWN: dict(drawn)}),
            "rig": rig_of(shot),
            "corrected_rig": rig_text,
            "options": (options or Options()).to_json(),
            "parameters": dict(found.parameters),
        },
    }
    return sealed(to_json(document))


def _dated(shot: Shot) -> list[Remark]:
    """Name the calibrations that do not cover the day of the shot."""
    return [one.remark() for one in shot.quality if one.check is Check.CALIBRATION and one.verdict == "warn"]


def _quantity(one: Quantity) -> dict[str, Any]:
    return {
        **stated(one, "symbol", "name", "value"),
        "u": one.u if one.identified else math.nan,
        "U95": list(one.U95) if one.identified else [math.nan, math.nan],
        **stated(one, "unit", "basis"),
        **figures_beside(one.basis),
        "declared": math.nan if one.expected is None else one.expected,
        "E_n": normalised_error(one),
    }


def _conformity(one: Quantity, issued: Issue, rig: Rig | None, *, valid: bool) -> dict[str, Any]:
    """State the conformity of a mass of the recoiling part with its tolerance, as for the mass of the report.

    A rig states a tolerance of no other quantity.
    """
    if rig is None or issued.tolerance_kg is None or not one.of_recoiling_part or not one.identified:
        return {}
    return {"conformity": stated_conformity(issued, rig.specification, one.value, one.u, valid=valid)}


def normalised_error(one: Quantity) -> float:
    """``E_n`` of a quantity against what the rig file declares (ISO/IEC 17043, annex B), k = 2; NaN where none."""
    if one.expected is None or not one.identified:
        return math.nan
    expanded = 2 * math.hypot(one.u, one.u_expected or 0.0)
    return (one.value - one.expected) / expanded if expanded > 0 else math.nan


def series_file(target: str) -> str:
    """Name of the file with what was identified over time."""
    return f"{target}.csv"


def write_target_document(folder: Path, document: Mapping[str, Any]) -> Path:
    """Write ``<target>.json`` into a folder."""
    path = folder / f"{document['target']}.json"
    path.write_bytes(json_bytes(document))
    return path


def series_text(series: Series) -> str:
    """Return the text of ``<target>.csv``; what was not identified is left blank."""
    table = np.column_stack(list(series.columns.values()))
    lines = [",".join(series.columns)]
    lines += [",".join("" if math.isnan(v) else f"{v:.9g}" for v in row) for row in table]
    return "\n".join(lines) + "\n"
