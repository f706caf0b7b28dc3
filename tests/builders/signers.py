"""A laboratory's key with its certificate, as one PEM file: what signs a certificate."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Literal

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding, NoEncryption, PrivateFormat

Key = ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey


def signer(
    path: Path,
    name: str,
    kind: Literal["ec", "rsa"] = "ec",
    issuer: tuple[str, Key] | None = None,
    password: bytes = b"",
) -> Key:
    """Write a key with its certificate to a PEM file, and its certificate alone beside it, ``.crt``; return the key.

    Parameters
    ----------
    issuer
        Name and key of who issues the certificate; it is of its own key if left out.
    """
    key: Key = ec.generate_private_key(ec.SECP256R1()) if kind == "ec" else rsa.generate_private_key(65537, 2048)
    by, by_key = issuer or (name, key)
    when = dt.datetime(2026, 1, 1, tzinfo=dt.UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(_named(name))
        .issuer_name(_named(by))
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(when)
        .not_valid_after(when + dt.timedelta(days=3650))
        .sign(by_key, SHA256())
        .public_bytes(Encoding.PEM)
    )
    hidden = BestAvailableEncryption(password) if password else NoEncryption()
    path.write_bytes(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, hidden) + certificate)
    path.with_suffix(".crt").write_bytes(certificate)
    return key


def _named(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
