import base64
import gzip
import json
import math
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from recoil_acquisition.errors import StoreError
from recoil_identification.estimate.rounding import fixed, plain, rounded, significant
from recoil_identification.report.content import sentences, tables
from recoil_identification.report.content.head import head_of
from recoil_identification.report.figure.drawing import drawing, drawings
from recoil_identification.report.figure.figure import (
    Figure,
    HorizontalLine,
    Panel,
    Span,
    Trace,
    bucket_starts,
    envelope_indices,
)
from recoil_identification.report.page import html, page_files
from recoil_identification.report.page.html import PAGE_NAME, render_page
from recoil_identification.report.page.page_files import SCRIPT_NAME, plotly_script, write_page, write_script
from tests.builders.page_elements import PageElements

HOSTILE = '</script><img src=x onerror=alert(1)>\u2028\'" onload="x%{y}{{7*7}}'
OPTIONAL_KEYS = ("methods", "truth", "summary", "E_n", "alignment", "quality", "budget", "trace", "interval_s")


def a_report(**changes):
    report = {
        "schema": "recoil-daq/report/1",
        "shot": "0001",
        "rig": "field-2013",
        "mass": {
            "value": 780.9312,
            "u": 1.714,
            "U95": [777.511, 784.351],
            "unit": "kg",
            "specification": 782.0,
            "method": "inertial",
        },
        "rpe_percent": {"value": 0.1434, "U95": [0.0201, 0.5198]},
        "interval_s": [0.0012, 0.145],
        "window_s": 0.02,
        "identified_share": 0.9514,
        "trace": {"file": "mass.csv", "columns": ["time_s", "mass_kg", "u_kg", "identified"]},
        "budget": [{"source": "friction", "u_kg": 0.3}, {"source": "pressure", "u_kg": 1.2}],
        "alignment": [
            {
                "clock": "camera",
                "offset_s": 0.00123412,
                "u_offset_s": 3.1e-6,
                "drift": 1.231e-5,
                "u_drift": 2.2e-6,
                "status": "ok",
                "method": "motion",
            },
        ],
        "quality": [
            {"channel": "acc", "check": "clipping", "verdict": "ok", "detail": "none"},
            {"channel": "gyro", "check": "drop-out", "verdict": "fail", "detail": "15 ms"},
        ],
        "valid": True,
        "reasons": [],
        "provenance": {
            "version": "0.1.0",
            "inputs": [{"file": "shot.csv", "sha256": "0123456789abcdef" * 4}],
            "parameters": {"cutoff_hz": 300.0, "bound": math.nan},
        },
        "E_n": 0.18,
        "methods": [
            {"name": "inertial", "mass_kg": 780.9312, "u_kg": 1.714, "deviation_percent": -0.1367, "rpe_percent": 0.14},
            {"name": "printed", "mass_kg": 741.3, "u_kg": None, "deviation_percent": 5.2, "rpe_percent": 5.41},
        ],
        "truth": {"mass_kg": 781.5, "error_percent": -0.0728},
        "summary": {"fit_percent": 97.31, "whiteness": "white"},
    }
    return report | changes


def a_figure(key="mass", name="mass", title="Identified mass", **changes):
    x = np.linspace(0.0, 0.1, 50)
    return Figure(
        key, title, "What to see.", "time / s", (Panel("mass / kg", (Trace(name, x, x, "filtered", "kg"),)),), **changes
    )


def noise(n, seed=0):
    return np.random.default_rng(seed).standard_normal(n)


def test_page_refers_to_the_script_in_the_folder_above_it_and_to_nothing_else():
    page = render_page(a_report(), [a_figure()])
    references = [
        value
        for _, attributes in PageElements(page).elements
        for name, value in attributes.items()
        if name in {"src", "href", "action", "data", "poster", "srcset", "background", "xlink:href"}
    ]
    outward = [r for r in references if not r.startswith(("#", "./"))]
    assert outward == ["../plotly.min.js"]
    assert "://" not in page
    assert not re.search(r"""["'(=]\s*//\w""", page)
    assert not re.search(r"@import|url\(|@font-face|<link|<base|<iframe", page)


def test_page_forbids_a_network_whatever_would_ask_one_and_plotly_s_upload_button():
    page = render_page(a_report(), [a_figure()])
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    allowed = {name: set(sources) for name, *sources in (one.split() for one in policy.split(";"))}
    # what no directive names is as the default says; where a base and a form lead it does not say
    for name in ("default-src", "base-uri", "form-action"):
        assert allowed.pop(name) == {"'none'"}
    assert set(allowed) == {"script-src", "style-src", "img-src"}
    assert set().union(*allowed.values()) <= {"'unsafe-inline'", "'self'", "file:", "data:", "blob:"}
    assert "file:" not in allowed["style-src"] | allowed["img-src"]
    assert "showSendToCloud: false" in page
    assert 'plotlyServerURL: ""' in page
    assert 'modeBarButtons: [["toImage"], ["zoom2d", "pan2d"], ["autoScale2d"]]' in page


