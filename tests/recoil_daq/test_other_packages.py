"""A reader in a package of its own is found, used by the commands, and keeps the rules, with no line changed here."""

from __future__ import annotations

import json
import logging
import os
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from recoil_acquisition import conformance
from recoil_acquisition.conformance import Case
from recoil_acquisition.errors import CorruptFileError, IdentificationError, UnknownFormatError
from recoil_acquisition.exporters.table import EXPORTERS, exporter_names, exporter_of
from recoil_acquisition.packages import others
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import READERS, readers, recognise, surest_claim
from recoil_acquisition.store import read_shot
from recoil_daq.campaigns.sources import CampaignReport, Outdated
from recoil_identification.shot.identified import Options
from recoil_identification.targets import GROUP as TARGETS
from recoil_identification.targets import target_function, target_names
from recoil_identification.targets.target_result import TargetResult
from recoil_processing.filters import LowPass
from recoil_processing.filters.table import GROUP as FILTERS
from recoil_rigs.twin import TwinShot
from tests.builders import vendor_files
from tests.builders.own_commands import own_commands
from tests.other_package.recoil_itx import ItxReader
from tests.recoil_daq.conftest import Identified
from tests.test_contributing import block

PACKAGE = Path(__file__).resolve().parents[1] / "other_package"
PROJECT = tomllib.loads((PACKAGE / "pyproject.toml").read_text("utf-8"))["project"]


def itx(names: list[str], units: list[str], rows: np.ndarray, step_s: float) -> bytes:
    """Write a file as Igor Pro does."""
    quoted = ", ".join(f"'{name}'" for name in names)
    lines = ["IGOR", f"WAVES/D {quoted}", "BEGIN", *("\t".join(["", *map(repr, row)]) for row in rows.tolist()), "END"]
    lines.append(f'X SetScale/P x 0.0,{step_s!r},"s", {quoted}')
    lines += [f"X SetScale y 0,0,\"{unit}\", '{name}'" for name, unit in zip(names, units, strict=True)]
    return "".join(line + "\n" for line in lines).encode("latin-1")


RAMP = np.column_stack((np.arange(40.0), 200.0 - np.arange(40.0)))
CASE = Case(
    "itx", ItxReader(), itx(["acc", "p"], ["m/s^2", "Pa"], RAMP, 1e-3), Declarations("recorder"),
    {"acc": (0.0, 39.0), "p": (161.0, 200.0)},
)  # fmt: skip


@pytest.mark.parametrize("rule", conformance.RULES, ids=lambda rule: rule.__name__)
def test_a_reader_of_another_package_keeps(rule: Callable[[Case, Path], None], tmp_path: Path) -> None:
    rule(CASE, tmp_path)


def installed(folder: Path, package: str, announced: Mapping[str, Mapping[str, str]], home: Path) -> dict[str, str]:
    """Write what pip would leave of a package in a folder; return the environment of a process that has it."""
    metadata = folder / f"{package}-0.1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 0.1\n")
    points = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
        for group, entries in announced.items()
    ]
    (metadata / "entry_points.txt").write_text("\n".join(points))
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(home), *sys.path])}


def recipe_installed(folder: Path, *names: str) -> dict[str, str]:
    """Write recipes of CONTRIBUTING.md as the modules that they are announced as, as `installed` does."""
    announced: dict[str, dict[str, str]] = {}
    for name in names:
        for group, entries in tomllib.loads(block("announced", name))["project"]["entry-points"].items():
            announced[group] = entries
            (module,) = {value.partition(":")[0] for value in entries.values()}
            (folder / f"{module}.py").write_text(block("recipe", name), encoding="utf-8")
    return installed(folder, "recipes", announced, folder)


