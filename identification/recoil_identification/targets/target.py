"""What can be identified beside the mass: the nouns that every target shares.

::

    Case      one shot, its rig, the user's options; everything a target starts from
    Finding   what one target found: quantities with intervals, series over time, figures, and why (not) to trust it
    +-- Quantity     one number
    +-- Series       columns over time, each with its standard uncertainty where it has one
    +-- Table        further rows for the page
    +-- Figure       of `recoil_identification.report.figure`

A target is a function from a `Case` to a `Finding`. It refuses by raising an IdentificationError where the
channels are missing altogether; a number that is doubtful is a finding with reasons.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot import Shot
from recoil_identification.analysis import Identification, Options, identify_shot
from recoil_identification.budget import COVERAGE_FACTOR
from recoil_identification.preparation import Prepared, prepare
from recoil_identification.report.figure import Figure
from recoil_rigs.rig import Rig

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Case:
    """One shot as a target meets it.

    Parameters
    ----------
    shot : Shot
        With its alignments.
    rig : Rig
    options : Options
    """

    shot: Shot
    rig: Rig
    options: Options = field(default_factory=Options)

    @cached_property
    def prepared(self) -> Prepared:
        """Channels on one grid, and the equation of motion as recorded; computed once.

        Raises
        ------
        IdentificationError
            As `recoil_identification.preparation.prepare`.
        """
        return prepare(self.shot, self.rig)

    @cached_property
    def identified(self) -> Identification:
        """The mass of the shot with all that was found on the way; computed once.

        Raises
        ------
        IdentificationError
            As `recoil_identification.analysis.identify_shot`.
        """
        return identify_shot(self.shot, self.rig, self.options)

    def require_roles(self, *roles: str, purpose: str) -> None:
        """Refuse a shot that lacks channels.

        Raises
        ------
        IdentificationError
            Naming every role that is missing.
        """
        missing = [role for role in roles if self.shot.by_role(role) is None]
        if missing:
            raise IdentificationError(
                f"{purpose}: no channel of role {', '.join(missing)}",
                expected=", ".join(roles),
                remedy="declare the channels and their roles in the rig file, and ingest the shot again",
            )

    def require_symbols(self, *symbols: str, purpose: str) -> None:
        """Refuse a rig whose mechanism does not declare values that a target takes as known.

        Raises
        ------
        IdentificationError
            Naming every symbol that is missing.
        """
        missing = [symbol for symbol in symbols if math.isnan(getattr(self.rig.mechanism, symbol))]
        if missing:
            raise IdentificationError(
                f"{purpose}: the rig's [mechanism] does not declare {', '.join(missing)}",
                expected=", ".join(symbols),
                remedy="add them to the rig file, SI units, and ingest the shot again",
            )


@dataclass(frozen=True)
class Quantity:
    """One identified number.

    Attributes
    ----------
    name : str
        In words, for example ``stiffness of the elevating gear``.
    symbol : str
        Key in the report, for example ``k_elevating``.
    value, u : float
        NaN for the value where it was not identified.
    unit : str
    basis : str
        How it was found, or why it was not, in a few words.
    expected, u_expected : float or None
        What the rig file declares, to compare with.
    interval : tuple of float or None
        95 % coverage interval where it is not the value and 1.96 u on both sides.
    """

    name: str
    symbol: str
    value: float
    u: float
    unit: str
    basis: str = ""
    expected: float | None = None
    u_expected: float | None = None
    interval: tuple[float, float] | None = None

    @property
    def identified(self) -> bool:
        """Whether there is a number."""
        return math.isfinite(self.value)

    @property
    def U95(self) -> tuple[float, float]:
        """95 % coverage interval."""
        half = COVERAGE_FACTOR * self.u
        return self.interval if self.interval is not None else (self.value - half, self.value + half)


@dataclass(frozen=True)
class Table:
    """Further rows for the page.

    Attributes
    ----------
    title, caption : str
    columns : tuple of str
        With their units.
    rows : tuple of tuple of str
        As printed; numbers rounded by `recoil_identification.report.rounding`.
    """

    title: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class Series:
    """Columns over time, written as ``<target>.csv``.

    Attributes
    ----------
    columns : mapping of str to ndarray, shape (n,)
        By name with unit, ``time_s`` first; ``u_<name>`` after what it belongs to. NaN is written as blank.
    """

    columns: Mapping[str, Array]

    def __post_init__(self) -> None:
        names = list(self.columns)
        if not names or names[0] != "time_s":
            raise ValueError(f"the first column of a series must be time_s, found {names[:1]}")
        if len({column.shape for column in self.columns.values()}) != 1:
            raise ValueError("the columns of a series must be of one length")


@dataclass(frozen=True, eq=False)
class Finding:
    """What one target found.

    Attributes
    ----------
    target : str
        Its name on the command line.
    title : str
        Of the page.
    summary : str
        One or two sentences: what was identified from which channels by which method.
    quantities : tuple of Quantity
    figures : tuple of Figure
        In reading order, keys unique.
    series : Series or None
    tables : tuple of Table
    reasons : tuple of str
        Why the result is not valid, one sentence each; empty if it is.
    notes : tuple of str
        What a reader should know although it does not make the result invalid.
    parameters : mapping
        JSON values: what was chosen, for the provenance.
    """

    target: str
    title: str
    summary: str
    quantities: tuple[Quantity, ...]
    figures: tuple[Figure, ...] = ()
    series: Series | None = None
    tables: tuple[Table, ...] = ()
    reasons: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    parameters: Mapping[str, object] = field(default_factory=dict)

    @property
    def valid(self) -> bool:
        """Whether nothing speaks against the result."""
        return not self.reasons

    def quantity(self, symbol: str) -> Quantity:
        """Return the quantity of a symbol.

        Raises
        ------
        KeyError
            If there is none.
        """
        for one in self.quantities:
            if one.symbol == symbol:
                return one
        raise KeyError(symbol)
