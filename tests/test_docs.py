"""README, docs and SECURITY say what is: commands, examples and equations are run, links are followed."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import recoil_daq
from recoil_daq.cli import app
from recoil_rigs.mechanism.model import generalized_forces, mass_matrix, velocity_terms
from recoil_rigs.rig import find_rig, load_rig
from recoil_rigs.tables.rig_tables import ROLES
from recoil_rigs.twin import simulate_shot
from tests.builders.all_commands import all_commands
from tests.builders.filled_drafts import filled
from tests.builders.machine_stalls import MachineStalls
from tests.builders.own_commands import own_commands
from tests.builders.virtual_shots import SHORTER, settling_soon, with_twin

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "SECURITY.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
COMMANDS = all_commands()
MOST_LINES = 150

page = pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def blocks(path: Path, language: str, marker: str = "") -> list[str]:
    """Return the fenced blocks of a language, or those alone that a comment before them marks."""
    marked = re.escape(f"<!-- {marker} -->") + r"\n" if marker else ""
    return re.findall(rf"{marked}^```{language}\n(.*?)^```", text_of(path), re.DOTALL | re.MULTILINE)


def lines_of_shell(path: Path, marker: str = "") -> list[list[str]]:
    """Return the words of each line that runs recoil-daq, without its comment."""
    lines = [shlex.split(line, comments=True) for block in blocks(path, "sh", marker) for line in block.splitlines()]
    return [words[1:] for words in lines if words[:1] == ["recoil-daq"]]


def anchors(path: Path) -> set[str]:
    """Return the anchors of a page's headings, as code hosts and the pages' generator make them."""
    headings = re.findall(r"^#+ (.*)$", text_of(path), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def test_the_readme_is_short() -> None:
    assert len(text_of(ROOT / "README.md").splitlines()) <= MOST_LINES


@page
def test_every_command_and_option_that_a_page_shows_is_there(path: Path) -> None:
    for words in lines_of_shell(path):
        command = COMMANDS[words[0]]
        known = {name for parameter in command.params for name in parameter.opts}
        used = {word.partition("=")[0] for word in words[1:] if re.match(r"--[a-z]", word)}
        assert used <= known, words


@page
def test_every_option_in_a_sentence_is_an_option_of_some_command(path: Path) -> None:
    known = {name for command in COMMANDS.values() for parameter in command.params for name in parameter.opts}
    sentences = re.sub(r"^```.*?^```", "", text_of(path), flags=re.DOTALL | re.MULTILINE)
    of_others = {"--help", "--version", "--benchmark-enable", "--only", "--quick", "--strict", "--no-search"}
    code = "\n".join(re.findall(r"`([^`]+)`", sentences))
    quoted = set(re.findall(r"(?<!\S)--[a-z][a-z-]+", code))
    assert quoted - of_others <= known


@page
def test_every_link_of_a_page_leads_somewhere(path: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", text_of(path)):
        if link.startswith("https://"):
            continue
        name, _, anchor = link.partition("#")
        target = (path.parent / name).resolve() if name else path
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@pytest.mark.indispensable("the first day")
def test_the_first_day_is_as_the_readme_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # a file of the bundled rig's name is taken for it: the same rig with a shorter record
    (tmp_path / "mixed").write_text(with_twin("mixed", **SHORTER | {"duration_s": 0.45}).text, encoding="utf-8")
    shutil.copy(find_rig("mixed").with_suffix(".dbc"), tmp_path)
    monkeypatch.chdir(tmp_path)
    shown = lines_of_shell(ROOT / "README.md", "example: first day")
    assert len(shown) == 10
    for words in shown:
        expanded = [name for word in words for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])]
        if words[0] == "predict":  # a command of seconds, which tests of its own run
            continue
        here = ["--workers", "1"] if words[0] in ("identify", "campaign") or "--batch" in words else []
        done = CliRunner().invoke(app, [*expanded, *here])
        assert done.exit_code == 0, f"{words}: {done.output}"
    for written in ("shots/0001.h5", "reports/0001/report.html", "campaign/campaign.html", "exports"):
        assert (tmp_path / written).exists()
    # nobody typed the added mass: it came with the files
    mass = json.loads((tmp_path / "campaign" / "campaign.json").read_text(encoding="utf-8"))["mass"]
    assert mass["specification"] == load_rig("mixed").mechanism.m3
    assert abs(mass["E_n"]) < 1.0


@pytest.mark.real_time
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals for the virtual port")
def test_the_day_at_the_range_is_as_its_page_says(tmp_path: Path) -> None:
    # a file of the bundled rig's name is taken for it: the same rig with a shorter record
    (tmp_path / "mixed").write_text(settling_soon(with_twin("mixed", **SHORTER)).text, encoding="utf-8")
    shutil.copy(find_rig("mixed").with_suffix(".dbc"), tmp_path)
    shown = lines_of_shell(DOCS / "range-day.md", "example: range day")
    assert [words[0] for words in shown] == ["check", "check", "ingest", "log", "show", "identify", "campaign"]
    shown[2][shown[2].index("--shots") + 1] = "2"  # as many as the lines after it name
    with MachineStalls() as machine:
        done = own_commands(*map(tuple, shown), cwd=tmp_path)
    # devices that play late, because the machine did nothing for so long, rightly cost a shot its verdict
    allowed = {0, 1} if machine.largest_s > 0.1 else {0}
    for words, one in zip(shown, done, strict=True):
        assert one.code in allowed, (words, machine.largest_s, one.out)
    assert "VIRTUAL" in done[1].out
    state = json.loads((tmp_path / "shots" / "live.json").read_text(encoding="utf-8"))
    assert state["state"] == "stopped"
    assert [shot["shot"] for shot in state["shots"]] == ["0001", "0002"]
    for shot in state["shots"] if allowed == {0} else ():
        assert shot["mass"]["value"] == pytest.approx(load_rig("mixed").mechanism.m3, rel=0.05)
        assert (tmp_path / "shots" / "reports" / shot["shot"] / "report.html").exists()
        assert [figure["code"] for figure in shot["figures"]] == ["breech", "stroke", "v max"]
    if allowed == {0}:
        combined = json.loads((tmp_path / "campaign" / "campaign.json").read_text(encoding="utf-8"))
        assert [one["shot"] for one in combined["shots"]] == ["0001", "0002"]


@pytest.mark.whole_way
def test_the_python_examples_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fired = simulate_shot(with_twin("field-2013", **SHORTER), tmp_path, seed=1, shot="0001")
    for file in fired.files:
        file.rename(tmp_path / ("camera.csv" if "camera" in file.name else "daq.csv"))
    rig = text_of(tmp_path / "rig.toml")
    (tmp_path / "rig.toml").write_text(re.sub(r'match = "\*_(dewetron|camera)\.csv"', "", rig), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": __name__}
    examples = blocks(DOCS / "python.md", "python", "example: python")
    assert len(examples) == 2
    for example in examples:
        exec(compile(example, "docs/python.md", "exec"), names)  # noqa: S102 - our own page
    assert names["report"].valid
    again = {"shot": "0001", "overwrite": True}
    ingested = recoil_daq.ingest_files(recoil_daq.load_rig("rig.toml"), ["daq.csv", "camera.csv"], **again)
    assert recoil_daq.identify_file(ingested.path, overwrite=True).mass_kg == names["report"].mass_kg
    assert "not an HDF5 file" in capsys.readouterr().out.splitlines()[-1]


@pytest.mark.whole_way
def test_the_analyst_s_script_runs_in_memory(tmp_path: Path) -> None:
    (script,) = blocks(DOCS / "python.md", "python", "example: analyst")
    (tmp_path / "script.py").write_text(script, encoding="utf-8")
    rig = with_twin("field-2013", **SHORTER)
    fired = simulate_shot(rig, tmp_path / "files", seed=1, shot="0001")
    recoil_daq.ingest_files(rig, fired.files, shot="0001", out=tmp_path / "shots")
    before = sorted(path.name for path in (tmp_path / "shots").iterdir())
    run = [sys.executable, "-W", "error", "script.py", "shots"]
    done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0].endswith(" Pa")
    assert (tmp_path / "mass.png").stat().st_size > 10_000
    assert (tmp_path / "memory" / "0001" / "report.html").exists()
    assert sorted(path.name for path in (tmp_path / "shots").iterdir()) == before


@pytest.mark.whole_way
def test_the_notebook_runs_and_is_kept_without_outputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notebook = json.loads(text_of(DOCS / "first-look.ipynb"))
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)
    (tmp_path / "field-2013").write_text(with_twin("field-2013", **SHORTER).text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    for number, cell in [*enumerate(cells), *enumerate(cells)]:  # a second run meets what the first one wrote
        exec(compile("".join(cell["source"]), f"first-look.ipynb, cell {number}", "exec"), names)  # noqa: S102 - ours
    assert names["report"].valid
    assert list(tmp_path.rglob("report.html"))


def test_the_rig_of_the_example_has_no_fault(tmp_path: Path) -> None:
    parts = blocks(DOCS / "rig-file.md", "toml", "rig")
    assert len(parts) == 3
    (tmp_path / "rig.toml").write_text("\n".join(parts), encoding="utf-8")
    done = CliRunner().invoke(app, ["check", str(tmp_path / "rig.toml")])
    assert done.exit_code == 0, done.output
    assert "no fault" in done.output


@pytest.mark.parametrize("marker", ["line", "cell and camera", "cell and servo"])
def test_the_line_of_the_example_has_no_fault(tmp_path: Path, marker: str) -> None:
    (text,) = blocks(DOCS / "line-rigs.md", "toml", marker)
    (tmp_path / "line.toml").write_text(text, encoding="utf-8")
    done = CliRunner().invoke(app, ["check", str(tmp_path / "line.toml")])
    assert done.exit_code == 0, done.output
    assert "no fault" in done.output


@page
def test_every_piece_of_toml_is_toml(path: Path) -> None:
    for block in blocks(path, "toml"):
        tomllib.loads(block)


def test_every_role_is_on_the_page_of_the_rig_file() -> None:
    rows = re.findall(r"^\| (`[a-z_`, ]+`) \|", text_of(DOCS / "rig-file.md"), re.MULTILINE)
    assert {role for row in rows for role in re.findall(r"`([a-z_]+)`", row)} == set(ROLES)


def test_every_test_that_security_names_is_there() -> None:
    named = re.findall(r"`(tests/[^`]+)`", text_of(ROOT / "SECURITY.md"))
    assert len(named) > 15
    for name in named:
        assert (ROOT / name).exists(), name


def evaluated(names: dict[str, float]) -> dict[str, float]:
    """Evaluate the equations of the page of the method, each with what is known by then."""
    lines = "\n".join(blocks(DOCS / "method.md", "text"))
    known = dict(names)
    for line in lines.replace("−", "-").split("\n"):
        for equation in re.split(r" {2,}", line.strip()):
            left, *middle, right = equation.split(" = ") if " = " in equation else ("", "")
            if re.fullmatch(r"[A-Za-z]+\d*", left) and left != "RPE" and "'" not in left:
                known[left] = value = float(eval(in_python(right), {"cos": np.cos, "sin": np.sin}, known))  # noqa: S307
                known.update(dict.fromkeys(middle, value))
    return known


def in_python(expression: str) -> str:
    """Write the page's notation as Python has it: products, squares, rates and Greek letters."""
    for sign, name in (("α'", "da "), ("x'", "dx "), ("φ", "phi"), ("ξ", "xi"), ("η", "eta")):
        expression = expression.replace(sign, name)
    expression = re.sub(r"(cos|sin) (\w+)", r"\1(\2)", expression)
    tokens = re.findall(r"[A-Za-z_]\w*|[\d.]+|[-+²()\[\]]", expression)
    written = ""
    for before, part in zip(["", *tokens], tokens, strict=False):
        ends = bool(before) and (before[-1].isalnum() or before in ")]²")
        begins = part != "²" and (part[0].isalnum() or part in "([")
        written += ("*" if ends and begins and before not in ("cos", "sin") else "") + part
    return written.replace("²", "**2").replace("[", "(").replace("]", ")")


