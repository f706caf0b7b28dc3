"""Detached signatures: made and verified by a key, by another program, and never taken for what they are not."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.packages.extras import Extra
from recoil_daq.certificates.signature import Signer, State, Trust, verified
from tests.builders.signers import signer

CONTENT = b'{"mass": 782.0}\n'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file to be signed, beside the keys of a laboratory and of a forger."""
    signer(tmp_path / "lab.pem", "Laboratory")
    signer(tmp_path / "forger.pem", "Laboratory")
    path = tmp_path / "certificate.json"
    path.write_bytes(CONTENT)
    return path


@pytest.mark.parametrize("kind", ["ec", "rsa"])
def test_what_a_key_signed_is_known_again_and_nothing_else_is(tmp_path: Path, file: Path, kind) -> None:
    signer(tmp_path / "other.pem", "Other", kind)
    signature = Signer(key=tmp_path / "other.pem").sign(file)
    known, nobody = Trust(signer=tmp_path / "other.crt"), Trust()
    assert signature.name == "certificate.json.sig"
    assert known.verdict(file, signature).state is State.HOLDS
    assert nobody.verdict(file, signature).state is State.OF_SOMEBODY
    assert "CN=Other" in nobody.verdict(file, signature).said
    file.write_bytes(CONTENT.replace(b"782", b"792"))
    for trust in (known, nobody):
        assert trust.verdict(file, signature).state is State.FAILS


def test_each_byte_of_a_signature_counts(file: Path) -> None:
    signature = Signer(key=file.with_name("lab.pem")).sign(file).read_bytes()
    for place in range(len(signature) - 72, len(signature)):
        changed = bytearray(signature)
        changed[place] ^= 1
        assert verified(CONTENT, bytes(changed)).state in (State.FAILS, State.NOT_READ)


def test_another_key_under_the_same_name_is_another_signer(file: Path) -> None:
    signature = Signer(key=file.with_name("forger.pem")).sign(file)
    found = Trust(signer=file.with_name("lab.crt")).verdict(file, signature)
    assert (found.state, "not by whom --signer names" in found.said) == (State.FAILS, True)


def test_a_signer_may_be_trusted_by_who_issued_the_certificate(tmp_path: Path, file: Path) -> None:
    authority = signer(tmp_path / "authority.pem", "Authority")
    signer(tmp_path / "lab2.pem", "Laboratory 2", issuer=("Authority", authority))
    signature = Signer(key=tmp_path / "lab2.pem").sign(file)
    assert Trust(signer=tmp_path / "authority.crt").verdict(file, signature).state is State.HOLDS
    assert Trust(signer=tmp_path / "lab.crt").verdict(file, signature).state is State.FAILS


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl on this machine to compare with")
@pytest.mark.parametrize("options", [[], ["-noattr"], ["-md", "sha512"]])
def test_openssl_takes_ours_and_we_take_openssl_s(tmp_path: Path, file: Path, options: list[str]) -> None:
    ours = Signer(key=file.with_name("lab.pem")).sign(file)
    lab = str(file.with_name("lab.crt"))
    content = ["-binary", "-content", str(file), "-out", str(tmp_path / "out")]
    verify = ["openssl", "cms", "-verify", "-inform", "DER", "-in", str(ours), "-CAfile", lab, "-purpose", "any"]
    subprocess.run([*verify, *content], check=True, capture_output=True)
    theirs, pem = tmp_path / "theirs.sig", str(file.with_name("lab.pem"))
    sign = ["openssl", "cms", "-sign", "-binary", "-in", str(file), "-signer", pem, "-outform", "DER"]
    subprocess.run([*sign, *options, "-out", str(theirs)], check=True, capture_output=True)
    assert Trust(signer=file.with_name("lab.crt")).verdict(file, theirs).state is State.HOLDS


def test_the_user_s_own_program_signs_and_verifies(tmp_path: Path, file: Path) -> None:
    script = tmp_path / "own program.py"
    script.write_text(
        "import sys, hashlib; from pathlib import Path\n"
        "way, file, signature = sys.argv[1:]\n"
        "digest = hashlib.sha256(Path(file).read_bytes()).hexdigest()\n"
        "if way == 'sign': Path(signature).write_text(digest)\n"
        "else: sys.exit(0 if Path(signature).read_text() == digest else 'another file')\n",
        encoding="utf-8",
    )
    program = f"{sys.executable} '{script}' %s {{file}} {{signature}}"
    own = Signer(program=program % "sign")
    own.check()
    signature = own.sign(file)
    assert Trust(program=program % "verify").verdict(file, signature).state is State.HOLDS
    assert Trust().verdict(file, signature).state is State.NOT_READ
    file.write_bytes(b"other")
    found = Trust(program=program % "verify").verdict(file, signature)
    assert (found.state, "another file" in found.said) == (State.FAILS, True)


@pytest.mark.parametrize("signature", [b"", b"\x30", b"\x30\x80" * 400, b"{}", b"\x30\x03\x02\x01\x05", bytes(5000)])
def test_what_is_no_signature_is_said_to_be_none(signature: bytes) -> None:
    assert verified(CONTENT, signature).state is State.NOT_READ


def test_what_cannot_sign_is_refused_before_anything_is_made(tmp_path: Path, file: Path) -> None:
    signer(tmp_path / "hidden.pem", "Hidden", password=b"secret")
    for name, said in (
        ("hidden.pem", "encrypted"),
        ("lab.crt", "no private key"),
        ("certificate.json", "no private key"),
    ):
        with pytest.raises(ReadError, match=said):
            Signer(key=tmp_path / name).check()
    key_alone = tmp_path / "alone.pem"
    key_alone.write_bytes(file.with_name("lab.pem").read_bytes().partition(b"-----BEGIN CERT")[0])
    with pytest.raises(ReadError):
        Signer(key=key_alone).check()
    key_alone.write_bytes(key_alone.read_bytes() + file.with_name("forger.crt").read_bytes())
    with pytest.raises(ReadError, match="no certificate of this key"):
        Signer(key=key_alone).check()
    with pytest.raises(StoreError, match="told which file"):
        Signer(program="gpg {file}").check()
    for program in ("no-such-program {file} {signature}", f"{sys.executable} -c 0 {{file}} {{signature}}"):
        with pytest.raises(StoreError):
            Signer(program=program).sign(file)
    with pytest.raises(ReadError, match=r"no X\.509 certificate"):
        Trust(signer=file).verdict(file, Signer(key=file.with_name("lab.pem")).sign(file))


def test_without_the_extra_the_error_names_it(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Extra, "is_installed", False)
    with pytest.raises(StoreError, match="asn1crypto, which signatures need, is not installed") as caught:
        Signer(key=file.with_name("lab.pem")).check()
    assert caught.value.remedy == "pip install 'asn1crypto>=1.5'"
