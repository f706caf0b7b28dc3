"""recoil-daq: from a test-fired recoiling mechanism's recordings to its recoiling mass.

The public Python interface::

    from recoil_daq import CampaignPlan, explain, identify_file, ingest_files, load_rig, predict

    done = ingest_files(load_rig("rig.toml"), ["daq.csv", "camera.csv"], shot="0001")
    report = identify_file(done.path)
    print(report)                                    # what the command prints
    print(report.mass_kg, report.u_kg, report.valid)
    print(explain(report.folder, "mass.u"))          # where a number comes from, and whether it comes again

Before the day, with the rig's table ``[twin]`` or a shot that was recorded on it::

    expected = predict(load_rig("rig.toml"), shots=16, plan=CampaignPlan(added_mass_kg=310.0))
    print(expected)
    print(expected.u_rel, expected.campaign, expected.what_if)

Every error that a file, a rig or a device causes is a `RecoilDaqError`; a caller's own mistake is a ValueError or a
TypeError.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any


@cache
def _homes() -> dict[str, str]:
    """Return public name -> module that defines it, as the stub beside this file states them for type checkers."""
    import ast
    from pathlib import Path

    return {
        public.name: home.module
        for home in ast.walk(ast.parse(Path(__file__).with_suffix(".pyi").read_text("utf-8")))
        if isinstance(home, ast.ImportFrom) and home.module
        for public in home.names
    }


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that ``--help`` needs none of the heavy libraries."""
    if name == "__all__":
        return tuple(sorted(_homes()))
    if (name == "__version__" or not name.startswith("__")) and name in _homes():
        return getattr(import_module(_homes()[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(_homes())
