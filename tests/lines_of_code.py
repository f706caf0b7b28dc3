"""Lines of code proper by package: without docstrings, comments, blank lines and imports.

Run ``python -m tests.lines_of_code`` in the project's folder.
"""

from __future__ import annotations

import ast
import io
import tokenize
from pathlib import Path

ROOTS = (
    Path("recoil_daq"),
    Path("identification/recoil_identification"),
    Path("processing/recoil_processing"),
    Path("rigs/recoil_rigs"),
    Path("daq/recoil_acquisition"),
    Path("tests"),
)


def lines_of_code(source: str) -> int:
    """Count the lines of a module on which code proper stands."""
    tree = ast.parse(source)
    left_out: set[int] = set()
    for node in ast.walk(tree):
        documented = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        texts = [part for part in node.body if _is_text(part)] if documented else []
        for part in (*texts, *([node] if isinstance(node, ast.Import | ast.ImportFrom) else [])):
            left_out |= set(range(part.lineno, (part.end_lineno or part.lineno) + 1))
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in _NO_CODE:
            lines |= set(range(token.start[0], token.end[0] + 1))
    return len(lines - left_out)


_NO_CODE = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENCODING,
    tokenize.ENDMARKER,
}  # fmt: skip


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def main() -> None:
    """Print a table of the packages."""
    modules = lines = 0
    for root in ROOTS:
        paths = sorted(root.rglob("*.py"))
        count = sum(lines_of_code(path.read_text(encoding="utf-8")) for path in paths)
        print(f"{root.as_posix():40} {len(paths):5} modules {count:7,} lines")
        if root.name != "tests":
            modules, lines = modules + len(paths), lines + count
    print(f"{'without tests':40} {modules:5} modules {lines:7,} lines")


if __name__ == "__main__":
    main()
