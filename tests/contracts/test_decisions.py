"""No decision hangs on a sentence: codes, types and attributes decide, so that any message may be worded anew."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache, lru_cache
from pathlib import Path

import pytest

from tests.contracts.test_promises import PACKAGES, ROOT

pytestmark = pytest.mark.indispensable("law")

SEARCHES = (
    "count", "endswith", "find", "index", "partition", "removeprefix", "removesuffix", "replace", "rfind", "rindex",
    "rpartition", "rsplit", "split", "startswith",
)  # fmt: skip
"""Methods of a text that look for another in it."""
PATTERNS = ("compile", "findall", "finditer", "fullmatch", "match", "search", "split", "sub")
"""Functions of `re` that do."""
SENTENCES = (
    "caution", "cause", "check", "detail", "error", "fault", "influence", "key", "kind", "label", "line", "message",
    "name", "note", "problem", "reason", "remark", "remedy", "source", "state", "text", "title", "what", "why",
)  # fmt: skip
"""Words in the names of what holds a text of ours."""
ONE_SENTENCE = ("caution", "detail", "message", "note", "problem", "reason", "remark", "remedy", "sentence")
"""Names of one sentence, in which nothing is looked for, be it by a variable."""
OTHERS_TEXTS = {
    ("daq/recoil_acquisition/devices/can_device.py", "could not unpack"): "python-can's, which has no type for it",
    (
        "daq/recoil_acquisition/processes/shortage.py",
        "can't start new thread",
    ): "the interpreter's, which has no type for it",
    ("daq/recoil_acquisition/devices/open_fault.py", r"\[Errno (\d+)\]"): "the system's, as a library words it",
    ("daq/recoil_acquisition/files/bounded_toml.py", r"at line (\d+)"): "the parser's, which has no number for it",
    (
        "daq/recoil_acquisition/files/bounded_toml.py",
        r"([\w.-]+)[ \t]*=[ \t]*([^\s\"'\[{#][^\"'\[\]{}#]*?)[ \t]*(?:#.*)?",
    ): "a line of TOML",
    (
        "daq/recoil_acquisition/channel.py",
        "mask overloads",
    ): "the name of a step in a shot's history, fixed by its file",
    (
        "recoil_daq/reports/reproduction/kept_report.py",
        "shot log",
    ): "the name of an input in a report, fixed by its schema",
    (
        "identification/recoil_identification/report/figure/campaign_figures.py",
        "moving range",
    ): "the name of a control chart",
}
"""Module and literal of a text that is not ours to word, and why it is compared."""
FORMATS = ("daq/recoil_acquisition/readers/",)
"""Folders in which texts are the keywords of file formats."""


def has_blank(literal: ast.expr) -> str | None:
    """Return a text literal that may be a part of a sentence: a blank stands in it."""
    if isinstance(literal, ast.Constant) and isinstance(literal.value, str) and re.search(r"\S | \S", literal.value):
        return literal.value
    if isinstance(literal, ast.JoinedStr):
        return next((found for part in literal.values if (found := has_blank(part))), None)
    return None


def constants(source: str) -> dict[str, str]:
    """Return the module's constants that are such texts, and all that are patterns with one, by name."""
    tree = tree_of(source)
    assigned = [node for node in ast.walk(tree) if isinstance(node, ast.Assign)]
    targets = [
        (one.targets[0], has_blank(pattern_of(one.value) or one.value))
        for one in assigned
        if one in tree.body or pattern_of(one.value) is not None
    ]
    return {name.id: text for name, text in targets if isinstance(name, ast.Name) and text is not None}


def pattern_of(value: ast.expr) -> ast.expr | None:
    """Return what is compiled to a pattern; None of another value, and of a set of characters, which is no text."""
    if not (isinstance(value, ast.Call) and ast.unparse(value.func) == "re.compile" and value.args):
        return None
    pattern = value.args[0]
    of_one = isinstance(pattern, ast.Constant) and re.fullmatch(r"\[[^]]*\]", str(pattern.value))
    return None if of_one else pattern


@lru_cache(maxsize=4)
def tree_of(source: str) -> ast.Module:
    """Return the tree of a module, which is asked for several times in a row."""
    return ast.parse(source)


@cache
def constants_by_module() -> dict[str, dict[str, str]]:
    """Return those of every module of the house, by the module's dotted name."""
    modules = [module for package in PACKAGES for module in (ROOT / package).rglob("*.py")]
    return {dotted(module): constants(module.read_text("utf-8")) for module in modules}


def dotted(module: Path) -> str:
    """Return the name by which a module of the house is imported."""
    root = next(package for package in PACKAGES if (ROOT / package) in module.parents)
    return ".".join(module.relative_to((ROOT / root).parent).with_suffix("").parts)


def taken(source: str) -> dict[str, str]:
    """Return the texts that a module's names stand for: its own constants, and those of ours that it imports."""
    imports = [node for node in ast.walk(tree_of(source)) if isinstance(node, ast.ImportFrom)]
    others = {
        name.asname or name.name: constants_by_module()[one.module][name.name]
        for one in imports
        for name in one.names
        if one.module in constants_by_module() and name.name in constants_by_module()[one.module]
    }
    return {**others, **constants(source)}