def test_script_is_plotly_s_byte_for_byte_and_written_once_for_all_pages_of_a_folder(tmp_path):
    path = write_page(tmp_path / "0001", render_page(a_report(), [a_figure()]), PAGE_NAME)
    assert path == tmp_path / "0001" / "report.html"
    script = write_script(tmp_path)
    installed = Path(find_spec("plotly").submodule_search_locations[0]) / "package_data" / "plotly.min.js"
    assert script.read_bytes() == installed.read_bytes()
    assert script == path.parent / "../plotly.min.js" or script.samefile(path.parent / "../plotly.min.js")
    written = script.stat()
    write_script(tmp_path)
    assert script.stat().st_mtime_ns == written.st_mtime_ns
    assert script.stat().st_ino == written.st_ino
    assert sorted(p.name for p in tmp_path.iterdir()) == ["0001", "plotly.min.js"]
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]
    assert path.read_text(encoding="utf-8") == render_page(a_report(), [a_figure()])


def test_older_page_and_damaged_script_are_replaced(tmp_path):
    (tmp_path / "report.html").write_text("old")
    damaged = bytearray(plotly_script().read_bytes())
    damaged[1000] ^= 1
    (tmp_path / "plotly.min.js").write_bytes(damaged)
    write_page(tmp_path, render_page(a_report(), []), PAGE_NAME)
    write_script(tmp_path)
    assert (tmp_path / "plotly.min.js").read_bytes() == plotly_script().read_bytes()
    assert "old" not in (tmp_path / "report.html").read_text(encoding="utf-8")[:20]
    assert len(list(tmp_path.iterdir())) == 2


def test_processes_that_write_the_script_at_once_leave_one_whole_one(tmp_path):
    with ThreadPoolExecutor(4) as crew:
        list(crew.map(write_script, [tmp_path] * 8))
    assert [p.name for p in tmp_path.iterdir()] == ["plotly.min.js"]
    assert (tmp_path / "plotly.min.js").read_bytes() == plotly_script().read_bytes()


def test_page_that_stands_alone_holds_the_script_and_refers_to_nothing():
    page = render_page(a_report(), [a_figure()], standalone=True)
    parsed = PageElements(page)
    assert not [a["src"] for _, a in parsed.elements if "src" in a]
    assert "mass.csv" not in [a.get("href") for _, a in parsed.elements]
    script = gzip.decompress(base64.b64decode(parsed.scripts["plotly"]))
    assert script == plotly_script().read_bytes()
    assert len(page) < 2_500_000
    assert page == render_page(a_report(), [a_figure()], standalone=True)


def test_parts_of_scripts_that_ended_processes_left_are_removed_and_no_others(tmp_path):
    for name, age_s in (("0123abcd", 7200.0), ("4567abcd", 5.0), ("notes", 7200.0)):
        part = tmp_path / f".{SCRIPT_NAME}.{name}.partial"
        part.write_text("half")
        os.utime(part, (time.time() - age_s, time.time() - age_s))
    (tmp_path / "mine.partial").write_text("mine")
    for _ in range(2):
        write_script(tmp_path)
        assert {path.name for path in tmp_path.iterdir()} == {
            SCRIPT_NAME, "mine.partial", f".{SCRIPT_NAME}.4567abcd.partial", f".{SCRIPT_NAME}.notes.partial"
        }  # fmt: skip


@pytest.mark.parametrize("write", [lambda folder: write_page(folder, "page", PAGE_NAME), write_script])
def test_folder_that_cannot_be_written_is_a_store_error(tmp_path, write):
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(StoreError, match=r"taken.*cannot be written"):
        write(tmp_path / "taken")


