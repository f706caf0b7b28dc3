"""A detached signature beside a file: made by a kept library, or by the user's own program.

A signature by a key is a CMS ``SignedData`` without its content (RFC 5652), DER: ``openssl cms -verify -inform DER``
takes it as well. It says that who has the key signed these bytes; whose key it is, is for the reader to know, who names
the signer's certificate, or that of who issued it.
"""

from __future__ import annotations

import hashlib
import shlex
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.packages.extras import SIGN, SIGN_KEYS

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

SUFFIX = ".sig"
"""End of the name of a signature, behind that of its file."""
LARGEST_BYTES = 1_000_000
"""Bytes of a key, a certificate or a signature, beyond which it is none."""
LONGEST_S = 300.0
"""Time that a program may take: it may ask for a PIN."""
SECURE = ("sha256", "sha384", "sha512")
"""Digests of a signature that count."""


class State(StrEnum):
    """State of a signature that was verified."""

    HOLDS = "holds"
    OF_SOMEBODY = "of somebody"
    """It holds, and nobody said whose it should be."""
    NOT_READ = "not read"
    """It is of a kind that is not known here."""
    FAILS = "fails"


class Verdict(NamedTuple):
    """State of a signature, and who signed or why it is none."""

    state: State
    said: str


@dataclass(frozen=True)
class Signer:
    """Key or program that signs files.

    Attributes
    ----------
    key
        File with a private key and its certificate, PEM; None where a program signs.
    program
        Command of the user's own program, with ``{file}`` and ``{signature}``; empty where a key signs.
    """

    key: Path | None = None
    program: str = ""

    def check(self) -> None:
        """Raise StoreError or ReadError where it cannot sign at all, before anything is written."""
        if self.key is not None:
            _key_and_certificate(self.key)
        elif "{file}" not in self.program or "{signature}" not in self.program:
            raise StoreError(
                "a program that signs is told which file, and where its signature goes",
                expected="{file} and {signature} in --sign-with", found=self.program,
                remedy='such as --sign-with "gpg --detach-sign --output {signature} {file}"',
            )  # fmt: skip

    def sign(self, file: Path) -> Path:
        """Sign a file, and return the signature, which stands beside it.

        Raises
        ------
        StoreError
            If the program fails or writes nothing.
        """
        signature = file.with_name(file.name + SUFFIX)
        if self.key is not None:
            signature.write_bytes(_signed(file.read_bytes(), self.key))
            return signature
        _run(self.program, file, signature)
        if not signature.is_file():
            raise StoreError("the program wrote no signature", path=file, found=self.program, remedy="run it by hand")
        return signature


@dataclass(frozen=True)
class Trust:
    """Knowledge of a reader on whose a signature should be.

    Attributes
    ----------
    signer
        Certificate of the signer, or of who issued it, PEM; None where nobody says whose signature it should be.
    program
        Command of the program that verifies a signature, with ``{file}`` and ``{signature}``; empty for that of a key.
    """

    signer: Path | None = None
    program: str = ""

    def verdict(self, file: Path, signature: Path) -> Verdict:
        """Verify a signature, with errors as of `verified`."""
        if self.program:
            try:
                _run(self.program, file, signature)
            except StoreError as error:
                return Verdict(State.FAILS, str(error))
            return Verdict(State.HOLDS, "by the program of --verify-with")
        return verified(file.read_bytes(), read_small(signature, LARGEST_BYTES, "a signature"), self.signer)


NOBODY = Trust()
"""Trust of a reader who does not say whose a signature should be."""


def verified(content: bytes, signature: bytes, trusted: Path | None = None) -> Verdict:
    """Verify a detached CMS signature.

    Parameters
    ----------
    trusted
        Certificate of the signer, or of who issued it; None where nobody says whose it should be.

    Raises
    ------
    StoreError
        If the extra is missing.
    ReadError
        If the file of the trusted certificate is none.
    """
    _require()
    from asn1crypto import cms
    from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm

    try:
        info = cms.ContentInfo.load(signature, strict=True)
        known = info["content_type"].native == "signed_data"
    except (ValueError, TypeError):
        known = False
    if not known:
        return Verdict(State.NOT_READ, "it is no CMS signature: verify it with the program that made it, --verify-with")
    try:
        (signer,) = info["content"]["signer_infos"]
        certificate = _certificate_of(signer, info["content"]["certificates"])
        name = signer["digest_algorithm"]["algorithm"].native
        if name not in SECURE:
            return Verdict(State.FAILS, f"its digest is {name}, which does not count any more")
        signed = content
        if len(signer["signed_attrs"]):
            stated = {one["type"].native: one["values"] for one in signer["signed_attrs"]}
            if stated["message_digest"][0].native != hashlib.new(name, content).digest():
                return Verdict(State.FAILS, "the file is not the one that was signed")
            signed = signer["signed_attrs"].untag().dump()
        _verify(certificate, signer, name, signed)
    except InvalidSignature:
        return Verdict(State.FAILS, "the file is not the one that was signed, or the signature was changed")
    except (ValueError, TypeError, KeyError, LookupError, AttributeError, UnsupportedAlgorithm) as error:
        return Verdict(State.FAILS, f"it is damaged: {error}".partition("\n")[0])
    fingerprint = hashlib.sha256(_der(certificate)).hexdigest()
    subject = f"{certificate.subject.rfc4514_string()} (certificate SHA-256 {fingerprint})"
    if trusted is None:
        return Verdict(State.OF_SOMEBODY, f"it holds, and is signed by {subject}; --signer tells whose it should be")
    if not _is_of(certificate, _certificates(trusted)):
        return Verdict(State.FAILS, f"it is signed by {subject}, and not by whom --signer names")
    return Verdict(State.HOLDS, f"by {subject}")


