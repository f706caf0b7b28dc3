"""recoil-daq: from a test-fired recoiling mechanism's recordings to its recoiling mass.

The public Python interface::

    from recoil_daq import ingest_files, identify_file, load_rig, read_shot

    outcome = ingest_files(load_rig("rig.toml"), ["daq.csv", "camera.csv"], shot="0001")
    report = identify_file(outcome.path)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str
    from recoil_acquisition.store import read_shot, write_shot
    from recoil_daq.identify import identify_file
    from recoil_daq.ingest import ingest_files
    from recoil_rigs.rig import load_rig

_HOMES = {
    "identify_file": "recoil_daq.identify",
    "ingest_files": "recoil_daq.ingest",
    "load_rig": "recoil_rigs.rig",
    "read_shot": "recoil_acquisition.store",
    "write_shot": "recoil_acquisition.store",
}

__all__ = ["__version__", "identify_file", "ingest_files", "load_rig", "read_shot", "write_shot"]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that ``--help`` needs none of the heavy libraries."""
    if name == "__version__":
        return _version()
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("recoil-daq")
    except PackageNotFoundError:  # a source tree that was never installed
        return "0+unknown"
