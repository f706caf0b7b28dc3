"""A report's mass with its influences to a file that GTC opens."""

from __future__ import annotations

import json
import re
from pathlib import Path

from recoil_acquisition.errors import StoreError, system_errors_as
from recoil_acquisition.exporters.publication import ExportedFile
from recoil_acquisition.files.new_file import give_name, partial_path
from recoil_daq.recording.export import Exported
from recoil_daq.reports.reproduction.kept_report import Kept
from recoil_identification.report.document.gtc_archive import gtc_archive

FORMAT = "gtc"
"""Name of the format."""


def export_report(path: str | Path, *, out: str | Path = "exports", overwrite: bool = False) -> Exported:
    """Write the mass of a report as an archive of GTC: ``GTC.persistence.load_json`` opens it.

    Parameters
    ----------
    path
        Folder of a report, or its ``report.json``.
    out
        Folder of the file.

    Raises
    ------
    ReadError
        If it is no report.
    StoreError
        If the file exists or cannot be written.
    """
    report = Kept.read(Path(path)).document
    name = re.sub(r"[^\w.+-]", "_", str(report["shot"])).lstrip(".") or "shot"
    file, archive = Path(out) / f"{name}.gtc.json", gtc_archive(report)
    if file.exists() and not overwrite:
        raise StoreError.exists(file, "give another --out, or --overwrite", "the archive")
    temporary = partial_path(file)
    with system_errors_as(StoreError, file, "written", "check the folder and the space on the disk"):
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            temporary.write_text(json.dumps(archive, indent=1), encoding="utf-8", newline="\n")
            size = temporary.stat().st_size
            give_name(temporary, file, overwrite=overwrite)
        finally:
            temporary.unlink(missing_ok=True)
    notes = ["a force of unknown shape, and what nobody stated, are taken as the same in all shots of the rig"]
    if not report["valid"]:
        notes.append(f"the mass is NOT VALID: {report['reasons'][0]}")
    influences = tuple(archive["tagged_real"])
    written = ExportedFile(file, (), influences, len(influences), size, exact=True, losses=(), left_out=())
    return Exported(report["shot"], report["rig"], FORMAT, aligned=False, files=(written,), notes=tuple(notes))