def test_the_equations_of_the_page_are_those_of_the_model() -> None:
    mechanism = load_rig("mixed").mechanism
    rng = np.random.default_rng(8)
    q, rates = rng.normal(scale=0.3, size=5), rng.normal(size=5)
    loads = dict(zip(("P", "R_f", "M_C", "N_Cxi", "N_Ceta", "N_Deta"), rng.normal(scale=1e3, size=6), strict=True))
    symbols = ("m1", "m2", "m3", "J1", "J2", "J3c", "X1", "Y1", "XA", "YA", "s2", "d2", "b", "d", "e", "L", "f", "g")
    names = {name: float(getattr(mechanism, name)) for name in symbols} | {name: float(v) for name, v in loads.items()}
    names |= {"phi1": mechanism.phi10 + q[2], "phi2": mechanism.phi20 + q[2] + q[3], "x": q[4]}
    names |= {"da": rates[2], "dx": rates[4], "w2": rates[2] + rates[3]}
    found = evaluated(names)
    M, h = mass_matrix(mechanism, q), velocity_terms(mechanism, q, rates)
    Q = generalized_forces(
        mechanism, q, loads["P"], loads["R_f"], loads["M_C"], loads["N_Cxi"], loads["N_Ceta"], loads["N_Deta"]
    )
    for i in range(5):
        assert found[f"h{i + 1}"] == pytest.approx(h[i], rel=1e-12), f"h{i + 1}"
        assert found[f"Q{i + 1}"] == pytest.approx(Q[i], rel=1e-12), f"Q{i + 1}"
        for j in range(i, 5):
            assert found[f"M{i + 1}{j + 1}"] == pytest.approx(M[i, j], rel=1e-12, abs=1e-9), f"M{i + 1}{j + 1}"


