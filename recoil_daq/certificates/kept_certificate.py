"""A certificate as it stands in its folder, made again from the documents that it rests on, and its signatures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.regular_file import require_name
from recoil_acquisition.shot.shot import InputFile
from recoil_daq.certificates.certificate import FILES, certificate_pages, certified, has_dcc, signed_files
from recoil_daq.certificates.dcc import DCC_FILE
from recoil_daq.certificates.signature import NOBODY, SUFFIX, State, Trust
from recoil_daq.certificates.sources import Sealed, Sources, candidates, found_by_digest
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.reproduction.ingredient import Ingredient, digest_differences
from recoil_daq.reports.reproduction.kept_document import Again, KeptDocument
from recoil_daq.terminal.result import Progress
from recoil_identification.report.document.certificate_document import (
    CERTIFICATE_FILE,
    LARGEST_CERTIFICATE,
    SCHEMA,
    Behind,
)
from recoil_identification.report.document.reproduction import Comparison, Difference, NotCompared
from recoil_identification.report.page.html import CERTIFICATE_PAGE
from recoil_identification.report.paper.paper import CERTIFICATE_PDF
from recoil_rigs.tables.issue import Issue


@dataclass(frozen=True)
class KeptCertificate(KeptDocument):
    """A certificate as it stands in its folder.

    Attributes
    ----------
    trust
        Knowledge of the reader on whose its signatures should be.
    """

    trust: Trust = NOBODY

    file, schema, largest, anew = CERTIFICATE_FILE, SCHEMA, LARGEST_CERTIFICATE, "make the certificate anew"
    called = ("a certificate", "certificate")
    several_scripts = False

    def _needed(self) -> object:
        shots = [str(one["shot"]) for one in self.document["shots"]]
        for part in (part for one in self.inputs for part in one.name.split("/")):
            require_name(part)  # no file is looked for that is beyond the folders that are looked through
        return shots, self.issued, self.inputs, self.signatures, Forms.of_document(self.document)

    @property
    def issued(self) -> Issue:
        """Identity of the certificate."""
        return Issue.model_validate(self.document["issued"])

    @property
    def inputs(self) -> list[InputFile]:
        """Files that it rests on, the document that it is of first."""
        return [
            InputFile(str(one["file"]), str(one["sha256"]), 0, str(one["kind"]), "")
            for one in self.document["provenance"]["inputs"]
        ]

    @property
    def signatures(self) -> list[str]:
        """Names of the signatures that it says were made."""
        return [str(one) for one in self.document["provenance"]["signatures"]]

    @property
    def shots(self) -> tuple[str, ...]:
        """Names of its shots."""
        return tuple(str(one["shot"]) for one in self.document["shots"])

    @property
    def name(self) -> str:
        """Number of the certificate."""
        return str(self.document["issued"].get("number"))

    def again(self, folders: Sequence[Path], progress: Progress) -> Again:
        """Make it again from the document that it is of.

        Raises
        ------
        ReadError
            If that, or a report behind it, is not found or has changed.
        """
        progress("find its documents")
        of = self.inputs[0]
        path = found_by_digest(of.name, of.sha256, self.home, folders)
        if path is None:
            other = next(candidates(of.name, self.home, folders), None)
            raise ReadError(
                "the document that this certificate is of is not found" if other is None else "the document that this "
                "certificate is of is another one now",
                path=other or self.path, expected=f"{of.name} with SHA-256 {of.sha256}",
                found=None if other is None else InputFile.of(other).sha256,
                remedy="give the folder of the one that was with --shots, or make the certificate anew",
            )  # fmt: skip
        sources = Sources.behind(Sealed.read(path), folders)
        header = next((one for one in self.inputs if one.source == Behind.HEADER), None)
        forms = Forms.of_document(self.document)
        if header is None or forms is None:
            raise ReadError("this certificate does not say of what it was made", path=self.path, remedy=self.anew)
        progress("draw")
        document = certified(sources, self.issued, header, forms, bool(self.signatures), has_dcc(self.document))
        steps = (f"certificate of {of.name}, recoil-daq {self.document['provenance']['version']}",)
        return Again(document, {}, certificate_pages, steps, tuple(self._ingredients(path.parent, folders)))

    def drawn_as(self) -> tuple[str, str]:
        """Return the file names of its page and its paper copy."""
        return CERTIFICATE_PAGE, CERTIFICATE_PDF

    def besides(self) -> tuple[Comparison, set[str]]:
        """Verify its signatures, and name all files of its folder that are known but for its drawings."""
        return Comparison.of([*self._unstated(), *self._signed()]), {self.path.name, *FILES}

    def _unstated(self) -> Iterator[Difference]:
        if not has_dcc(self.document) and (self.home / DCC_FILE).exists():
            yield Difference(DCC_FILE, "a file", None)

    def _signed(self) -> Iterator[Difference | NotCompared | str]:
        for name in signed_files(self.document):
            file, signature = self.home / name, self.home / f"{name}{SUFFIX}"
            expected = signature.name in self.signatures or self.trust != NOBODY
            if not signature.is_file():
                if expected:
                    yield Difference(signature.name, None, "a signature")
                continue
            if not file.is_file():
                continue  # told as the file that is not there
            state, said = self.trust.verdict(file, signature)
            if state is State.FAILS:
                yield Difference(f"{signature.name}, the signature of {name}", said, "a signature of these bytes")
            elif state is State.HOLDS:
                yield f"{signature.name} {said}"
            else:
                yield NotCompared(signature.name, said, stated=state is State.NOT_READ)

    def changed(self, folders: Sequence[Path]) -> Comparison:
        """Compare the shot files behind it with the digests that it states, and name those that are not here."""
        found: list[Difference | NotCompared | str] = []
        for one in self.inputs:
            if one.source != Behind.SHOT:
                continue
            if found_by_digest(one.name, one.sha256, self.home, folders) is not None:
                continue
            # further away another day's shot may have its name
            near = next(candidates(one.name, self.home, folders, far=False), None)
            if near is None:
                found.append(NotCompared(one.name, "this shot file is not here: its digest stands", stated=False))
            else:
                found.append(Difference(f"SHA-256 of {near}", one.sha256, InputFile.of(near).sha256))
        named = ((folder / one.name, (one.sha256,), one.sha256) for one in self.inputs for folder in folders)
        return Comparison.of(found).joined(digest_differences(named))

    def _ingredients(self, beside: Path, folders: Sequence[Path]) -> Iterator[Ingredient]:
        for one in self.inputs:
            lasting = one.source != Behind.HEADER
            paths = tuple(candidates(one.name, self.home, (*folders, beside))) if lasting else ()
            yield Ingredient(one.name, one.sha256, paths, "not here: what it said is in the certificate")