def literals(nodes: Iterable[ast.expr], named: Mapping[str, str]) -> Iterator[str]:
    """Return the literals with a blank among expressions, and in tuples, lists and sets of them; named ones too."""
    for node in nodes:
        for part in node.elts if isinstance(node, ast.Tuple | ast.List | ast.Set) else [node]:
            if isinstance(part, ast.Name) and part.id in named:
                yield named[part.id]
            elif (found := has_blank(part)) is not None:
                yield found


def holds_a_sentence(node: ast.expr) -> bool:
    """Return whether an expression is named as what holds a text of ours, or is the text of an error."""
    names = [part.id for part in ast.walk(node) if isinstance(part, ast.Name)]
    names += [part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)]
    return any(word in SENTENCES or word.removesuffix("s") in SENTENCES for n in names for word in n.lower().split("_"))


SEARCHED = (ast.In, ast.NotIn)


def is_one_sentence(node: ast.expr) -> bool:
    """Return whether an expression is named as one sentence: ``note``, ``error.problem``, ``check["detail"]``."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "str" and node.args:
        return is_one_sentence(node.args[0])
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
        return node.slice.value in ONE_SENTENCE
    return getattr(node, "attr", getattr(node, "id", "")) in ONE_SENTENCE


def decisions_on_sentences(source: str) -> list[tuple[int, str]]:
    """Return line and literal of each comparison with, or search for, a part of a sentence."""
    found: list[tuple[int, str]] = []
    named = taken(source)
    for node in ast.walk(tree_of(source)):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            searched = [side for op, side in zip(node.ops, node.comparators, strict=True) if isinstance(op, SEARCHED)]
            found += [(node.lineno, ast.unparse(side)) for side in searched if is_one_sentence(side)]
            if any(map(holds_a_sentence, sides)) and not any(map(is_one_sentence, searched)):
                found += [(node.lineno, one) for one in literals(sides, named)]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            searched, name = node.func.value, node.func.attr
            pattern = ast.unparse(searched) if name in PATTERNS and any(map(holds_a_sentence, node.args)) else ""
            of_re = isinstance(searched, ast.Name) and searched.id == "re" and name in PATTERNS
            if pattern in named:
                found.append((node.lineno, named[pattern]))
            elif (of_re and any(map(holds_a_sentence, node.args[1:]))) or (
                name in SEARCHES and holds_a_sentence(searched)
            ):
                found += [(node.lineno, one) for one in literals(node.args[:1], named)]
        elif isinstance(node, ast.MatchValue) and (one := has_blank(node.value)) is not None:
            found.append((node.value.lineno, one))
    return found


@pytest.mark.parametrize("package", PACKAGES)
def test_nothing_is_decided_by_the_words_of_a_sentence(package: str) -> None:
    found = [
        f"{module.relative_to(ROOT)}:{line}: {literal!r}"
        for module in sorted((ROOT / package).rglob("*.py"))
        for line, literal in decisions_on_sentences(module.read_text("utf-8"))
        if (module.relative_to(ROOT).as_posix(), literal) not in OTHERS_TEXTS
        and not module.relative_to(ROOT).as_posix().startswith(FORMATS)
    ]
    assert found == []


def test_every_exemption_is_still_needed() -> None:
    for module, literal in OTHERS_TEXTS:
        assert literal in [found for _, found in decisions_on_sentences((ROOT / module).read_text("utf-8"))], module


@pytest.mark.parametrize(
    "decision",
    [
        'if "fits no source" in error.problem: pass',
        'if str(error).startswith("cannot be read"): pass',
        'if note == "nothing is taken as added": pass',
        'kind = reason.partition(" until the ")[0]',
        'if why in ("no sample can be used", ""): pass',
        'if name.removesuffix(" and area") == x: pass',
        'if re.search("cut off", problem): pass',
        'if f"{role} zero" in source_names: pass',
        'CUT = re.compile("cut off")\nif CUT.search(problem): pass',
        'UNIT = re.compile(rf"({NUMBER}) (MPa|m)")\nagain = UNIT.sub(other, reason)',
        'def told(note):\n    cut = re.compile("cut off")\n    return cut.search(note)',
        'ADDED = "nothing is added"\nif ADDED in note: pass',
        'if first["detail"] in reason: pass',
        'match found:\n    case "cut off here": pass',
    ],
)
def test_a_decision_on_a_sentence_is_found(decision: str) -> None:
    assert len(decisions_on_sentences(decision)) == 1


@pytest.mark.parametrize(
    "sound", ["if error.code is ErrorCode.CUT_OFF: pass", 'if name == "mass": pass', 'text = f"{note}; {why}"']
)
def test_a_decision_on_a_code_is_none(sound: str) -> None:
    assert decisions_on_sentences(sound) == []