@pytest.mark.parametrize("with_package", [False, True])
def test_missing_script_is_a_store_error_with_its_remedy(tmp_path, monkeypatch, with_package):
    spec = ModuleSpec("plotly", None, origin=str(tmp_path), is_package=True) if with_package else None
    monkeypatch.setattr(page_files, "find_spec", lambda _name: spec)
    with pytest.raises(StoreError, match="pip install"):
        write_script(tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(StoreError, match="pip install"):
        render_page(a_report(), [], standalone=True)


@pytest.mark.whole_way
def test_neither_import_nor_rendering_loads_plotly_s_package_pandas_or_what_of_scipy_takes_long():
    code = (
        "import sys, recoil_identification.report.page.html as h; early = set(sys.modules); h.plotly_script();"
        "h.render_page({'schema': h.SCHEMA, 'shot': '1', 'rig': 'r', 'mass': {}, 'rpe_percent': None, 'valid': False,"
        " 'reasons': [], 'provenance': {}}, []);"
        "print([m for m in ('plotly', 'pandas', 'scipy.stats', 'scipy.signal') if m in sys.modules], 'jinja2' in early)"
    )
    command = [sys.executable, "-c", code]
    root = Path(__file__).parents[4]
    run = subprocess.run(command, capture_output=True, text=True, check=True, cwd=root)
    assert run.stdout.split("\n")[0] == "[] False"


def test_hostile_names_neither_break_out_nor_get_lost():
    report = a_report(
        shot=HOSTILE,
        rig=HOSTILE,
        reasons=[HOSTILE],
        budget=[{"source": HOSTILE, "u_kg": 1.0}],
        alignment=[{"clock": HOSTILE, "status": HOSTILE, "method": HOSTILE, "detail": HOSTILE}],
        quality=[{"channel": HOSTILE, "check": HOSTILE, "verdict": HOSTILE, "detail": HOSTILE}],
        methods=[{"name": HOSTILE, "mass_kg": 1.0, "u_kg": 0.1, "note": HOSTILE}],
        summary={HOSTILE: HOSTILE},
        trace={"file": "javascript:alert(1)//" + HOSTILE},
        provenance={
            "version": HOSTILE,
            "inputs": [{"file": HOSTILE, "sha256": HOSTILE}],
            "parameters": {HOSTILE: HOSTILE},
        },
    )
    report["mass"] |= {"method": HOSTILE, "unit": HOSTILE}
    page = render_page(report, [a_figure(key=HOSTILE, name=HOSTILE, title=HOSTILE)])
    calm = PageElements(render_page(a_report(reasons=["one"]), [a_figure()]))
    parsed = PageElements(page)
    assert [tag for tag, _ in parsed.elements if tag in {"script", "img"}] == ["script"] * 3
    assert {t for t, _ in parsed.elements} == {t for t, _ in calm.elements}
    assert not [name for _, attributes in parsed.elements for name in attributes if name.startswith("on")]
    assert not [a["href"] for _, a in parsed.elements if "href" in a and not a["href"].startswith(("#", "./"))]
    assert parsed.text.count("{{7*7}}") >= 15
    assert parsed.carried("report")["shot"] == HOSTILE
    assert parsed.carried("figures")[0]["key"] == HOSTILE
    assert "\u2028" not in page.partition('id="report">')[2]


def test_names_in_drawings_are_neither_markup_nor_templates_for_plotly():
    figure = Figure(
        "k",
        "t",
        "c",
        "<b>x</b>",
        (Panel("<a href='q'>y</a>", (Trace("<i>%{x}</i> & co", [0.0], [1.0], "measured", "%{y}"),)),),
    )
    drawn = drawing(figure)
    assert drawn["data"][0]["name"] == "&lt;i&gt;% {x}&lt;/i&gt; &amp; co"
    assert drawn["data"][0]["hovertemplate"].count("%{") == 1
    assert "<" not in json.dumps(drawn["layout"])


def test_numbers_that_json_cannot_say_become_null():
    report = a_report(E_n=None, truth={"mass_kg": math.inf, "error_percent": math.nan})
    report["mass"] |= {"value": np.float64(780.0), "u": np.float32("nan"), "U95": np.array([math.nan, 1.0])}
    embedded = PageElements(render_page(report, [])).carried("report")
    assert embedded["mass"]["value"] == 780.0
    assert embedded["mass"]["u"] is None
    assert embedded["mass"]["U95"] == [None, 1.0]
    assert embedded["truth"] == {"mass_kg": None, "error_percent": None}
    assert embedded["provenance"]["parameters"]["bound"] is None


def test_gaps_and_limits_of_traces_arrive_as_gaps():
    x = np.arange(6.0)
    y = np.array([1.0, np.nan, 3.0, np.inf, 5.0, 6.0])
    line = HorizontalLine("none", math.nan)
    figure = Figure("k", "t", "c", "x", (Panel("y", (Trace("a", x, y, "measured"),), lines=(line,)),), shown=(0.0, 5.0))
    drawn = PageElements(render_page(a_report(), [figure])).carried("figures")[0]
    assert drawn["layout"]["shapes"] == []
    np.testing.assert_array_equal(np.isfinite(drawn["data"][0]["y"]), np.isfinite(y))
    np.testing.assert_allclose(drawn["layout"]["yaxis"]["range"], [0.7, 6.3])


@pytest.mark.parametrize("key", OPTIONAL_KEYS)
def test_page_does_without_any_optional_key(key):
    report = a_report()
    del report[key]
    assert "780.9" in render_page(report, [a_figure()])
    assert "780.9" in render_page(a_report(**{key: None}), [a_figure()])


def test_page_does_without_all_optional_keys_at_once():
    report = {k: v for k, v in a_report().items() if k in html.REQUIRED_KEYS}
    report |= {"mass": {"value": 781.234}, "rpe_percent": None, "provenance": {}}
    text = PageElements(render_page(report, [])).text
    assert "781.23" in text
    for absent in (
        "Methods compared",
        "Uncertainty budget",
        "Alignment of the clocks",
        "Quality of the recording",
    ):
        assert absent not in text
    assert not re.search(r"\b(None|nan|null|Undefined)\b", text.replace("{}", ""))


def test_optional_keys_are_shown():
    text = PageElements(render_page(a_report(), [a_figure()])).text
    for present in (
        "Methods compared",
        "agrees",
        "0.18",
        "781.5 kg",
        "−0.073 %",
        "fit percent",
        "97.31",
        "95.1 %",
        "What to see.",
    ):
        assert present in text


@pytest.mark.parametrize("key", html.REQUIRED_KEYS)
def test_report_without_a_key_that_all_have_is_refused(key):
    report = a_report()
    del report[key]
    with pytest.raises(ValueError, match=f"lacks {key}"):
        render_page(report, [])


def test_report_of_another_schema_and_doubled_figures_are_refused():
    with pytest.raises(ValueError, match="report/2"):
        render_page(a_report(schema="recoil-daq/report/2"), [])
    with pytest.raises(ValueError, match="same key"):
        render_page(a_report(), [a_figure(), a_figure()])


def test_shot_without_a_number_says_so_with_its_reasons():
    report = a_report(valid=False, reasons=["pressure is clipped"], rpe_percent={"value": None, "U95": None})
    report["mass"] |= {"value": None, "u": None, "U95": None}
    text = PageElements(render_page(report, [a_figure()])).text
    assert "no number" in text
    assert "NOT VALID" in text
    assert "pressure is clipped" in text
    assert "coverage interval" not in text
    assert "±" not in text


def test_first_line_is_rounded_to_the_uncertainty():
    line = tables.verdict(a_report())
    assert (line["mass"], line["spread"]) == ("780.9", "± 3.4")
    assert line["interval"] == "777.5 kg to 784.4 kg"
    assert line["specification"] == "782"
    assert line["rpe"] == "0.14"
    assert line["agrees"]


def test_interval_that_is_not_symmetric_shows_both_sides():
    report = a_report()
    report["mass"] |= {"value": 780.0, "U95": [778.0, 786.0]}
    assert tables.verdict(report)["spread"] == "+6.0 −2.0"


def test_tables_are_rounded_to_the_uncertainty():
    (clock,) = tables.alignment(a_report())
    assert (clock["offset"], clock["u_offset"], clock["drift"], clock["u_drift"]) == ("1.2341", "3.1", "12.3", "2.2")
    first, second = tables.methods(a_report())
    assert (first["mass"], first["u"], first["deviation"], first["strong"]) == ("780.9", "1.7", "−0.14", True)
    assert (second["mass"], second["u"], second["deviation"], second["strong"]) == ("741.3", "–", "+5.2", False)


GROUPED = [
    {"source": "breech_pressure sensitivity", "u_kg": 3.0, "group": "sensors"},
    {"source": "packing friction", "u_kg": 2.0, "group": "unread forces"},
    {"source": "brake_pressure sensitivity", "u_kg": 4.0, "group": "sensors"},
    {"source": "bore_area", "u_kg": 0.0, "group": "geometry"},
]


def test_the_uncertainty_is_said_by_groups_the_largest_first():
    grouped = a_report(mass={"value": 1000.0, "u": 5.4, "U95": [990.0, 1010.0], "specification": 1000.0})
    grouped["budget"] = GROUPED
    said = "u 0.54 %: sensors 0.50 %, forces that no gauge reads 0.20 %, lengths, areas and masses as stated 0.00 %"
    assert sentences.by_groups(grouped) == said
    assert ("standard uncertainty by groups", said) in tables.facts(grouped)
    page = render_page(grouped, [])
    assert said.replace(" %", "\u202f%") in page or said in page
    assert page.count("unread forces</td>") == 1
    # a report of an earlier version has none
    assert sentences.by_groups(a_report()) is None


def test_what_mass_it_is_and_of_what_the_specification_consists_stand_in_the_head():
    of = {
        "m3_kg": 782.0, "u_m3_kg": 0.0, "added_mass_kg": 120.0, "u_added_mass_kg": 0.05, "carried_mass_kg": 6.0,
        "u_carried_mass_kg": 0.9,
    }  # fmt: skip
    report = a_report(measurand="the mass that the forces move", uncertainty={"coverage_factor": 2.2, "U_kg": 3.4})
    report["mass"] = report["mass"] | {"specification": 908.0, "specification_of": of}
    said = "m3 782 kg + 120 kg (u 0.050 kg) added + 6 kg (u 0.90 kg) of oil and rods that go along"
    assert ("specification", said) in tables.facts(report)
    assert tables.verdict(report)["expanded"] == "3.4 kg"
    page = PageElements(render_page(report, []))
    head = " ".join(page.text.split())
    assert "It is the mass that the forces move." in head
    assert "oil and rods that go along" in head
    # what an earlier version wrote has neither
    assert "It is the mass" not in " ".join(PageElements(render_page(a_report(), [])).text.split())
    assert sentences.specified(a_report()) is None


def test_sources_below_one_per_cent_are_folded_with_their_sum():
    rows = [{"source": "one", "u_kg": 3.0}, *({"source": f"small {k}", "u_kg": 0.2} for k in range(4))]
    report = a_report(budget=rows)
    assert [row["folded"] for row in tables.budget(report)] == [False, True, True, True, True]
    rest = tables.budget_rest(report)
    assert (rest["source"], rest["u"], rest["share"]) == ("4 more, together", "0.40", "1.7")
    assert tables.budget_rest(a_report(budget=rows[:1])) is None
    page = render_page(report, [])
    assert "4 sources below 1 % of the variance each" in page
    assert page.index("4 more, together") < page.index("small 0")


def test_an_error_of_the_published_method_without_a_meaning_is_no_row_of_digits():
    assert (
        tables.methods(a_report(methods=[{"name": "paper", "mass_kg": 700.0, "u_kg": 5.0, "rpe_percent": 6.3e25}]))[0][
            "rpe"
        ]
        == "> 1000"
    )


def test_budget_stands_by_size_with_its_shares_of_the_variance():
    rows = tables.budget(a_report())
    assert [(r["source"], r["u"], r["share"], r["width"]) for r in rows] == [
        ("pressure", "1.2", "94", "94.1"),
        ("friction", "0.30", "6", "5.9"),
    ]
    assert tables.budget_total(a_report())["u"] == "1.7"


def test_what_needs_attention_comes_first():
    assert [row["verdict"] for row in tables.quality(a_report())] == ["fail", "ok"]
    assert tables.quality_in_words(a_report()) == "1 of 2 checks asks for attention; 1 check passed."


@pytest.mark.parametrize(
    ("value", "u", "expected"),
    [
        (780.9312, 3.42, ("780.9", "3.4")),
        (780.9312, 0.0996, ("780.93", "0.10")),
        (780.9312, 99.6, ("780", "100")),
        (123456.0, 1234.0, ("123500", "1200")),
        (-0.00123, 0.00045, ("−0.00123", "0.00045")),
        (-0.001, 0.4, ("0.00", "0.40")),
        (741.3, None, ("741.3", "–")),
        (741.3, math.nan, ("741.3", "–")),
        (None, 1.0, ("–", "1.0")),
        (0.0, 0.0, ("0", "0")),
    ],
)
def test_value_has_the_digits_of_its_uncertainty(value, u, expected):
    assert rounded(value, u) == expected


@pytest.mark.whole_way
@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e4))
@settings(max_examples=200, deadline=None)
def test_rounding_keeps_the_value_within_a_twentieth_of_the_uncertainty(value, u):
    value_text, u_text = (float(text.replace("−", "-")) for text in rounded(value, u))
    assert abs(value_text - value) <= 0.0501 * u + 1e-9 * abs(value)
    assert abs(u_text - u) <= 0.0501 * u