def test_the_wheel_of_the_example_has_every_module_that_it_announces() -> None:
    listed = tomllib.loads((PACKAGE / "pyproject.toml").read_text("utf-8"))["tool"]["hatch"]["build"]["targets"][
        "wheel"
    ]
    values = [value for entries in PROJECT["entry-points"].values() for value in entries.values()]
    assert {f"{value.partition(':')[0]}.py" for value in values} == set(listed["only-include"])
    assert all((PACKAGE / name).is_file() for name in listed["only-include"])


@pytest.mark.indispensable("another package")
def test_show_and_ingest_read_a_format_of_another_package(field_shot: TwinShot, stored: Path, tmp_path: Path) -> None:
    environment = installed(tmp_path, "recoil_itx", PROJECT["entry-points"], PACKAGE)
    csv, camera = sorted(field_shot.files, key=lambda path: recognise(path).kind, reverse=True)
    recorded = recognise(csv).open(csv, Declarations("dewetron"))
    samples = np.column_stack([recorded.read(header.name) for header in recorded.signals])
    step_s = recorded.time_base(recorded.signals[0].name).step_s
    file = tmp_path / "0001_daq.itx"
    names, units = zip(*((signal.name, signal.unit) for signal in recorded.signals), strict=True)
    file.write_bytes(itx([*names], [*units], samples, step_s or 0.0))

    ingest = ("ingest", "field-2013", file, camera, "--shot", "other", "--out", tmp_path)
    done = own_commands(("show", file, "--json"), ("formats", "--json"), ingest, env=environment)
    assert [one.code for one in done] == [0, 0, 0]
    shown, formats = (json.loads(one.out) for one in done[:2])
    assert shown["format"] == ItxReader.name
    assert [signal["name"] for signal in shown["signals"]] == [signal.name for signal in recorded.signals]
    assert ItxReader.name in [row["format"] for row in formats["formats"]]
    other, own = read_shot(tmp_path / "other.h5"), read_shot(stored)
    assert list(other.channels) == list(own.channels)
    for name, channel in other.channels.items():
        np.testing.assert_array_equal(channel.samples, own.channels[name].samples)


