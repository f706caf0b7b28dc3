"""Digital calibration certificates from text, signed by a laboratory that is made for the test."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

CERTIFICATE = r"""<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si" schemaVersion="3.2.1">
  <dcc:administrativeData>
    <dcc:coreData>
      <dcc:countryCodeISO3166_1>DE</dcc:countryCodeISO3166_1>
      <dcc:uniqueIdentifier>D-K-15055-2026-04711</dcc:uniqueIdentifier>
      <dcc:beginPerformanceDate>2026-02-26</dcc:beginPerformanceDate>
      <dcc:endPerformanceDate>2026-03-01</dcc:endPerformanceDate>
    </dcc:coreData>
    <dcc:items>
      <dcc:item>
        <dcc:name><dcc:content lang="en">Pressure sensor</dcc:content></dcc:name>
        <dcc:manufacturer><dcc:name><dcc:content>Maker</dcc:content></dcc:name></dcc:manufacturer>
        <dcc:model>6215</dcc:model>
        <dcc:identifications>
          <dcc:identification>
            <dcc:issuer>manufacturer</dcc:issuer>
            <dcc:value>V301</dcc:value>
            <dcc:name><dcc:content lang="en">Serial no.</dcc:content></dcc:name>
          </dcc:identification>
          <dcc:identification><dcc:issuer>customer</dcc:issuer><dcc:value>M-12</dcc:value></dcc:identification>
        </dcc:identifications>
      </dcc:item>
    </dcc:items>
  </dcc:administrativeData>
  <dcc:measurementResults>
    <dcc:measurementResult>
      <dcc:name><dcc:content>Results</dcc:content></dcc:name>
      <dcc:results>
        <dcc:result>
          <dcc:data>
            <dcc:quantity>
              <dcc:name><dcc:content>Temperature</dcc:content></dcc:name>
              <si:real><si:value>296.1</si:value><si:unit>\kelvin</si:unit></si:real>
            </dcc:quantity>
            <dcc:quantity>
              <dcc:name><dcc:content>Sensitivity</dcc:content></dcc:name>
              <si:real>
                <si:value>40.2</si:value>
                <si:unit>\milli\volt\per\mega\pascal</si:unit>
                <si:expandedUnc>
                  <si:uncertainty>0.402</si:uncertainty>
                  <si:coverageFactor>2.5</si:coverageFactor>
                  <si:coverageProbability>0.95</si:coverageProbability>
                </si:expandedUnc>
              </si:real>
            </dcc:quantity>
          </dcc:data>
        </dcc:result>
      </dcc:results>
    </dcc:measurementResult>
  </dcc:measurementResults>
</dcc:digitalCalibrationCertificate>
"""
"""A certificate of schema 3.2 as a laboratory writes it, shortened to what is read and some of what is not."""
FIRED = dt.datetime(2026, 3, 2, tzinfo=dt.UTC)


@dataclass(frozen=True)
class Laboratory:
    """A key, and the certificate that names whose it is."""

    key: ec.EllipticCurvePrivateKey
    certificate: x509.Certificate

    def signed(self, text: str = CERTIFICATE) -> bytes:
        """Sign a document, enveloped, as XAdES."""
        from lxml import etree
        from signxml.xades.xades import XAdESSigner

        root = etree.fromstring(text.encode("utf-8"))
        signer: Any = XAdESSigner(signature_algorithm="ecdsa-sha256", digest_algorithm="sha256")
        pem = self.certificate.public_bytes(serialization.Encoding.PEM)
        return bytes(etree.tostring(signer.sign(root, key=self.key, cert=pem), xml_declaration=True, encoding="UTF-8"))

    def revoking(self) -> bytes:
        """List of revoked certificates that names its own."""
        revoked = (
            x509.RevokedCertificateBuilder()
            .serial_number(self.certificate.serial_number)
            .revocation_date(FIRED)
            .build()
        )
        listed = x509.CertificateRevocationListBuilder().issuer_name(self.certificate.issuer)
        listed = listed.last_update(FIRED).next_update(FIRED + dt.timedelta(days=9999))
        signed = listed.add_revoked_certificate(revoked).sign(self.key, hashes.SHA256())
        return signed.public_bytes(serialization.Encoding.DER)


@lru_cache
def laboratory(name: str = "Calibration Lab") -> Laboratory:
    """Return a laboratory whose certificate is its own, and holds from 2020 on."""
    key, subject = ec.generate_private_key(ec.SECP256R1()), x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    built = x509.CertificateBuilder().subject_name(subject).issuer_name(subject).public_key(key.public_key())
    built = built.serial_number(x509.random_serial_number()).not_valid_before(dt.datetime(2020, 1, 1, tzinfo=dt.UTC))
    return Laboratory(key, built.not_valid_after(dt.datetime(2060, 1, 1, tzinfo=dt.UTC)).sign(key, hashes.SHA256()))
