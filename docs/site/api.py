"""Pages of every module from the docstrings, by pdoc: ``python docs/site/api.py FOLDER [PACKAGE...]``."""

from __future__ import annotations

import sys
from pathlib import Path

import pdoc

import recoil_daq

PACKAGES = ("recoil_daq", "recoil_identification", "recoil_processing", "recoil_rigs", "recoil_acquisition")


def main(folder: str, *packages: str) -> None:
    """Write the pages of some packages, or of all, into a folder."""
    for name in recoil_daq.__all__:
        # a name that is imported when it is first used is none that pdoc finds
        setattr(recoil_daq, name, getattr(recoil_daq, name))
    pdoc.render.configure(docformat="numpy", search=False)
    pdoc.pdoc(*(packages or PACKAGES), output_directory=Path(folder))


if __name__ == "__main__":
    main(*sys.argv[1:])