def _require() -> None:
    for extra in (SIGN, SIGN_KEYS):
        if not extra.is_installed:
            raise StoreError(f"{extra.module}, which signatures need, is not installed", remedy=extra.remedy)


def _key_and_certificate(path: Path) -> tuple[Any, Certificate]:
    """Read a private key and its certificate of one PEM file."""
    _require()
    from cryptography.hazmat.primitives.asymmetric import ec, rsa
    from cryptography.hazmat.primitives.serialization import load_pem_private_key
    from cryptography.x509 import load_pem_x509_certificates

    content = read_small(path, LARGEST_BYTES, "a key")
    try:
        key = load_pem_private_key(content, None)
        of_key = [one for one in load_pem_x509_certificates(content) if one.public_key() == key.public_key()]
    except (ValueError, TypeError) as error:
        hidden = isinstance(error, TypeError)  # of a key that is encrypted
        raise ReadError(
            "this is no private key with its certificate" if not hidden else "this private key is encrypted", path=path,
            expected="both in one PEM file, the key without a password", found=str(error).partition("\n")[0],
            remedy='let your own program sign: --sign-with "openssl cms -sign .. -out {signature} -in {file}"',
        ) from error  # fmt: skip
    if not of_key or not isinstance(key, ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey):
        raise ReadError(
            "no certificate of this key in the file" if not of_key else "a key of this kind does not sign here",
            path=path, expected="an RSA or EC key, and its X.509 certificate, in one PEM file",
            remedy="write both into one file: cat key.pem certificate.pem > signer.pem",
        )  # fmt: skip
    return key, of_key[0]


def _signed(content: bytes, path: Path) -> bytes:
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.hazmat.primitives.serialization import Encoding
    from cryptography.hazmat.primitives.serialization.pkcs7 import PKCS7Options, PKCS7SignatureBuilder

    key, certificate = _key_and_certificate(path)
    builder = PKCS7SignatureBuilder().set_data(content).add_signer(certificate, key, SHA256())
    return builder.sign(Encoding.DER, [PKCS7Options.DetachedSignature, PKCS7Options.Binary])


def _certificate_of(signer: Any, certificates: Any) -> Certificate:
    """Return the certificate, of those in a signature, that a signer names."""
    from cryptography.x509 import load_der_x509_certificate

    named = signer["sid"].chosen
    for one in certificates:
        certificate = one.chosen
        if certificate.serial_number == named["serial_number"].native and certificate.issuer == named["issuer"]:
            return load_der_x509_certificate(certificate.dump())
    raise LookupError("the certificate of who signed is not in it")


def _verify(certificate: Certificate, signer: Any, digest: str, signed: bytes) -> None:
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec, padding, rsa

    known: dict[str, hashes.HashAlgorithm] = {
        "sha256": hashes.SHA256(), "sha384": hashes.SHA384(), "sha512": hashes.SHA512(),
    }  # fmt: skip
    hashed = known[digest]
    key, signature = certificate.public_key(), signer["signature"].native
    if isinstance(key, rsa.RSAPublicKey):
        if signer["signature_algorithm"].signature_algo == "rsassa_pss":
            pss = padding.PSS(padding.MGF1(hashed), padding.PSS.AUTO)
            key.verify(signature, signed, pss, hashed)
        else:
            key.verify(signature, signed, padding.PKCS1v15(), hashed)
    elif isinstance(key, ec.EllipticCurvePublicKey):
        key.verify(signature, signed, ec.ECDSA(hashed))
    else:
        raise TypeError("a key of a kind that is not known")


def _der(certificate: Certificate) -> bytes:
    from cryptography.hazmat.primitives.serialization import Encoding

    return certificate.public_bytes(Encoding.DER)


def _certificates(path: Path) -> Sequence[Certificate]:
    from cryptography.x509 import load_pem_x509_certificates

    try:
        return load_pem_x509_certificates(read_small(path, LARGEST_BYTES, "a certificate"))
    except ValueError as error:
        raise ReadError(
            "this is no X.509 certificate", path=path, expected="PEM, of the signer or of who issued its certificate",
            found=str(error).partition("\n")[0],
        ) from error  # fmt: skip


def _is_of(certificate: Certificate, trusted: Sequence[Certificate]) -> bool:
    """Whether a certificate is one of those that are trusted, or was issued by one of them."""
    from cryptography.exceptions import InvalidSignature

    for one in trusted:
        if one == certificate:
            return True
        try:
            certificate.verify_directly_issued_by(one)
        except (ValueError, TypeError, InvalidSignature):
            continue
        return True
    return False


def _run(command: str, file: Path, signature: Path) -> None:
    """Run the user's own program; no shell takes part in it."""
    words = [word.replace("{file}", str(file)).replace("{signature}", str(signature)) for word in shlex.split(command)]
    try:
        done = subprocess.run(words, capture_output=True, timeout=LONGEST_S, check=False)  # noqa: S603 - the user's own
    except (OSError, subprocess.SubprocessError, ValueError) as error:
        raise StoreError("the program cannot be run", path=file, found=f"{command}: {error}") from error
    if done.returncode != 0:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise StoreError(
            f"the program ended with {done.returncode}", path=file, found=": ".join((command, *said[-1:])),
            remedy="run it by hand",
        )  # fmt: skip
