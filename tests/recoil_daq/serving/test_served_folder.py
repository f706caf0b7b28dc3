"""The folder that is served: whatever path is asked for, what is opened lies in it, and is a page or of one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_daq.serving.served_folder import TYPES, ServedFolder

PARTS = st.sampled_from(
    [b"/", b"//", b"..", b".", b"%2e", b"%2f", b"%5c", b"\\", b"%00", b"a.html", b"sub", b"secret.html", b"outside",
     b"in", b"link", b"%", b"%25", b"\xc3\xbc", b"\xff", b":", b"C:", b" ", b"?", b"#", b"live.js", b"x.h5"]
)  # fmt: skip


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    with TemporaryDirectory() as name:
        root = Path(name)
        (root / "outside").mkdir()
        (root / "outside/secret.html").write_text("secret", encoding="utf-8")
        (root / "in/sub").mkdir(parents=True)
        for path in ("a.html", "sub/a.html", "live.js", "x.h5"):
            (root / "in" / path).write_text("served", encoding="utf-8")
        if os.name != "nt":
            (root / "in/link").symlink_to(root / "outside")
        yield root / "in"


@given(raw=st.one_of(st.binary(max_size=60), st.lists(PARTS, max_size=9).map(b"".join)))
def test_no_path_leads_out(folder: Path, raw: bytes) -> None:
    found = ServedFolder(folder).open(raw)
    if found is not None:
        with found.file:
            assert found.file.read() == b"served"
        assert Path(str(found.file.name)).suffix in TYPES


def test_a_folder_that_is_itself_a_link_is_served(folder: Path, tmp_path: Path) -> None:
    if os.name == "nt":
        pytest.skip("Windows lets nobody make links unasked")
    (tmp_path / "day").symlink_to(folder)
    found = ServedFolder(tmp_path / "day").open(b"/a.html")
    assert found is not None
    found.file.close()
