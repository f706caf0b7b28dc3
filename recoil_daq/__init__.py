"""recoil-daq: from a test-fired recoiling mechanism's recordings to its recoiling mass.

The public Python interface::

    from recoil_daq import CampaignPlan, explain, identify_file, ingest_files, load_rig, predict

    done = ingest_files(load_rig("rig.toml"), ["daq.csv", "camera.csv"], shot="0001")
    report = identify_file(done.path)
    print(report)                                    # what the command prints
    print(report.mass_kg, report.u_kg, report.valid)
    print(explain(report.folder, "mass.u"))          # where a number comes from, and whether it comes again

Before the day, with the rig's table ``[twin]`` or a shot that was recorded on it::

    expected = predict(load_rig("rig.toml"), shots=16, plan=CampaignPlan(added_mass_kg=120.0))
    print(expected)
    print(expected.u_rel, expected.campaign, expected.what_if)

Every error that a file, a rig or a device causes is a `RecoilDaqError`; a caller's own mistake is a ValueError or a
TypeError.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str
    from recoil_acquisition.errors import (
        AlignmentError,
        CorruptFileError,
        DeviceError,
        FramingError,
        IdentificationError,
        MissingChannelError,
        ReadError,
        RecoilDaqError,
        RigError,
        StoreError,
        UnknownFormatError,
        WorkerError,
    )
    from recoil_acquisition.readers.recording import Recording
    from recoil_acquisition.shot import Shot
    from recoil_acquisition.store import read_shot, write_shot
    from recoil_daq.combined import Combined, campaign
    from recoil_daq.explained import CheckedReports, Explained, check_reports, explain
    from recoil_daq.exported import Exported, export
    from recoil_daq.file_summary import open_recording
    from recoil_daq.identify import Reported, identify_file
    from recoil_daq.ingest import Ingested, ingest_files
    from recoil_daq.laid_beside import Beside, beside
    from recoil_daq.predicted import Predicted, predict
    from recoil_daq.several_shots import identify_folder
    from recoil_daq.shot_folder import IngestedFolder, ShotOutcome, ingest_folder
    from recoil_daq.simulated import Simulated, simulate
    from recoil_identification.shot.analysis import Options
    from recoil_rigs.rig import Rig, load_rig
    from recoil_rigs.twin import CampaignPlan

_HOMES = {
    "recoil_acquisition.errors": (
        "AlignmentError", "CorruptFileError", "DeviceError", "FramingError", "IdentificationError",
        "MissingChannelError", "ReadError", "RecoilDaqError", "RigError", "StoreError", "UnknownFormatError",
        "WorkerError",
    ),
    "recoil_acquisition.readers.recording": ("Recording",),
    "recoil_acquisition.shot": ("Shot",),
    "recoil_acquisition.store": ("read_shot", "write_shot"),
    "recoil_daq.combined": ("Combined", "campaign"),
    "recoil_daq.explained": ("CheckedReports", "Explained", "check_reports", "explain"),
    "recoil_daq.exported": ("Exported", "export"),
    "recoil_daq.file_summary": ("open_recording",),
    "recoil_daq.identify": ("Reported", "identify_file"),
    "recoil_daq.ingest": ("Ingested", "ingest_files"),
    "recoil_daq.laid_beside": ("Beside", "beside"),
    "recoil_daq.predicted": ("Predicted", "predict"),
    "recoil_daq.several_shots": ("identify_folder",),
    "recoil_daq.shot_folder": ("IngestedFolder", "ShotOutcome", "ingest_folder"),
    "recoil_daq.simulated": ("Simulated", "simulate"),
    "recoil_identification.shot.analysis": ("Options",),
    "recoil_rigs.rig": ("Rig", "load_rig"),
    "recoil_rigs.twin": ("CampaignPlan",),
}  # fmt: skip
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "AlignmentError",
    "Beside",
    "CampaignPlan",
    "CheckedReports",
    "Combined",
    "CorruptFileError",
    "DeviceError",
    "Explained",
    "Exported",
    "FramingError",
    "IdentificationError",
    "Ingested",
    "IngestedFolder",
    "MissingChannelError",
    "Options",
    "Predicted",
    "ReadError",
    "RecoilDaqError",
    "Recording",
    "Reported",
    "Rig",
    "RigError",
    "Shot",
    "ShotOutcome",
    "Simulated",
    "StoreError",
    "UnknownFormatError",
    "WorkerError",
    "__version__",
    "beside",
    "campaign",
    "check_reports",
    "explain",
    "export",
    "identify_file",
    "identify_folder",
    "ingest_files",
    "ingest_folder",
    "load_rig",
    "open_recording",
    "predict",
    "read_shot",
    "simulate",
    "write_shot",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that ``--help`` needs none of the heavy libraries."""
    if name == "__version__":
        return _version()
    if name in _HOME_OF:
        return getattr(import_module(_HOME_OF[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("recoil-daq")
    except PackageNotFoundError:  # a source tree that was never installed
        return "0+unknown"