@pytest.fixture
def announced(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Let other packages announce some objects, by the values of their entry points."""
    import importlib.metadata

    def announce(*points: EntryPoint) -> None:
        monkeypatch.setattr(
            importlib.metadata, "entry_points", lambda group: EntryPoints(p for p in points if p.group == group)
        )
        forget()

    def forget() -> None:
        for kept in (others.offered, others.announced, others.named):
            kept.cache_clear()

    yield announce
    forget()


def point(name: str, value: str, group: str = "recoil_daq.readers") -> EntryPoint:
    return EntryPoint(name, value, group)


class RaisingReader(ItxReader):
    name = "raising"

    def claims(self, head: Head) -> Claim:
        raise RuntimeError(f"{len(head.content)} bytes\nare too many")


class Careless(ItxReader):
    def open(self, path: Path, declared: Declarations) -> Recording:
        return super().open(path.with_name(path.read_text(encoding="utf-8").split("\t")[99999]), declared)


NOT_A_READER = SimpleNamespace(name="half", kind="dewetron", suffixes=(".half",))
HERE = "tests.recoil_daq.test_other_packages"


def test_a_package_that_does_not_work_is_told_in_a_line_and_the_others_are_read(
    announced: Callable[..., None], caplog: pytest.LogCaptureFixture
) -> None:
    announced(
        point("a", "no_such_package:Reader"), point("b", f"{HERE}:NOT_A_READER"), point("c", f"{HERE}:RaisingReader"),
        point("d", f"{HERE}:ItxReader"),
    )  # fmt: skip
    with caplog.at_level(logging.WARNING):
        assert [reader.name for reader in readers()[len(READERS) :]] == ["raising", ItxReader.name]
        assert [r.name for r in surest_claim(Head(CASE.content))[1]] == [ItxReader.name]
        text = Head(vendor_files.dewesoft_text(vendor_files.motion_rows()))
        assert [r.name for r in surest_claim(text)[1]] == ["Dewesoft text export"]
    told = [record.getMessage() for record in caplog.records]
    assert "'a' (no_such_package:Reader)" in told[0]
    assert "No module named 'no_such_package'" in told[0]
    assert "it has no claims, open" in told[1]
    assert "the reader 'raising' does not work and is left out: RuntimeError" in told[2]
    assert not any("\n" in line for line in told)


def test_what_a_reader_of_another_package_raises_is_a_fault_of_the_file(
    announced: Callable[..., None], tmp_path: Path
) -> None:
    announced(point("a", f"{HERE}:Careless"))
    (tmp_path / "a.itx").write_bytes(CASE.content)
    with pytest.raises(CorruptFileError, match=r"a\.itx: the file is damaged; .* of Igor.*IndexError"):
        recognise(tmp_path / "a.itx").open(tmp_path / "a.itx", CASE.declared)


def test_two_certain_claims_of_two_packages_are_an_error_that_names_both(
    announced: Callable[..., None], tmp_path: Path
) -> None:
    announced(point("one", f"{HERE}:ItxReader"), point("two", f"{HERE}:ItxReader"))
    (tmp_path / "a.itx").write_bytes(CASE.content)
    with pytest.raises(UnknownFormatError, match="found Igor text waves, Igor text waves"):
        recognise(tmp_path / "a.itx")


class Flac:
    name, suffix, extra, single_file = "flac", ".flac", "", False
    carried = write = read_back = staticmethod(lambda *_: None)


def test_an_exporter_of_another_package_is_offered(announced: Callable[..., None], run, tmp_path: Path) -> None:
    announced(point("flac", f"{HERE}:Flac", "recoil_daq.exporters"))
    assert exporter_names() == (*EXPORTERS, "flac")
    assert isinstance(exporter_of("flac"), Flac)
    refused = run("export", tmp_path / "no.h5", "--format", "wmv")
    assert refused.exit_code == 2
    assert "flac" in " ".join(refused.output.split())


@pytest.mark.indispensable("another package's filter and target")
def test_identify_filters_and_finds_by_the_recipes_and_explain_makes_it_again(
    stored: Path, identified: Identified, tmp_path: Path
) -> None:
    out = tmp_path / "reports"
    words = ("--filter", "gaussian", "--target", "mass", "--target", "peak-pressure")
    identify, explain, refused = own_commands(
        ("identify", stored, *words, "--out", out, "--json"),
        ("explain", out, "--check", "--shots", stored.parent, "--json"),
        ("identify", stored, "--filter", "gausian", "--out", out),
        env=recipe_installed(tmp_path, "filter", "target"),
    )
    assert [identify.code, explain.code, refused.code] == [0, 0, 2]
    (report,), (peak,) = (json.loads(identify.out)[key] for key in ("reports", "targets"))
    gauge = read_shot(stored).by_role("breech_pressure")
    assert gauge is not None
    assert peak["target"] == "peak-pressure"
    assert peak["quantities"][0]["value"] == pytest.approx(1e-6 * float(np.nanmax(gauge.samples)))
    usual = identified.report
    assert report["provenance"]["parameters"]["options"].pop("filter") == "gaussian"
    assert report["provenance"]["parameters"]["options"] == usual["provenance"]["parameters"]["options"]
    description = report["filter"].pop("description")
    assert (description["kind"], report["filter"]["half_order"]) == ("Gaussian", None)
    assert report["filter"] == {**usual["filter"], "half_order": None}
    assert report["mass"]["value"] != usual["mass"]["value"]
    assert report["mass"]["value"] == pytest.approx(usual["mass"]["value"], abs=2 * usual["mass"]["u"])
    assert "</abbr> Gaussian <abbr" in (out / "0001" / "report.html").read_text("utf-8")
    assert [one["again"] for one in json.loads(explain.out)["reports"]] == [True, True]
    doubt = CampaignReport.read(out / "0001" / "report.json").why_not(None, None)
    assert doubt is not None
    assert doubt.code is Outdated.FILTER


class Late(LowPass):
    """A filter that delays."""

    def apply(self, samples, rate_hz):
        return np.roll(super().apply(samples, rate_hz), 3, axis=0)


class Deep(LowPass):
    """A filter whose cut-off is its -6 dB point."""

    def apply(self, samples, rate_hz):
        return super().apply(super().apply(samples, rate_hz), rate_hz)


class OfFew(LowPass):
    """A filter that knows records of one length."""

    def apply(self, samples, rate_hz):
        if len(samples) != 2001:
            raise IndexError(f"{len(samples)} samples\nare too many")
        return super().apply(samples, rate_hz)


class InPlace(LowPass):
    """A filter that writes over what it is given."""

    def apply(self, samples, rate_hz):
        samples[:] = super().apply(samples, rate_hz)
        return samples


LATE, DEEP, FEW, IN_PLACE = Late(1.0), Deep(1.0), OfFew(1.0), InPlace(1.0)


def test_a_filter_of_another_package_that_keeps_the_laws_is_taken(announced: Callable[..., None]) -> None:
    announced(point("second", f"{HERE}:IN_PLACE", FILTERS))
    options, noise = Options(filter="second"), np.random.default_rng(1).standard_normal(500)
    given = noise.copy()
    np.testing.assert_array_equal(options.low_pass.at(90.0).apply(given, 1e3), LowPass(90.0).apply(noise, 1e3))
    np.testing.assert_array_equal(given, noise)
    assert Options.of_json(options.to_json()) == options
    assert "filter" not in Options().to_json()


def test_a_filter_of_another_package_that_fails_in_use_is_told_in_a_line(announced: Callable[..., None]) -> None:
    announced(point("few", f"{HERE}:FEW", FILTERS))
    with pytest.raises(IdentificationError, match=r"'few' of another package .* IndexError: 9 samples\\nare too many"):
        Options(filter="few").low_pass.apply(np.zeros(9), 1e3)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("LATE", "without phase"), ("DEEP", "its gain says"), ("NOT_A_READER", "has no apply, apply_with_gaps, at,"),
        ("no_such", "AttributeError"),
    ],
)  # fmt: skip
def test_a_filter_of_another_package_that_breaks_one_is_refused_in_a_line(
    name: str, why: str, announced: Callable[..., None]
) -> None:
    announced(point("odd", f"{HERE}:{name}", FILTERS))
    with pytest.raises(IdentificationError, match=why) as refused:
        Options(filter="odd").low_pass.at(1.0)
    assert "another package" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_filter_that_nobody_announces_is_refused_with_the_names_of_all(announced: Callable[..., None]) -> None:
    announced(point("second", f"{HERE}:LATE", FILTERS))
    with pytest.raises(ValueError, match="filter must be one of butterworth, second, not 'third'"):
        Options(filter="third")


def raises(_: object) -> TargetResult:
    raise KeyError("x")


def of_another_name(_: object) -> TargetResult:
    return TargetResult("other", "Other", "", ())


@pytest.mark.parametrize("name", ["raises", "of_another_name", "no_such"])
def test_a_target_of_another_package_that_does_not_work_is_told_in_a_line(
    name: str, announced: Callable[..., None]
) -> None:
    announced(point("peak", f"{HERE}:{name}", TARGETS), point("../report", f"{HERE}:raises", TARGETS))
    assert target_names()[-1] == "peak"
    with pytest.raises(IdentificationError, match=r"another package.* does not work"):
        target_function("peak")(None)
    with pytest.raises(ValueError, match=r"target must be one of parameters, .*, peak, not 'report'"):
        target_function("report")


def test_two_targets_of_one_name_are_an_error_that_names_both(announced: Callable[..., None]) -> None:
    announced(point("peak", f"{HERE}:raises", TARGETS), point("peak", f"{HERE}:of_another_name", TARGETS))
    with pytest.raises(IdentificationError, match=f"found {HERE}:of_another_name, {HERE}:raises"):
        target_function("peak")
