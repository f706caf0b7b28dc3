"""The suite's own bytecode: kept where Python looks for it, and compiled by one of two workers."""

from __future__ import annotations

import errno
import importlib.util
import os
import py_compile
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.builders.bytecode import collects_backwards, in_order, link_installed


@pytest.mark.skipif(not hasattr(Path, "symlink_to"), reason="there are no links here")
def test_what_is_installed_is_found_where_python_looks_for_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = tmp_path / "site-packages"
    (place / "package").mkdir(parents=True)
    source = place / "package" / "module.py"
    source.write_text("", encoding="utf-8")
    monkeypatch.setattr("sys.pycache_prefix", None)
    compiled = Path(py_compile.compile(str(source), doraise=True))
    link_installed(tmp_path / "kept", [place])
    monkeypatch.setattr("sys.pycache_prefix", str(tmp_path / "kept"))
    found = Path(importlib.util.cache_from_source(str(source)))
    assert found.samefile(compiled)
    link_installed(tmp_path / "kept", [place])
    # what is compiled anew leaves alone what is installed
    before = compiled.read_bytes()
    source.write_text("changed = True", encoding="utf-8")
    py_compile.compile(str(source), doraise=True)
    assert found.read_bytes() != before
    assert compiled.read_bytes() == before


def test_what_is_installed_on_another_disk_is_found_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise OSError(errno.EXDEV, "Invalid cross-device link")

    cached = tmp_path / "site-packages" / "__pycache__" / "module.pyc"
    cached.parent.mkdir(parents=True)
    cached.write_bytes(b"compiled")
    monkeypatch.setattr(os, "link", refused)
    for _ in range(2):
        link_installed(tmp_path / "kept", [tmp_path / "site-packages"])
    (found,) = (tmp_path / "kept").rglob("module.pyc")
    assert found.resolve() == cached.resolve()


def test_every_second_worker_collects_backwards_and_all_end_in_one_order(monkeypatch: pytest.MonkeyPatch) -> None:
    backwards = []
    for worker in ("gw0", "gw1", "gw2"):
        monkeypatch.setenv("PYTEST_XDIST_WORKER", worker)
        backwards.append(collects_backwards())
    monkeypatch.delenv("PYTEST_XDIST_WORKER")
    assert [*backwards, collects_backwards()] == [False, True, False, False]
    names = ("b/test_a.py:2", "b/test_a.py:1", "a_b/test_z.py:1", "a/test_c.py:1", "a/d/test_b.py:1")
    items = [SimpleNamespace(path=Path(name.partition(":")[0]), name=name) for name in names]
    in_order(items)  # type: ignore[arg-type]
    assert [item.name for item in items] == [*reversed(names[3:]), names[2], *names[:2]]
