"""XML of a foreign hand, and its signature: what is read is what was signed, whole and not revoked.

XML Signature Syntax and Processing (W3C) and XAdES (ETSI EN 319 132), checked by ``signxml``. Entities and document
types are refused, nothing is loaded from anywhere, and of a signed document all that is read is of the
signed part.
"""

from __future__ import annotations

import base64
import datetime as dt
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.packages.extras import DCC

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

LARGEST_BYTES = 16_000_000
"""Most bytes of such a document: certificates with pictures have some megabytes."""
_DS = "{http://www.w3.org/2000/09/xmldsig#}"
_XADES = "{http://uri.etsi.org/01903/v1.3.2#}"
LISTS = (".crl",)
"""Ends of the names of lists of revoked certificates, DER or PEM, that lie beside a document."""


@dataclass(frozen=True)
class SignedXml:
    """A document, and who signed it.

    Attributes
    ----------
    root
        Root element, of lxml: of a signed document the signed one.
    signer
        Name of who signed it, as the signer's certificate has it; None of a document without a signature.
    """

    root: Any
    signer: str | None


def read_signed_xml(path: Path, what: str) -> SignedXml:
    """Read a document, and check its signature where it has one.

    Parameters
    ----------
    what
        Kind of document that it should be, for messages.

    Raises
    ------
    ReadError
        If ``signxml`` is not installed, the file is not there or too large.
    CorruptFileError
        If it is no XML, has a document type, was changed after it was signed, or its signer is revoked.
    """
    DCC.check(path)
    content = read_small(path, LARGEST_BYTES, what)
    root = _parsed(content, path, what)
    signatures = list(root.iter(f"{_DS}Signature"))
    if not signatures:
        return SignedXml(root, None)
    if len(signatures) > 1:
        remedy = "ask the laboratory for one that it signed once"
        raise CorruptFileError(
            "it is signed several times", path=path, expected="one signature",
            found=f"{len(signatures)} of them", remedy=remedy,
        )  # fmt: skip
    signer = _signer(signatures[0], path)
    signed = _verified(content, signatures[0], signer, root.tag, path)
    _refuse_revoked(signer, signatures[0], path)
    return SignedXml(signed, signer.subject.rfc4514_string())


def _parsed(content: bytes, path: Path, what: str) -> Any:
    from lxml import etree

    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, dtd_validation=False, huge_tree=False
    )
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise CorruptFileError("it is no XML", path=path, expected=what, found=str(error)) from error
    if root.getroottree().docinfo.doctype or any(True for _ in root.iter(etree.Entity)):
        raise CorruptFileError(
            "it has a document type or entities, which no such document needs", path=path, expected=what,
            remedy="ask who issued it for one without",
        )  # fmt: skip
    return root


def _signer(signature: Any, path: Path) -> Certificate:
    from cryptography import x509

    texts = [one.text or "" for one in signature.iter(f"{_DS}X509Certificate")]
    try:
        return x509.load_der_x509_certificate(base64.b64decode("".join(texts[0].split()), validate=True))
    except (IndexError, ValueError) as error:
        raise _unchecked(path, "it names no signer's certificate") from error


def _verified(content: bytes, signature: Any, signer: Certificate, tag: str, path: Path) -> Any:
    """Return the root of what was signed."""
    from cryptography.exceptions import UnsupportedAlgorithm
    from signxml.exceptions import InvalidCertificate, InvalidSignature, SignXMLException
    from signxml.verifier import SignatureConfiguration, XMLVerifier
    from signxml.xades.xades import XAdESVerifier

    verifier = XMLVerifier() if next(signature.iter(f"{_XADES}QualifyingProperties"), None) is None else XAdESVerifier()
    count = len(signature.findall(f"{_DS}SignedInfo/{_DS}Reference"))
    config = SignatureConfiguration(expect_references=count, verification_time=_signed_at(signature, signer, path))
    try:
        found = verifier.verify(content, x509_cert=signer, expect_config=config)
    except InvalidCertificate as error:
        raise _unchecked(path, str(error)) from error
    except InvalidSignature as error:
        raise CorruptFileError(
            "it was changed after it was signed", path=path, expected="what its signature is of", found=str(error),
            remedy="take the file as the laboratory sent it",
        ) from error  # fmt: skip
    except (SignXMLException, UnsupportedAlgorithm, ValueError, TypeError, KeyError, AttributeError) as error:
        raise _unchecked(path, str(error)) from error
    results: Sequence[Any] = found if isinstance(found, list) else [found]
    # of a document into which another one was wrapped the signed one is not the root
    signed = next((one.signed_xml for one in results if one.signed_xml is not None and one.signed_xml.tag == tag), None)
    if signed is None:
        raise _unchecked(path, "the whole document is not what was signed")
    return signed