def test_numbers_without_an_uncertainty_are_plain():
    assert [plain(v) for v in (782.0, 0.02, 0.0, 28756, 1e-9, math.inf)] == [
        "782",
        "0.02",
        "0",
        "28756",
        "1e−09",
        "–",
    ]
    assert significant(0.0012, 2) == "0.0012"
    assert fixed(-0.04, 1) == "0.0"


def decimate(x, y, buckets=4000):
    """The samples of a trace that its envelope keeps."""
    chosen = envelope_indices(y, bucket_starts(x, buckets))
    return x[chosen], y[chosen]


@pytest.mark.whole_way
@given(
    y=arrays(np.float64, st.integers(1, 600), elements=st.floats(-1e6, 1e6) | st.just(math.nan)),
    buckets=st.integers(4, 60),
)
@settings(max_examples=150, deadline=None)
def test_decimation_keeps_extremes_ends_and_order(y, buckets):
    x = np.arange(y.size, dtype=float)
    thin_x, thin_y = decimate(x, y, buckets)
    index = thin_x.astype(int)
    assert np.all(np.diff(index) > 0)
    np.testing.assert_array_equal(thin_y, y[index])
    assert (index[0], index[-1]) == (0, y.size - 1)
    assert thin_x.size <= max(5 * buckets + 2, 2 * buckets)
    edges = np.append(bucket_starts(x, buckets), y.size)
    for first, last in pairwise(edges):
        bucket, kept = y[first:last], thin_y[(index >= first) & (index < last)]
        assert np.isnan(bucket).any() == np.isnan(kept).any()
        if not np.isnan(bucket).all():
            assert (np.nanmin(kept), np.nanmax(kept)) == (np.nanmin(bucket), np.nanmax(bucket))


