"""A document as it stands in its folder, of any kind that can be made again."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any, ClassVar, Self

from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.files.strict_json import told_in_one_line
from recoil_daq.reports.drawings import Draw
from recoil_daq.reports.reproduction.ingredient import Ingredient
from recoil_daq.reports.stored_shot import StoredShot
from recoil_daq.terminal.result import Progress
from recoil_daq.version import __version__
from recoil_identification.report.document.report_files import (
    computer,
    of_schema,
)
from recoil_identification.report.document.reproduction import Comparison


@dataclass(frozen=True, eq=False)
class Again:
    """A document made again.

    Attributes
    ----------
    files
        Texts of the files beside it, by name.
    draw
        Function that draws it.
    steps
        Steps from the recorded files to it, a line each.
    ingredients
        Files that it was made of.
    fired
        Shot as it was fired; None of a campaign, which has many.
    """

    document: Mapping[str, Any]
    files: Mapping[str, str]
    draw: Draw
    steps: tuple[str, ...] = ()
    ingredients: tuple[Ingredient, ...] = ()
    fired: StoredShot | None = None


@dataclass(frozen=True)
class KeptDocument(ABC):
    """A document as it stands in its folder, which can be made again from what it rests on.

    Attributes
    ----------
    document
        Contents of its file.
    path
        Path of that file.
    other_digits
        Numerals in it that are not the ones that their numbers are written with: a digit beyond the last one that
        tells a number from its neighbours was changed.
    """

    document: Mapping[str, Any]
    path: Path
    other_digits: tuple[str, ...] = ()

    file: ClassVar[str]
    """Name of its file."""
    schema: ClassVar[str]
    called: ClassVar[tuple[str, str]]
    """Words for it where it is too large, and where it is none."""
    largest: ClassVar[int]
    anew: ClassVar[str]
    """Words for what makes another one."""
    several_scripts: ClassVar[bool] = True
    """Whether the script of its page stands in the folder above, for all pages there."""

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read a document, of its file or of the folder that it is in.

        Raises
        ------
        ReadError
            If there is none, or it is of another schema or lacks what it takes to make it again.
        """
        path = Path(path) / cls.file if Path(path).is_dir() else Path(path)
        content = read_small(path, cls.largest, cls.called[0])
        with told_in_one_line(f"this is no {cls.called[1]} that can be made again", path, remedy=cls.anew):
            document = of_schema(content, cls.schema)
            kept = cls(document, path, other_digits(content))
            kept._needed()
        return kept

    @abstractmethod
    def _needed(self) -> object:
        """Look at all that it takes to make it again; errors of many kinds if something is not there."""

    @abstractmethod
    def again(self, folders: Sequence[Path], progress: Progress) -> Again:
        """Make it again with everything as it was, from what is found in folders and around it."""

    @abstractmethod
    def drawn_as(self) -> tuple[str, str]:
        """Return the file names of its page and its paper copy."""

    @abstractmethod
    def besides(self) -> tuple[Comparison, set[str]] | None:
        """Compare what else of ours stands in its folder, and name all but its drawings; None where others do that."""

    @abstractmethod
    def changed(self, folders: Sequence[Path]) -> Comparison:
        """Compare what it was made of with what has its name in folders that were named for this."""

    @property
    @abstractmethod
    def shots(self) -> tuple[str, ...]:
        """Names of its shots."""

    @property
    def name(self) -> str:
        """Name of what it is of."""
        return self.shots[0]

    @property
    def home(self) -> Path:
        """Its folder."""
        return self.path.absolute().parent

    @property
    def same_computer(self) -> bool:
        """Whether it was made by this version, on this kind of computer and with these libraries."""
        provenance = self.document["provenance"]
        return bool(provenance["version"] == __version__ and provenance.get("computer") == computer())


def other_digits(content: bytes) -> tuple[str, ...]:
    """Return the numerals of a JSON text that another number of digits, or other digits, would be written for."""
    found = []

    def look(numeral: str) -> float:
        number = float(numeral)
        try:
            same = Decimal(numeral) == Decimal(repr(number))
        except InvalidOperation:  # an exponent of twenty digits
            same = False
        if not same:
            found.append(numeral)
        return number

    json.loads(content, parse_float=look)
    return tuple(found)
