"""A report, or a campaign's answer, to the certificate that is signed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ErrorCode, IdentificationError, ReadError, StoreError
from recoil_acquisition.files.strict_json import told_in_one_line
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.packages.extras import PDF
from recoil_acquisition.shot.shot import InputFile
from recoil_daq.certificates.dcc import DCC_FILE, SCHEMA_VERSION, dcc_bytes, refuse_without_facts
from recoil_daq.certificates.signature import SUFFIX, Signer
from recoil_daq.certificates.sources import Sources
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.output import Output, Pages
from recoil_daq.reports.report_folder import publish
from recoil_daq.terminal.result import Printed, Progress
from recoil_daq.version import __version__
from recoil_identification.report.document.certificate_document import (
    CERTIFICATE_FILE,
    DCC,
    Behind,
    certificate_document,
)
from recoil_identification.report.document.report_files import json_bytes
from recoil_identification.report.page.html import CERTIFICATE_PAGE, render_certificate_page
from recoil_identification.report.paper.paper import CERTIFICATE_PDF, certificate_pdf
from recoil_rigs.tables.issue import CAMPAIGN, SHOT, Issue, read_header

SIGNED = (CERTIFICATE_FILE, CERTIFICATE_PDF, DCC_FILE)
"""Files beside which a signature stands; the last one is written on request."""
FILES = (CERTIFICATE_FILE, CERTIFICATE_PAGE, CERTIFICATE_PDF, DCC_FILE, *(f"{name}{SUFFIX}" for name in SIGNED))


@dataclass(frozen=True, repr=False)
class Certified(Printed):
    """A certificate and where it was written.

    Attributes
    ----------
    document
        Contents of ``certificate.json``.
    folder
        Folder that holds ``certificate.json``, ``.html`` and ``.pdf``, the DCC, and the signatures.
    """

    document: dict[str, Any]
    folder: Path

    def to_json(self) -> dict[str, Any]:
        """Return the document that the command prints with ``--json``."""
        return {"folder": str(self.folder), **self.document}

    def show(self) -> None:
        """Print number, result and word, and where the certificate is."""
        from recoil_daq.terminal.certificate import print_certificate

        print_certificate(self.document, self.folder)

    def __repr__(self) -> str:
        return f"Certified({self.document['issued']['number']!r}, {self.document['conformity']['word']}, {self.folder})"


@on_one_thread
def certificate(
    of: str | Path,
    header: str | Path,
    *,
    out: str | Path = "certificate",
    sign: str | Path | None = None,
    sign_with: str = "",
    dcc: bool = False,
    overwrite: bool = False,
    progress: Progress = lambda _: None,
) -> Certified:
    """Make the certificate of a shot or of a campaign: ``certificate.json``, ``.html``, ``.pdf``, on request ``.xml``.

    It is of the bytes of its sources and of the header alone: made again it is the same to the byte. Its date is the
    header's; where that states none, the certificate says so.

    Parameters
    ----------
    of
        A ``report.json`` or ``campaign.json``, its folder, or the name of a shot whose report is in ``reports``.
    header
        Header file with the identity of the certificate, see `recoil_rigs.tables.issue`; its ``number`` must be there.
        Laboratory, customer and order that it leaves out are those of the document; number, issue, date, approval and
        concession are never taken over.
    out
        Folder of the certificate.
    sign
        PEM file with a private key and its certificate, with which detached signatures are made beside; needs the extra
        ``sign``.
    sign_with
        Command of the user's own program that signs instead, with ``{file}`` and ``{signature}``.
    dcc
        Whether ``certificate.xml`` is written as well, see `recoil_daq.certificates.dcc`.
    overwrite
        Whether a certificate that is there is replaced.
    progress
        Function called with the name of each step.

    Raises
    ------
    ReadError, RigError
        If a document or the header is missing, at fault, or was changed after it was written.
    IdentificationError
        If the result is not valid, and the header states no concession.
    StoreError
        If a certificate is there already or cannot be written, an extra is missing, or a program fails.
    """
    if not PDF.is_installed:
        raise StoreError(f"{PDF.module}, which a certificate needs, is not installed", remedy=PDF.remedy)
    output = Output(Path(out), pdf=True, standalone=True, overwrite=overwrite)
    folder = output.out
    output.refuse_unwritable(folder, FILES)
    signer = _signer(sign, sign_with)
    stated = read_header(Path(header))
    progress("read")
    sources = Sources.find(Path(of))
    issued = issued_for(sources, stated, Path(header))
    forms = Forms.now(pdf=True, standalone=True)
    progress("draw")
    document = certified(sources, issued, InputFile.of(Path(header)), forms, signer is not None, dcc)
    pages = certificate_pages(document, forms)

    def write(partial: Path) -> None:
        (partial / CERTIFICATE_FILE).write_bytes(json_bytes(document))
        (partial / CERTIFICATE_PAGE).write_text(pages.page, encoding="utf-8", newline="\n")
        (partial / CERTIFICATE_PDF).write_bytes(pages.pdf or b"")
        for name, content in pages.besides.items():
            (partial / name).write_bytes(content)
        for name in signed_files(document):
            if signer is not None:
                progress(f"sign {name}")
                signer.sign(partial / name)

    publish(folder, write, obsolete=FILES)
    return Certified(document, folder)


def issued_for(sources: Sources, stated: Issue, header: Path) -> Issue:
    """Return the identity of a certificate: the header's, and of its document what belongs to the customer.

    Raises
    ------
    ReadError
        If the header has no number.
    IdentificationError
        If the result is not valid, and the header states no concession.
    """
    of = sources.of
    if stated.number is None:
        raise ReadError(
            "a certificate has a number of its own, and this header states none", path=header,
            expected=f'`number`, such as number = "K-2026-17" or "K-{SHOT}"', remedy="write it there",
        )  # fmt: skip
    document = of.document
    if not document["valid"] and stated.concession is None:
        reason = next(iter(document["reasons"]), "no reason was given")
        raise IdentificationError(
            f"the result is not valid, and no certificate is made of it: {reason}", code=ErrorCode.NOT_VALID,
            path=of.path, expected="a valid result, or a `concession` in the header that says who accepts it, and why",
        )  # fmt: skip
    with told_in_one_line("this document has no identity that can be read", of.path):
        other = Issue.model_validate(document.get("issued") or {}).of_another()
    kind, name = (CAMPAIGN, of.path.absolute().parent.name) if "shots" in document else (SHOT, str(document["shot"]))
    return stated.over(other).named(kind, name)


def certified(
    sources: Sources, issued: Issue, header: InputFile, forms: Forms, signed: bool, dcc: bool
) -> dict[str, Any]:
    """Return the document of a certificate.

    Parameters
    ----------
    signed, dcc
        Whether signatures, and a DCC, stand beside it.

    Raises
    ------
    ReadError
        If something is missing that a certificate, or a DCC, states.
    """
    inputs = [*sources.inputs, {"file": header.name, "kind": Behind.HEADER, "sha256": header.sha256}]
    remedy = "an earlier version did not state all that a certificate has: identify the shots anew"
    with told_in_one_line("no certificate can be made of this document", sources.of.path, remedy=remedy):
        document = certificate_document(
            sources.of.document, [one.document for one in sources.reports], issued, version=__version__, inputs=inputs,
            drawn=forms.to_json(), dcc=SCHEMA_VERSION if dcc else None,
            signatures=[f"{name}{SUFFIX}" for name in _files_to_sign(dcc)] if signed else (),
        )  # fmt: skip
    if dcc:
        refuse_without_facts(document, sources.of.path, header.name)
    return document


def signed_files(document: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of the files of a certificate that are signed where one is."""
    return _files_to_sign(has_dcc(document))


def has_dcc(document: Mapping[str, Any]) -> bool:
    """Whether a certificate says that a DCC was written with it."""
    return document["provenance"].get(DCC) is not None


def _files_to_sign(dcc: bool) -> tuple[str, ...]:
    return SIGNED if dcc else SIGNED[:-1]


def certificate_pages(document: Mapping[str, Any], forms: Forms) -> Pages:
    """Draw a certificate, and write its DCC where it has one."""
    pdf = certificate_pdf(document) if forms.pdf else None
    besides = {DCC_FILE: dcc_bytes(document)} if has_dcc(document) else {}
    return Pages(CERTIFICATE_PAGE, render_certificate_page(document), CERTIFICATE_PDF, pdf, (), besides=besides)


def _signer(sign: str | Path | None, sign_with: str) -> Signer | None:
    if sign is None and not sign_with:
        return None
    signer = Signer(None if sign is None else Path(sign), sign_with)
    signer.check()
    return signer