def test_gap_of_a_bucket_s_length_stays_a_gap_and_lone_gaps_do_not_erase_the_line():
    y = noise(10_000)
    y[::7] = math.nan
    y[4000:4400] = math.nan
    thin_x, thin_y = decimate(np.arange(y.size), y, 200)
    assert not np.isfinite(thin_y[(thin_x >= 4000) & (thin_x < 4400)]).any()
    finite = np.isfinite(thin_y)
    drawn = (finite[1:] & finite[:-1]).sum()
    assert drawn > 0.3 * finite.sum()


def test_decimation_takes_at_most_two_samples_of_a_bucket_without_a_gap():
    assert decimate(np.arange(200_000), noise(200_000))[0].size <= 8002
    assert decimate(np.arange(200_000), np.zeros(200_000))[0].size <= 4002


def test_part_that_is_shown_first_is_cut_finer():
    x = np.linspace(0.0, 10.0, 1_000_000)
    starts = bucket_starts(x, 4000, shown=(5.0, 5.2))
    inside = ((x[starts] >= 5.0) & (x[starts] <= 5.2)).sum()
    assert 2900 <= inside <= 3100
    assert starts[0] == 0
    assert starts.size <= 4002
    assert np.diff(starts).min() > 0


@pytest.mark.parametrize("shown", [(-5.0, -1.0), (-5.0, 50.0), (9.999, 60.0), (3.0, 3.0000001)])
def test_shown_range_may_lie_anywhere(shown):
    x = np.linspace(0.0, 10.0, 50_000)
    y = noise(x.size)
    starts = bucket_starts(x, 100, shown=shown)
    assert starts.size <= 102
    kept = y[envelope_indices(y, starts)]
    assert (kept.min(), kept.max()) == (y.min(), y.max())


