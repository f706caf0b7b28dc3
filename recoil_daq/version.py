"""Version of the program, as reports and shot files state it."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("recoil-daq")
except PackageNotFoundError:  # a source tree that was never installed
    __version__ = "0+unknown"
