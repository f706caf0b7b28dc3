"""What SECURITY.md promises of the whole source: nothing is evaluated, unpickled, run in a shell or fetched."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.indispensable("law")

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = (
    "recoil_daq",
    "identification/recoil_identification",
    "processing/recoil_processing",
    "rigs/recoil_rigs",
    "daq/recoil_acquisition",
)
CALLS = {"eval", "exec", "compile", "__import__", "system", "popen", "getoutput", "getstatusoutput"}
"""Named alone, or as a function of a module other than `re`."""
MODULES = {
    "pickle", "cPickle", "shelve", "marshal", "dill", "cloudpickle", "yaml",
    "urllib.request", "http", "ftplib", "smtplib", "telnetlib", "xmlrpc", "requests", "httpx", "aiohttp",
}  # fmt: skip


def broken_promises(tree: ast.AST) -> Iterator[str]:
    """Say what a module does that none of ours may."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            for name in names:
                if name in MODULES or name.partition(".")[0] in MODULES:
                    yield f"line {node.lineno} imports {name}"
        if isinstance(node, ast.Call):
            called, of = node.func, ""
            if isinstance(called, ast.Attribute):
                of = called.value.id if isinstance(called.value, ast.Name) else "?"
            name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
            if name in CALLS and of in ("", "os", "subprocess", "builtins"):
                yield f"line {node.lineno} calls {name}"
            for keyword in node.keywords:
                if keyword.arg in ("shell", "allow_pickle") and not _is_false(keyword.value):
                    yield f"line {node.lineno} says {keyword.arg}"


def _is_false(value: ast.expr) -> bool:
    return isinstance(value, ast.Constant) and value.value is False


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_evaluates_unpickles_runs_a_shell_or_opens_an_address(package: str) -> None:
    modules = sorted((ROOT / package).rglob("*.py"))
    assert modules
    for module in modules:
        assert list(broken_promises(ast.parse(module.read_text(encoding="utf-8")))) == [], module


@pytest.mark.parametrize(
    "line",
    [
        "import pickle",
        "from urllib.request import urlopen",
        "import http.client",
        "eval('1')",
        "import os; os.system('ls')",
        "import subprocess; subprocess.run('ls', shell=True)",
        "import numpy; numpy.load('a.npy', allow_pickle=flag)",
    ],
)
def test_a_broken_promise_is_seen(line: str) -> None:
    assert len(list(broken_promises(ast.parse(line)))) == 1
