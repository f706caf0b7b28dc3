"""A section of a document: a heading, a caption, and figures, a table or sentences, as page and paper both show it.

::

    Section   one entry of the lists in `recoil_identification.report.sections`: what to show, and of which document
    +-- Column    heading, key in the rows, and kind of what stands in it
    Part      a section filled from one document: what page and paper write

What has neither figure, row nor sentence in a document gives no part.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any, Literal

from recoil_identification.estimate.rounding import NO_NUMBER
from recoil_identification.report.content.chosen_units import ChosenUnits, scaled_text
from recoil_identification.report.figure.figure import Figure

Document = Mapping[str, Any]
Row = Mapping[str, Any]
Kind = Literal["name", "term", "text", "long", "number", "chip", "code", "file", "link", "bar", "span"]
"""What stands in a column: a row's name, a term of the glossary, a text, a text that takes what room is left, a number,
a word of a verdict, a digest, what the file says that the column is named after, a name that leads to another page, or
what only a screen shows: a share as a bar, and
what was known and is known as two."""

SCREEN_ONLY = ("bar", "span")
"""Kinds of columns that paper has not."""
ALL_OTHERS = "*"
"""Pattern of the figures that no other section of the list names."""


@dataclass(frozen=True)
class Column:
    """A column of a section's table.

    Attributes
    ----------
    key
        Key of the cell in each row.
    head
        Heading; empty where none is needed.
    kind
        Kind of what stands in it.
    unit
        Unit of its numbers; empty where they have none, or each its own.
    wide
        Whether it takes what room is left on paper.
    page
        Page that its heading leads to; None where it leads to none.
    """

    key: str
    head: str
    kind: Kind = "text"
    unit: str = ""
    wide: bool = False
    page: str | None = None

    @property
    def heading(self) -> str:
        """Heading with the unit."""
        return f"{self.head} / {self.unit}" if self.unit else self.head


def _nothing(_: Document) -> Sequence[Any]:
    return ()


@dataclass(frozen=True)
class Section:
    """A section of a kind of documents.

    Attributes
    ----------
    key
        Anchor on the page.
    title
        Heading; empty for figures that each are a section of their own, with their own title and caption.
    caption
        Sentence under the heading, or the function that makes it of the document.
    columns
        Columns of the table.
    rows
        Function that makes the table's rows of the document; a row may have the keys ``strong`` and ``aside`` (true
        for one that stands out, or back), ``page`` (where its ``link`` leads), and ``folded`` (true for one that a page
        shows when it is asked for, and paper counts).
    figure
        Pattern of the keys of the figures that stand here; `ALL_OTHERS` for those that no section names.
    sentences
        Function that makes the sentences above the table.
    after
        Function that makes the sentences below the table.
    total
        Function that makes the row of the sum; None where there is none.
    rest
        Function that makes the row of the sum of what is folded, which paper lists instead; None where paper counts it.
    listed
        Whether its sentences are a list.
    folded
        Words for the rows that are folded, after their number.
    fold_beyond
        Number of rows beyond which a page folds all of them.
    link
        Words of the link to it; the title if left out, and no link if None.
    style
        Class of the table, for a page.
    sparse
        Whether columns in which nothing stands are left out.
    as_stated
        Whether its numbers stay in the units in which they are stated, whatever units the reader chose.
    """

    key: str
    title: str = ""
    caption: str | Callable[[Document], str] = ""
    columns: tuple[Column, ...] = ()
    rows: Callable[[Document], Sequence[Row]] = _nothing
    figure: str = ""
    sentences: Callable[[Document], Sequence[str]] = _nothing
    after: Callable[[Document], Sequence[str]] = _nothing
    total: Callable[[Document], Row | None] | None = None
    rest: Callable[[Document], Row | None] | None = None
    listed: bool = False
    folded: str = ""
    fold_beyond: int | None = None
    link: str | None = ""
    style: str = ""
    sparse: bool = False
    as_stated: bool = False


@dataclass(frozen=True, eq=False)
class Part:
    """A section filled from a document.

    Attributes
    ----------
    section
        Entry of the list that it is of.
    title, caption
        Texts; of a figure that is a section of its own those of the figure.
    columns
        Columns as far as anything stands in them.
    rows, folded
        Rows that are shown, and those that are folded.
    figures
        Figures with their numbers on the page.
    sentences, after
        Sentences above and below the table.
    total, rest
        Rows of the sum and of that of what is folded; None where there is none.
    """

    section: Section
    title: str
    caption: str
    columns: tuple[Column, ...] = ()
    rows: tuple[Row, ...] = ()
    folded: tuple[Row, ...] = ()
    figures: tuple[tuple[int, Figure], ...] = ()
    sentences: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    total: Row | None = None
    rest: Row | None = None

    @property
    def is_figure(self) -> bool:
        """Whether it is a figure that is a section of its own."""
        return not self.section.title

    @property
    def anchor(self) -> str:
        """Name by which a page leads to it."""
        return f"figure-{self.figures[0][0]}" if self.is_figure else self.section.key

    @property
    def link(self) -> str | None:
        """Words that lead to it; None where none do."""
        if self.is_figure:
            return None if self.figures[0][1].folded else self.title
        return None if self.section.link is None else self.section.link or self.title


def parts_of(sections: Sequence[Section], document: Document, figures: Sequence[Figure]) -> list[Part]:
    """Fill sections from a document, in their order; what has nothing to show is left out.

    Parameters
    ----------
    figures
        Figures in the order of their numbers; one that no section names comes where `ALL_OTHERS` stands.
    """
    places, units = _places(sections, figures), ChosenUnits.of(document)
    parts: list[Part] = []
    for section in sections:
        here = tuple((number, figure) for number, figure in enumerate(figures) if places[number] == section.key)
        if not section.title:
            parts += [
                Part(section, figure.title, figure.caption, figures=((number, figure),)) for number, figure in here
            ]
            continue
        rows, sentences = list(section.rows(document)), tuple(section.sentences(document))
        if not rows and not here and not sentences:
            continue
        caption = section.caption if isinstance(section.caption, str) else section.caption(document)
        part = Part(
            section, section.title, caption, _filled(section, rows),
            tuple(row for row in rows if not row.get("folded")), tuple(row for row in rows if row.get("folded")),
            here, sentences, tuple(section.after(document)),
            *(None if one is None else one(document) for one in (section.total, section.rest)),
        )  # fmt: skip
        parts.append(_in_units(part, units) if units.by_quantity and not section.as_stated else part)
    return parts


def _in_units(part: Part, units: ChosenUnits) -> Part:
    """Return a part with its sentences, its texts, and the columns of one unit in the units that were chosen."""
    columns = tuple(_column(one, units) for one in part.columns)
    factors = {
        one.key: units.factor(_unit(one))[0] for one, other in zip(part.columns, columns, strict=True) if one != other
    }
    texts = {one.key for one in part.columns if one.kind in ("text", "long")} - set(factors)

    def row(cells: Row) -> Row:
        scaled = {key: scaled_text(str(cells[key]), factor) for key, factor in factors.items() if key in cells}
        return {**cells, **{key: units.text(cells[key]) for key in texts if isinstance(cells.get(key), str)}, **scaled}

    return replace(
        part, columns=columns, caption=units.text(part.caption), rows=tuple(map(row, part.rows)),
        folded=tuple(map(row, part.folded)), sentences=tuple(map(units.text, part.sentences)),
        after=tuple(map(units.text, part.after)),
    )  # fmt: skip


def _unit(column: Column) -> str:
    """Return the unit of a column: that of its numbers, or what stands behind the comma of its heading."""
    return column.unit or column.head.rpartition(", ")[2]


def _column(column: Column, units: ChosenUnits) -> Column:
    unit = _unit(column)
    name = units.factor(unit)[1]
    if name == unit:
        return column
    return replace(column, unit=name) if column.unit else replace(column, head=column.head.removesuffix(unit) + name)


def _places(sections: Sequence[Section], figures: Sequence[Figure]) -> list[str | None]:
    """Return the key of the section in which each figure stands; None for one that has no place."""
    named = [section for section in sections if section.figure not in ("", ALL_OTHERS)]
    others = next((section.key for section in sections if section.figure == ALL_OTHERS), None)
    return [
        next((section.key for section in named if fnmatchcase(figure.key, section.figure)), others)
        for figure in figures
    ]


def _filled(section: Section, rows: Sequence[Row]) -> tuple[Column, ...]:
    if not section.sparse:
        return section.columns
    return tuple(one for one in section.columns if any(row[one.key] not in ("", NO_NUMBER) for row in rows))
