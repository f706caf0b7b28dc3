"""Docstrings open with what a thing is or does, not with a clause that lacks its subject."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.contracts.test_promises import PACKAGES, ROOT

WITHOUT_SUBJECT = ("Of", "Tell", "Tells", "What")


def without_subject(source: str) -> list[str]:
    """Return the first lines of a module's docstrings that have no subject."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    texts = [ast.get_docstring(node) for node in ast.walk(ast.parse(source)) if isinstance(node, documented)]
    return [text.splitlines()[0] for text in texts if text and text.split()[0] in WITHOUT_SUBJECT]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_docstring_of_a_package_opens_with_a_subject_or_a_verb(package: str) -> None:
    for module in sorted((ROOT / package).rglob("*.py")):
        assert without_subject(Path(module).read_text(encoding="utf-8")) == [], module


def test_a_docstring_without_a_subject_is_found() -> None:
    assert without_subject('def f():\n    """What it does.\n\n    More.\n    """') == ["What it does."]
    assert without_subject('"""Words of it."""\ndef f():\n    """Return what it does."""') == []