@pytest.mark.whole_way
def test_the_pages_are_built_and_load_nothing_from_a_network(tmp_path: Path) -> None:
    properdocs = pytest.importorskip("properdocs.commands.build", reason="properdocs, of the extra `docs`")
    from properdocs.config import load_config

    with (DOCS / "site/properdocs.yml").open("rb") as file:
        config = load_config(file, site_dir=str(tmp_path / "site"), strict=True)
    properdocs.build(config)
    pages = sorted((tmp_path / "site").rglob("*.html"))
    assert len(pages) >= len(list(DOCS.rglob("*.md")))
    loaded = r"<(?:script|link|img|iframe)\b[^>]*(?:src|href)=[\"']?((?:https?:)?//[^\"'\s>]+)"
    for built in (*pages, *(tmp_path / "site").rglob("*.css")):
        content = text_of(built)
        assert re.findall(loaded, content) == [], built
        assert re.findall(r"url\([\"']?((?:https?:)?//[^)]+)\)|@import", content) == [], built


@pytest.mark.whole_way
def test_the_page_of_the_python_interface_has_every_public_name(tmp_path: Path) -> None:
    pytest.importorskip("pdoc", reason="pdoc, of the extra `docs`")
    command = [sys.executable, DOCS / "site/api.py", tmp_path, "recoil_daq"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    page = text_of(tmp_path / "recoil_daq.html")
    named = set(re.findall(r'id="(\w+)"', page))
    assert named >= set(recoil_daq.__all__) - {"__version__"}
    assert re.findall(r"<(?:script|link|img|iframe)\b[^>]*(?:src|href)=[\"']?(?:https?:)?//", page) == []


def test_the_drawing_loads_nothing_from_a_network() -> None:
    assert re.findall(r"(?:href|src)=|url\((?!#)|@import|<script", text_of(DOCS / "mechanism.svg")) == []


@pytest.mark.whole_way
def test_the_first_day_with_own_hardware_ends_with_a_mass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page_of_the_day = DOCS / "first-day.md"
    (tmp_path / "mixed").write_text(with_twin("mixed", kind=False).text, encoding="utf-8")
    shutil.copy(find_rig("mixed").with_suffix(".dbc"), tmp_path)
    monkeypatch.chdir(tmp_path)
    (table,) = blocks(page_of_the_day, "csv", "first day: sensors")
    (typed,) = blocks(page_of_the_day, "toml", "first day: typed")
    (tmp_path / "sensors.csv").write_text(table, encoding="utf-8")
    shown: dict[str, str] = {}
    for words in lines_of_shell(page_of_the_day):
        expanded = [name for word in words for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])]
        done = CliRunner().invoke(app, expanded)
        assert done.exit_code == 0, f"{words}: {done.output}"
        shown[words[0]] = done.output
        if words[0] == "init" and words[-1] == "rig.toml":
            drafted = done.output
            assert CliRunner().invoke(app, ["check", "rig.toml"]).exit_code == 3
            text = (tmp_path / "rig.toml").read_text(encoding="utf-8")
            (tmp_path / "rig.toml").write_text(filled(text, tomllib.loads(typed)), encoding="utf-8")
    for line in blocks(page_of_the_day, "text", "first day: init")[0].splitlines():
        words_of_line = re.split(r" {2,}", line)
        assert any(all(word in one for word in words_of_line[:3]) for one in drafted.splitlines()), line
    for line in blocks(page_of_the_day, "text", "first day: mass")[0].splitlines():
        assert any(line in output for output in shown.values()), line
    # the second draft asks for nothing: all that was typed is taken over
    assert '"TODO' not in (tmp_path / "new.toml").read_text(encoding="utf-8")
    assert load_rig("new.toml").mechanism == load_rig("rig.toml").mechanism