def test_logarithmic_axis_gets_equal_buckets_per_decade():
    f = np.arange(0.0, 100_000.0)
    starts = bucket_starts(f, 1000, log=True)
    decades = [((f[starts] >= a) & (f[starts] < 10 * a)).sum() for a in (1e2, 1e3, 1e4)]
    assert max(decades[1:]) - min(decades[1:]) <= 2
    assert decades[0] > 80


def test_less_than_four_buckets_are_refused():
    with pytest.raises(ValueError, match="4 or more"):
        bucket_starts(np.arange(2.0), 2)


def test_trace_is_frozen_and_does_not_alias_the_caller_s_arrays():
    x = np.arange(3.0)
    trace = Trace("a", x, x, "measured")
    x[0] = 9.0
    assert trace.y[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        trace.y[0] = 1.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "wavy"}, "wavy"),
        ({"y": [1.0]}, "as long as x"),
        ({"x": [[0.0, 1.0]]}, "one axis"),
        ({"x": [0.0, math.nan]}, "gaps belong into y"),
        ({"kind": "band"}, "y_low and y_high"),
        ({"kind": "band", "y_low": [0.0, 0.0]}, "y_low and y_high"),
        ({"y_low": [0.0, 0.0], "y_high": [1.0, 1.0]}, "y_low and y_high"),
        ({"kind": "band", "y_low": [0.0], "y_high": [1.0, 1.0]}, "y_low"),
    ],
)
def test_trace_refuses_what_does_not_fit(arguments, message):
    with pytest.raises(ValueError, match=message):
        Trace(**({"name": "a", "x": [0.0, 1.0], "y": [0.0, 1.0], "kind": "measured"} | arguments))


def test_figure_refuses_no_panels_and_falling_ranges():
    with pytest.raises(ValueError, match="no panel"):
        Figure("k", "t", "c", "x", ())
    with pytest.raises(ValueError, match="ascend"):
        a_figure(shown=(1.0, 0.0))


