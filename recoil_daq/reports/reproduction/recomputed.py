"""A document beside itself made again, with everything as it says it was made: every number, text and digest."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.files.regular_file import read_beginning
from recoil_daq.reports.drawings import Drawings, strangers
from recoil_daq.reports.reproduction.kept_document import Again, KeptDocument
from recoil_daq.reports.reproduction.kept_report import FINDINGS
from recoil_daq.terminal.result import Progress
from recoil_identification.report.document.report_files import (
    SEAL,
    digest_of,
)
from recoil_identification.report.document.reproduction import Comparison, Difference, compare, compare_tables

BESIDES = ("provenance.version", "provenance.computer", "provenance.outputs", f"provenance.{SEAL}")
"""Key paths of a report that are compared in another way, or state what may differ."""
MOST_OF_A_TABLE = 2
"""Times the size of a file made again, beyond which the one beside a report is not read: it is another one."""


@dataclass(frozen=True, eq=False)
class Recomputed:
    """A document and what came of it again.

    Attributes
    ----------
    kept
        Document as it stands.
    again
        Document made again.
    comparison
        Comparison of all numbers of the document and of the tables beside it.
    """

    kept: KeptDocument
    again: Again
    comparison: Comparison

    @property
    def document(self) -> Mapping[str, Any]:
        """The document made again."""
        return self.again.document

    def whole(self, folders: Sequence[Path] = ()) -> Comparison:
        """Compare page, paper copy and figures, too, and what it was made of in folders that were named for this.

        Parameters
        ----------
        folders
            Folders in which to look for what it was made of first.
        """
        kept, home = self.kept, self.kept.home
        drawings = Drawings(home, *kept.drawn_as(), home.parent if kept.several_scripts else home, self.again.draw)
        drawn, names = drawings.compared(kept.document, self.document, exact=kept.same_computer)
        whole = self.comparison.joined(drawn).joined(kept.changed(folders))
        if (found := kept.besides()) is None:
            return whole
        besides, own = found
        return whole.joined(besides).joined(strangers(home, {*names, *own}))


def recompute(kept: KeptDocument, folders: Sequence[Path] = (), *, progress: Progress = lambda _: None) -> Recomputed:
    """Make a document anew, with everything as it was, and compare every number, every text, every digest.

    Parameters
    ----------
    folders
        Folders in which to look for what it was made of before the usual ones.
    progress
        Function called with the name of each step.

    Raises
    ------
    ReadError
        If what it was made of is not found, or has changed.
    StoreError, RigError, IdentificationError
        As of `recoil_daq.reports.identify.identify_file`.
    """
    again = kept.again(folders, progress)
    progress("compare")
    stored, exact = kept.document, kept.same_computer
    besides = BESIDES if FINDINGS in stored else (*BESIDES, FINDINGS)
    comparison = compare(stored, again.document, exact=exact, besides=besides)
    for name, text in again.files.items():
        comparison = comparison.joined(_compared(kept.path.parent / name, stored, text, exact=exact))
    odd = [Difference(f"a number of {kept.path.name}", one, repr(float(one))) for one in kept.other_digits]
    seal, digest = stored["provenance"].get(SEAL), digest_of(stored)
    odd += [Difference(f"provenance.{SEAL}", seal, digest)] if seal != digest else []
    return Recomputed(kept, again, comparison.joined(Comparison.of(odd)))


def _compared(path: Path, stored: Mapping[str, Any], text: str, *, exact: bool) -> Comparison:
    """Compare a file beside a document, and its digest, with the same file made again."""
    name = path.name
    if not path.is_file():
        return Comparison.of([Difference(name, None, "a table")])
    most = MOST_OF_A_TABLE * len(text.encode())
    content = read_beginning(path, most + 1)
    if len(content) > most:
        larger = Difference(f"size of {name}", f"over {most:,} bytes", f"{most // MOST_OF_A_TABLE:,} bytes")
        return Comparison.of([larger])
    found = compare_tables(name, content.decode("utf-8", "replace"), text, exact=exact)
    listed = {one.get("file"): one.get("sha256") for one in stored["provenance"].get("outputs", ())}
    digest = hashlib.sha256(content).hexdigest()
    if listed.get(name) != digest and not found.differences:
        return found.joined(Comparison.of([Difference(f"SHA-256 of {name}", listed.get(name), digest)]))
    return found
