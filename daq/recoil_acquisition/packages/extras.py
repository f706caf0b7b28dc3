"""Libraries that some formats and commands need beside this package, and how each is installed."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from recoil_acquisition.errors import ErrorCode, ReadError


class Extra(NamedTuple):
    """A library that a format or a command needs beside the package.

    Attributes
    ----------
    name
        Name of the extra, as pip takes it with this package.
    module
        Module that the extra installs.
    requirement
        Requirement as pip takes it alone, wherever this package came from.
    """

    name: str
    module: str
    requirement: str

    @property
    def is_installed(self) -> bool:
        """Whether its module can be found."""
        return find_spec(self.module) is not None

    @property
    def remedy(self) -> str:
        """The command that installs it."""
        return f"pip install {self.requirement!r}"

    def check(self, path: Path) -> None:
        """Raise `ReadError` if a file cannot be read because it is not installed."""
        if not self.is_installed:
            raise ReadError(
                f"{self.module}, which reads this file, is not installed", code=ErrorCode.NOT_INSTALLED, path=path,
                remedy=self.remedy,
            )  # fmt: skip


DEWESOFT = Extra("dewesoft", "dwdatareader", "dwdatareader>=1.3.0")
MDF = Extra("mdf", "asammdf", "asammdf>=8.6")
TDMS = Extra("tdms", "nptdms", "npTDMS>=1.9")
XLSX = Extra("xlsx", "openpyxl", "openpyxl>=3.1")
PARQUET = Extra("parquet", "pyarrow", "pyarrow>=17")
CLUSTER = Extra("cluster", "distributed", "distributed>=2025.1")
PDF = Extra("pdf", "typst", "typst>=0.15")
DCC = Extra("dcc", "signxml", "signxml>=5.2")
OPENDAQ = Extra("opendaq", "opendaq", "opendaq>=3.40")
SERVE = Extra("serve", "uvicorn", "uvicorn>=0.30")
NOTEBOOK = Extra("notebook", "matplotlib", "matplotlib>=3.9")
XARRAY = Extra("notebook", "xarray", "xarray>=2024.10")
SIGN = Extra("sign", "asn1crypto", "asn1crypto>=1.5")
SIGN_KEYS = Extra("sign", "cryptography", "cryptography>=42")
EXTRAS = {extra.name: extra for extra in (DEWESOFT, MDF, TDMS, XLSX, PARQUET, CLUSTER, PDF, DCC, OPENDAQ, SERVE)}