def test_panels_share_one_time_axis_unless_they_have_their_own():
    trace = Trace("a", [1.0, 10.0], [1.0, 1e15], "measured")
    panels = (
        Panel("travel / m", (trace,)),
        Panel("density", (trace,), y_scale="log", x_label="frequency / Hz"),
        Panel("velocity / (m/s)", (trace,), spans=(Span("interval", 0.0, 1.0), Span("peak", 2.0, 2.0))),
    )
    drawn = drawing(Figure("k", "t", "c", "time / s", panels, shown=(0.0, 20.0)))
    assert [(t["xaxis"], t["yaxis"]) for t in drawn["data"]] == [("x", "y"), ("x2", "y2"), ("x", "y3")]
    layout = drawn["layout"]
    assert {k for k in layout if k.startswith("xaxis")} == {"xaxis", "xaxis2"}
    assert (layout["xaxis"]["anchor"], layout["xaxis"]["range"]) == ("y3", [0.0, 20.0])
    assert (layout["xaxis2"]["type"], "range" in layout["xaxis2"]) == ("linear", False)
    assert layout["yaxis2"]["type"] == "log"
    assert layout["yaxis2"]["range"][0] == pytest.approx(15 - 10 - math.log10(2))
    assert [s["type"] for s in layout["shapes"]] == ["rect", "line"]
    domains = [layout[f"yaxis{n}"]["domain"] for n in ("", "2", "3")]
    assert domains[0][1] == 1.0
    assert domains[2][0] == pytest.approx(0.0, abs=1e-12)
    assert domains[0][0] > domains[1][1] > domains[1][0] > domains[2][1]


def test_band_has_an_outline_for_each_stretch_and_its_half_width_in_the_read_out():
    x = np.arange(10.0)
    y = np.full(10, 780.0)
    y[4:6] = math.nan
    band = Trace("mass", x, y, "band", "kg", y_low=y - 2.0, y_high=y + 2.0, visible=False)
    outline, line = drawing(Figure("k", "t", "c", "x", (Panel("y", (band,)),)))["data"]
    edge_x, edge_y = outline["x"], outline["y"]
    assert outline["fill"] == "toself"
    assert np.isnan(edge_y).sum() == 2
    assert not ((edge_x > 3.0) & (edge_x < 6.0)).any()
    assert (np.nanmin(edge_y), np.nanmax(edge_y)) == (778.0, 782.0)
    np.testing.assert_array_equal(line["customdata"], np.where(np.isnan(y), np.nan, 2.0))
    assert outline["visible"] == line["visible"] == "legendonly"


def test_outline_of_a_thinned_band_holds_every_limit():
    x = np.linspace(0.0, 1.0, 50_000)
    y = noise(x.size)
    band = Trace("mass", x, y, "band", y_low=y - 1.0, y_high=y + 1.0)
    outline, _ = drawing(Figure("k", "t", "c", "x", (Panel("y", (band,)),)), buckets=200)["data"]
    edge_y = outline["y"]
    assert np.nanmax(edge_y) == pytest.approx(y.max() + 1.0, rel=1e-6)
    assert np.nanmin(edge_y) == pytest.approx(y.min() - 1.0, rel=1e-6)
    assert edge_y.size < 500


@pytest.mark.whole_way
def test_page_stays_small_however_much_was_recorded():
    x = np.arange(200_000) / 2e5
    panels = tuple(
        Panel("y", tuple(Trace(f"{p}{t}", x, noise(x.size, t), "measured") for t in range(6))) for p in range(2)
    )
    figures = [Figure(f"f{i}", "t", "c", "time / s", panels, shown=(0.1, 0.3)) for i in range(3)]
    page = render_page(a_report(), figures)
    assert 100_000 < len(page.encode()) < 700_000  # the still drawings of 36 traces among it
    first = drawings(figures)[0]["data"][0]
    assert np.nanmax(first["y"]) == noise(x.size, 0).max()


def test_traces_to_compare_differ_in_colour():
    kinds = ("measured", "filtered", "model", "reference", "reference", "measured", "filtered")
    traces = tuple(Trace(str(i), [0.0], [1.0], kind) for i, kind in enumerate(kinds))
    drawn = drawing(Figure("k", "t", "c", "x", (Panel("y", traces),)))["data"]
    hues = [tuple(re.findall(r"\d+", part["line"]["color"])[:3]) for part in drawn]
    assert hues[0] == hues[1]
    assert hues[5] == hues[6]
    assert len({hues[i] for i in (0, 2, 3, 4)}) == 4
    chosen = drawing(Figure("k", "t", "c", "x", (Panel("y", (Trace("a", [0.0], [1.0], "points", hue=0),)),)))["data"]
    assert tuple(re.findall(r"\d+", chosen[0]["marker"]["color"])) == hues[0]


def test_empty_trace_is_drawn_as_nothing():
    empty = np.empty(0)
    traces = (Trace("a", empty, empty, "measured"), Trace("b", empty, empty, "band", y_low=empty, y_high=empty))
    drawn = drawing(Figure("k", "t", "c", "x", (Panel("y", traces),), shown=(0.0, 1.0)))
    assert [part["x"].size for part in drawn["data"]] == [0, 0, 0]


