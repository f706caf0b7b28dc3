"""The cut-off that the shots of a campaign share, kept in a file from when it is chosen until the answer is there."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.new_file import give_name, partial_path
from recoil_acquisition.regular_file import read_small
from recoil_acquisition.strict_json import read_json
from recoil_identification.report.report_files import json_bytes
from recoil_identification.shot.analysis import Options
from recoil_processing.spectra.cutoff import CutoffChoice

CUTOFF_FILE = "cutoff.json"
SCHEMA = "recoil-daq/cutoff/1"
LARGEST = 1_000_000
"""Bytes of such a file, beyond which it is none."""


@dataclass(frozen=True)
class SharedCutoff:
    """The cut-off of a campaign's shots; who chose it need not do so again, and cannot choose another one.

    Attributes
    ----------
    choice
        Of the trace's low-pass, from the spectra of all shots; None where each shot finds its own.
    mass_cutoff_hz
        Of the low-pass of the fit of the mass; None where there is none.
    """

    choice: CutoffChoice | None
    mass_cutoff_hz: float | None

    @classmethod
    def of(cls, options: Collection[Options]) -> SharedCutoff | None:
        """Return that of several shots; None where they share none."""
        shared = {cls(one.campaign, one.mass_cutoff_hz) for one in options}
        return shared.pop() if len(options) > 1 and len(shared) == 1 else None

    @property
    def options(self) -> Options:
        """With which each of the shots is identified."""
        return Options(campaign=self.choice, mass_cutoff_hz=self.mass_cutoff_hz)

    @classmethod
    def read(cls, folder: Path) -> SharedCutoff | None:
        """Return what an earlier run kept in a folder; None if there is nothing.

        Raises
        ------
        ReadError
            If the file is damaged.
        """
        path = folder / CUTOFF_FILE
        if not path.exists():
            return None
        try:
            stated = read_json(read_small(path, LARGEST, "a campaign's cut-off"))
            if stated["schema"] != SCHEMA:
                raise ValueError(f"schema {stated['schema']!r}")
            choice, mass_hz = stated["choice"], stated["mass_cutoff_hz"]
            choice = None if choice is None else CutoffChoice.of_json(choice)
            kept = cls(choice, None if mass_hz is None else float(mass_hz))
            kept.options  # noqa: B018 - refuses what is no cut-off
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise ReadError(
                "this is no cut-off of a campaign", path=path, expected=f"schema {SCHEMA}", found=str(error),
                remedy="remove it, or choose --out",
            ) from error  # fmt: skip
        return kept

    def write(self, folder: Path) -> None:
        """Keep it in a folder, which is made if it is not there.

        Raises
        ------
        StoreError
            If it cannot be written; what was there is there still.
        """
        path = folder / CUTOFF_FILE
        choice = None if self.choice is None else self.choice.to_json()
        document = {"schema": SCHEMA, "mass_cutoff_hz": self.mass_cutoff_hz, "choice": choice}
        temporary = partial_path(path)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            try:
                temporary.write_bytes(json_bytes(document))
                give_name(temporary, path, overwrite=True)
            finally:
                temporary.unlink(missing_ok=True)
        except OSError as error:
            raise StoreError(
                f"cannot be written: {error.strerror or error}", path=path, remedy="check space and permissions"
            ) from error
