"""Every text of the program, as it is written in its modules: what stands in braces is put in when it is said."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("daq", "processing", "rigs", "identification", "recoil_daq")


@cache
def program_texts() -> tuple[tuple[str, str], ...]:
    """Return place and text of every string of the five packages that is no docstring, those of tables of data too."""
    modules = (path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py")))
    tables = (ROOT / "daq/recoil_acquisition/readers/foreign_formats.toml",)
    return tuple(
        (f"{path.relative_to(ROOT).as_posix()}:{line}", text)
        for paths, texts in ((modules, _of), (tables, _of_table))
        for path in paths
        for line, text in texts(path)
    )


def _of_table(path: Path) -> Iterator[tuple[int, str]]:
    """Texts that a table of data has for people."""
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    yield from ((0, text) for text in table["phrases"].values())
    yield from ((number, row["remedy"]) for number, row in enumerate(table["format"], 1))


def _of(path: Path) -> Iterator[tuple[int, str]]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    left_out: set[ast.AST] = set()
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        left_out |= {one.value for one in body if isinstance(one, ast.Expr)} if isinstance(body, list) else set()
        left_out |= set(node.values) if isinstance(node, ast.JoinedStr) else set()
        # what is put in is a text of its own only where it is a sentence, and none of its format
        left_out |= {node.format_spec} if isinstance(node, ast.FormattedValue) and node.format_spec else set()
    for node in ast.walk(tree):
        if node in left_out:
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value
        elif isinstance(node, ast.JoinedStr):
            yield node.lineno, "".join(map(_part, node.values))


def _part(value: ast.expr) -> str:
    if isinstance(value, ast.Constant):
        return str(value.value)
    return f"{{{ast.unparse(value.value)}}}" if isinstance(value, ast.FormattedValue) else ""
