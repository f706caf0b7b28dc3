"""Docstrings open with what a thing is or does, not with a clause that lacks its subject, and refer to what exists."""

from __future__ import annotations

import ast
import builtins
import re
from collections.abc import Iterator, Sequence
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import pytest

from tests.contracts.test_promises import PACKAGES, ROOT

pytestmark = pytest.mark.indispensable("law")

WITHOUT_SUBJECT = ("Of", "Tell", "Tells", "What")
"""Words that open no docstring."""
NOT_A_NOUN = {
    "Also", "And", "Are", "As", "At", "Before", "Behind", "Beside", "Both", "By", "Else", "From", "Gives", "Has",
    "Have", "How", "If", "In", "Is", "It", "Its", "Of", "On", "Only", "Or", "Said", "States", "Tell", "Tells",
    "That", "These", "This", "Those", "To", "Told", "Too", "Until", "What", "When", "Where", "Which", "Whose",
    "Why", "With", "Without",
}  # fmt: skip
"""Words that open no entry of attributes or parameters: it is read alone, and begins with the noun that it is about."""
HELP_TEXTS = Path("recoil_daq", "commands")
"""Folder whose docstrings a terminal prints: backticks are what a user types."""
SECTIONS = ("Attributes", "Parameters")
REFERENCE = re.compile(r"(?<!`)`([A-Za-z_][\w.]*)(?:\(\))?`(?!`)")
"""Name in single backticks."""
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def modules(package: str) -> list[Path]:
    """Return the modules of a package."""
    return sorted((ROOT / package).rglob("*.py"))


def without_subject(source: str) -> list[str]:
    """Return the first lines of a module's docstrings that have no subject."""
    texts = [ast.get_docstring(node) for node in ast.walk(ast.parse(source)) if isinstance(node, DOCUMENTED)]
    return [text.splitlines()[0] for text in texts if text and text.split()[0] in WITHOUT_SUBJECT]


def entries(docstring: str) -> Iterator[tuple[str, str]]:
    """Yield name and first line of each entry of the sections about attributes and parameters."""
    lines, section = docstring.splitlines(), ""
    for line, following in pairwise([*lines, ""]):
        if re.fullmatch("-{3,}", following):
            section = line
        elif section in SECTIONS and re.match(r"[^\s-]", line) and following.startswith("    "):
            yield line, following.strip()


def without_noun(source: str) -> list[str]:
    """Return the entries of a module's docstrings that do not open with a noun."""
    texts = [ast.get_docstring(node) or "" for node in ast.walk(ast.parse(source)) if isinstance(node, DOCUMENTED)]
    told = [entry for text in texts for entry in entries(text)]
    return [f"{name}: {first}" for name, first in told if first.split()[0].strip(",.;:") in NOT_A_NOUN]


def texts_of(tree: ast.Module) -> Iterator[str]:
    """Yield the docstrings of a module, and those below its constants and fields."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value.value


def known_names(tree: ast.Module) -> set[str]:
    """Return what a reference without a module may mean: names that a module defines, takes or uses."""
    names = set(dir(builtins))
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            names.add(node.id)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
        elif isinstance(node, ast.Attribute):
            names.add(node.attr)
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
    return names


def exists(dotted: str) -> bool:
    """Return whether a dotted name is a module, or something in one."""
    parts = dotted.split(".")
    for length in range(len(parts), 0, -1):
        try:
            found = import_module(".".join(parts[:length]))
        except ImportError:
            continue
        for name in parts[length:]:
            fields = getattr(found, "__dataclass_fields__", {})
            if not hasattr(found, name) and name not in fields:
                return False
            found = getattr(found, name, None)
        return True
    return False


def lost_references(source: str, *rooms: str) -> list[str]:
    """Return what stands in single backticks and means nothing.

    Parameters
    ----------
    *rooms
        Packages in which a reference may begin; else it is a name of the module, or a whole dotted name.
    """
    tree = ast.parse(source)
    names = known_names(tree)
    referred = {one for text in texts_of(tree) for one in REFERENCE.findall(text)}
    return sorted(one for one in referred if one.split(".")[0] not in names and not _found(one, rooms))


def _found(name: str, rooms: Sequence[str]) -> bool:
    return ("." in name and exists(name)) or any(exists(f"{room}.{name}") for room in rooms)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_docstring_of_a_package_opens_with_a_subject_or_a_verb(package: str) -> None:
    for module in modules(package):
        assert without_subject(module.read_text("utf-8")) == [], module


@pytest.mark.parametrize("package", PACKAGES)
def test_every_entry_of_attributes_and_parameters_opens_with_a_noun(package: str) -> None:
    for module in modules(package):
        assert without_noun(module.read_text("utf-8")) == [], module


@pytest.mark.parametrize("package", PACKAGES)
def test_every_reference_of_a_docstring_resolves(package: str) -> None:
    floor = package.rsplit("/", maxsplit=1)[-1]
    for module in modules(package):
        if module.parent == ROOT / HELP_TEXTS:
            continue
        room = ".".join((floor, *module.parent.relative_to(ROOT / package).parts))
        assert lost_references(module.read_text("utf-8"), floor, room) == [], module


def test_a_docstring_without_a_subject_is_found() -> None:
    assert without_subject('def f():\n    """What it does.\n\n    More.\n    """') == ["What it does."]
    assert without_subject('"""Words of it."""\ndef f():\n    """Return what it does."""') == []


def test_an_entry_without_a_noun_is_found() -> None:
    section = "    Attributes\n    ----------\n    a\n        Of it.\n    b\n        Name of it.\n"
    source = f'class A:\n    """One.\n\n{section}    """'
    assert without_noun(source) == ["a: Of it."]


def test_a_reference_to_nothing_is_found() -> None:
    assert lost_references('"""See `gone`, `recoil_rigs.rig.Rig.gone` and `recoil_nothing.at_all`."""') == [
        "gone",
        "recoil_nothing.at_all",
        "recoil_rigs.rig.Rig.gone",
    ]
    assert lost_references('"""See `here`, ``code`` and `recoil_rigs.rig.Rig.by_role`."""\nhere = 1') == []