def test_how_a_shot_was_fired_is_on_its_page():
    assert tables.logged(a_report()) == tables.logged(a_report(shot_log=None)) == []
    row = {"shot": "0001", "configuration": HOSTILE, "added_mass_kg": 120.0}
    assert tables.logged(a_report(shot_log=row)) == [
        ("configuration", HOSTILE),
        ("added mass, in the specification", "120 kg (taken as exact)"),
    ]
    row["u_added_mass_kg"] = 0.05
    assert tables.logged(a_report(shot_log=row))[1][1] == "120 kg (u 0.05 kg)"
    page = render_page(a_report(shot_log=row), [])
    assert "120 kg (u 0.05 kg)" in page
    assert "<img src=x" not in page


def test_the_head_says_verdict_peaks_date_and_what_was_assumed_in_words():
    row = {"shot": "0001", "charge": "full", "charge_temperature_c": 21.5, "notes": ""}
    report = a_report(
        shot_log=row,
        started="2026-11-20T09:12:44.120+01:00",
        started_source="daq.csv, header",
        peaks={"breech_pressure_pa": 1.283e8, "recoil_travel_m": 0.8162, "impulse_n_s": 7604.0},
        assumptions=[{"quantity": "bore_area", "taken": "taken as exact", "detail": ""}],
    )
    text = " ".join(PageElements(render_page(report, [])).text.split())
    for said in (
        "Nothing speaks against this mass; it agrees with the specification of 782 kg.",
        "relative percentage error (RPE)",
        "peak breech pressure128.3 MPa",
        "recoil length816.2 mm",
        "impulse of the driving force7.60 kN s",
        "2026-11-20T09:12:44.120+01:00 (daq.csv, header)",
        "chargefull",
        "charge temperature c21.5",
        "Assumed: taken as exact: bore_area.",
    ):
        assert said in text
    assert "date and timenot recorded" in " ".join(PageElements(render_page(a_report(), [])).text.split())


OVERDUE = {
    "code": "calibration", "about": "p_brake", "severity": "warn",
    "text": "p_brake: calibration was due 2026-03-01, 1 days before the shot of 2026-03-02",
}  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"valid": False, "reasons": ["a"]}, "Not to be relied on: one reason speaks against this mass."),
        ({"valid": False, "reasons": ["a", "b"]}, "Not to be relied on: 2 reasons speak against this mass."),
        ({"E_n": -3.0}, "Nothing speaks against this mass; it deviates from the specification of 782 kg."),
        ({"E_n": None}, "Nothing speaks against this mass."),
        (
            {"findings": [OVERDUE]},
            (
                "Valid, but a calibration does not cover the day of the shot; it agrees with the specification of "
                "782 kg."
            ),
        ),
        ({"E_n": None, "findings": 2 * [OVERDUE]}, "Valid, but 2 calibrations do not cover the day of the shot."),
        (
            {"valid": False, "reasons": ["a"], "findings": [OVERDUE]},
            ("Not to be relied on: one reason speaks against this mass."),
        ),
    ],
)
def test_the_verdict_is_a_sentence(changes, said):
    assert sentences.in_words(a_report(**changes)) == said


def test_calibrations_that_do_not_cover_the_day_stand_in_the_head_of_page_and_paper():
    for report in (a_report(findings=5 * [OVERDUE]), a_report(valid=False, reasons=["a"], findings=5 * [OVERDUE])):
        head = head_of(report)
        assert head.tone == ("doubt" if report["valid"] else "bad")
        assert head.reasons[-1] == (
            f"5 calibrations do not cover the day of the shot: {'; '.join(3 * [OVERDUE['text']])}; and 2 more."
        )
        assert OVERDUE["text"] in render_page(report, []).partition('id="mass"')[0]
    other = {**OVERDUE, "code": "noise"}
    assert head_of(a_report(findings=[other, {**OVERDUE, "severity": "note"}])).reasons == ()


def test_what_is_judged_by_the_day_of_the_ingest_is_not_said_of_the_shot():
    said = sentences.in_words(
        a_report(findings=[OVERDUE], E_n=None, calibration_day={"on": "2026-11-28", "of": "ingest"})
    )
    assert said == ("Valid, but a calibration does not cover the day of the ingest.")


def test_checks_that_passed_are_folded_away_and_the_others_are_not():
    page = render_page(a_report(), [])
    open_ones, _, folded = page.partition('id="quality"')[2].partition("<details>")
    assert "drop-out" in open_ones
    assert "clipping" not in open_ones
    assert "1 passed" in folded
    assert "clipping" in folded