def _signed_at(signature: Any, signer: Certificate, path: Path) -> dt.datetime:
    """Return when it was signed, as it says itself: by then its signer's certificate must have held.

    Where it does not say so a certificate that has run out since is taken as it was at its end.
    """
    said = next(signature.iter(f"{_XADES}SigningTime"), None)
    if said is None:
        return min(dt.datetime.now(dt.UTC), signer.not_valid_after_utc)
    try:
        at = dt.datetime.fromisoformat((said.text or "").strip())
    except ValueError as error:
        raise _unchecked(path, f"it was signed at {said.text!r}") from error
    return at if at.tzinfo is not None else at.replace(tzinfo=dt.UTC)


def _unchecked(path: Path, why: str) -> CorruptFileError:
    remedy = "ask the laboratory for one with a signature of the whole document (XML-DSig or XAdES, enveloped)"
    return CorruptFileError("its signature cannot be checked", path=path, found=why, remedy=remedy)


def _refuse_revoked(signer: Certificate, signature: Any, path: Path) -> None:
    """Refuse a signer whom a list in the document or beside it calls revoked."""
    for said, since in _revocations(signer, signature, path):
        raise CorruptFileError(
            f"the certificate of its signer was revoked on {since.date()}, {said} says", path=path,
            expected="a signer whose certificate holds", found=signer.subject.rfc4514_string(),
            remedy="ask the laboratory for one that is signed anew",
        )  # fmt: skip


def _revocations(signer: Certificate, signature: Any, path: Path) -> Iterator[tuple[str, dt.datetime]]:
    from cryptography.x509 import ocsp

    inside = "a list in the document"
    lists = [(inside, one.text or "") for one in signature.iter(f"{_XADES}EncapsulatedCRLValue")]
    for said, text in lists:
        yield from _listed(signer, text.encode("ascii", "replace"), said, path)
    for beside in sorted(path.parent.iterdir()):
        if beside.suffix.casefold() in LISTS:
            yield from _listed(
                signer, read_small(beside, LARGEST_BYTES, "a list of revoked certificates"), beside.name, beside
            )
    for one in signature.iter(f"{_XADES}EncapsulatedOCSPValue"):
        try:
            response = ocsp.load_der_ocsp_response(base64.b64decode(one.text or ""))
            answers = list(response.responses)
        except ValueError as error:
            raise _unchecked(path, f"an answer on its signer (OCSP) in it is none: {error}") from error
        for answer in answers:
            is_of_signer = answer.serial_number == signer.serial_number
            if is_of_signer and answer.certificate_status is ocsp.OCSPCertStatus.REVOKED:
                yield "an answer in the document", answer.revocation_time_utc or answer.this_update_utc


def _listed(signer: Certificate, content: bytes, said: str, path: Path) -> Iterator[tuple[str, dt.datetime]]:
    from cryptography import x509

    try:
        if content.lstrip().startswith(b"-----BEGIN"):
            found = x509.load_pem_x509_crl(content)
        else:  # of a document in base64
            der = content if content.startswith(b"\x30") and not content.isascii() else base64.b64decode(content)
            found = x509.load_der_x509_crl(der)
    except ValueError as error:
        raise ReadError(
            "it is no list of revoked certificates", path=path, expected="a CRL, DER or PEM", found=str(error)
        ) from error
    revoked = found.get_revoked_certificate_by_serial_number(signer.serial_number)
    if revoked is not None and found.issuer == signer.issuer:
        yield said, revoked.revocation_date_utc
