"""A text that is written has the same bytes on every system: no module leaves the ends of lines to it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.contracts.test_promises import PACKAGES, ROOT

pytestmark = pytest.mark.indispensable("law")


def left_to_the_system(source: str) -> list[int]:
    """Return the lines of a module on which a file's text is written with the system's ends of lines."""
    calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    return [
        call.lineno
        for call in calls
        if isinstance(call.func, ast.Attribute)
        and call.func.attr == "write_text"
        and "newline" not in {keyword.arg for keyword in call.keywords}
    ]


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_leaves_the_ends_of_lines_to_the_system(package: str) -> None:
    for module in sorted((ROOT / package).rglob("*.py")):
        assert left_to_the_system(Path(module).read_text(encoding="utf-8")) == [], module


def test_a_text_whose_ends_of_lines_are_left_to_the_system_is_found() -> None:
    assert left_to_the_system('path.write_text("a", encoding="utf-8")') == [1]
    assert left_to_the_system('path.write_text("a", encoding="utf-8", newline="")') == []
