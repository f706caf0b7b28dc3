"""Every package of the house is built, checked and on a floor: one that is new and forgotten is seen."""

from __future__ import annotations

import re
import tomllib
from itertools import chain
from pathlib import Path

from tests.contracts.test_promises import PACKAGES

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
TOOL = PROJECT["tool"]


def found() -> dict[str, str]:
    """Return the packages that lie in the house, each with its folder."""
    modules = chain(ROOT.glob("*/__init__.py"), ROOT.glob("[!.]*/*/__init__.py"))
    folders = [path.parent.relative_to(ROOT) for path in modules if not (path.parents[1] / "__init__.py").exists()]
    return {one.name: one.parent.as_posix() for one in folders if one.parts[0] not in ("tests", "build", "dist")}


def test_five_packages_lie_in_the_house_each_in_a_source_root_of_its_own() -> None:
    assert len(found()) == len(set(found().values())) == 5


def test_every_package_is_built_from_its_source_root() -> None:
    targets, paths = TOOL["hatch"]["build"]["targets"], {Path(root, name).as_posix() for name, root in found().items()}
    assert set(targets["wheel"]["packages"]) == set(PACKAGES) == paths
    assert set(targets["wheel"]["dev-mode-dirs"]) == set(found().values())
    assert set(targets["sdist"]["include"]) >= {path.split("/")[0] for path in paths}
    assert all((ROOT / path / "py.typed").exists() for path in paths)


def test_the_map_of_the_house_names_every_room_of_every_package() -> None:
    _, house, *_ = (ROOT / "CONTRIBUTING.md").read_text("utf-8").split("## The house\n")
    package, drawn = "", set[str]()
    for indent, names in re.findall(r"^(    | {8})((?:[\w/]+/ *)+)", house.split("\n## ")[0], flags=re.M):
        package = names.strip() if len(indent) == 4 else package
        drawn |= {package, *(f"{package}{room}" for room in names.split() if room != package)}
    rooms = (path for one in PACKAGES for path in ROOT.glob(f"{one}/*/__init__.py"))
    assert drawn >= {f"{one}/" for one in PACKAGES} | {f"{room.parent.relative_to(ROOT).as_posix()}/" for room in rooms}


def test_every_source_root_is_seen_by_the_tools() -> None:
    roots = set(found().values())
    assert set(TOOL["pytest"]["ini_options"]["pythonpath"]) == set(TOOL["ruff"]["src"]) == roots
    assert {".", *TOOL["mypy"]["mypy_path"]} == roots
    assert set(TOOL["mypy"]["packages"]) == set(TOOL["coverage"]["run"]["source_pkgs"]) == set(found())


def test_every_package_has_its_floor() -> None:
    linter = TOOL["importlinter"]
    layers, circles, _ = linter["contracts"]
    assert layers["layers"] == linter["root_packages"] == circles["ancestors"]
    assert set(layers["layers"]) == set(found())
