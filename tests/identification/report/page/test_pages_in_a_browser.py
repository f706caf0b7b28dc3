"""What pages do in a real browser: they draw without an error or a request, keep their width, and move together."""

from __future__ import annotations

import html
import re
import unicodedata
from pathlib import Path
from typing import Any

import pytest
from pypdf import PdfReader

from recoil_acquisition.remark import Reason, ReasonCode
from recoil_acquisition.shot.shot import InputFile
from recoil_identification.campaign.combination import combine
from recoil_identification.report.document.campaign_document import campaign_document, with_history
from recoil_identification.report.document.certificate_document import Behind, certificate_document
from recoil_identification.report.document.document import report_document
from recoil_identification.report.document.report_files import to_json
from recoil_identification.report.figure.campaign_figures import campaign_figures
from recoil_identification.report.figure.figures import report_figures
from recoil_identification.report.page.html import (
    PAGE_NAME,
    render_campaign_page,
    render_certificate_page,
    render_page,
    render_results_page,
    render_target_page,
)
from recoil_identification.report.page.page_files import write_page, write_script
from recoil_identification.report.results.history import THIS, history_document, history_figure, row_of, shared_kg2
from recoil_identification.report.results.shot_index import index_document, row_of_report
from recoil_identification.report.results.sweep import found_row, sweep_document, sweep_figures
from recoil_identification.targets.target_document import target_document
from recoil_identification.targets.target_result import Quantity, Table, TargetResult
from recoil_rigs.tables.issue import Issue
from tests.builders.browsers import find_browser, print_page, visit
from tests.builders.campaign_summaries import campaign_of
from tests.builders.virtual_shots import identified, virtual_shot
from tests.identification.report.page.test_report_html import a_report

CONTROL = "http://127.0.0.1:9/asked-on-purpose.png"
"""What the last page is made to ask for, so that it is known to be seen."""
SHOT_FILE = InputFile("s1.h5", "ab" * 32, 123, "", "shot file")
TELEPHONE_PX, SCREEN_PX = 390, 1400
LOGGED = a_report(shot_log={"shot": "0001", "packed": "12 rings"})
"""With a column of its own that is called as a page calls its arrays."""
LOOK = """
const wait = async (until) => {
  for (let k = 0; k < 300 && !until(); k++) await new Promise((next) => setTimeout(next, 20));
};
const style = (id) => getComputedStyle(document.getElementById(id));
const hints = () => ["missing", "old"].filter((id) => style(id).display !== "none");
await wait(() => document.documentElement.dataset.drawn === "all" || hints().length);
const root = document.documentElement, plots = [...document.querySelectorAll(".plot")];
const drawn = plots.filter((plot) => plot._fullLayout);
const found = { drawn: drawn.length, plots: plots.length, hints: hints(), script: !!window.Plotly };
found.beyond = root.scrollWidth - root.clientWidth;
found.outside = drawn.filter((plot) => plot.querySelector("svg").clientWidth > plot.clientWidth + 1).length;
found.cut = [...document.querySelectorAll(".scroll")].filter((one) => one.scrollWidth > one.clientWidth).length;
const headed = (one) => getComputedStyle(one).getPropertyValue("--h");
const cell = [...document.querySelectorAll("#budget tbody td")].find((one) => headed(one).includes("kg"));
found.heading = cell && getComputedStyle(cell, "::before").content;
if (!window.Plotly) return found;
const overTime = (plot) => Object.values(plot.layout).some((axis) => axis && /^time/.test(axis.title?.text ?? ""));
const timed = drawn.filter(overTime);
const axis = (p) => p._fullLayout.xaxis;
found.timed = timed.length;
if (timed.length > 1) {
  await Plotly.relayout(timed[0], { "xaxis.range": [0.11, 0.14] });
  await wait(() => timed.every((p) => axis(p).range[0] === 0.11));
  found.ranges = timed.map((p) => axis(p).range.slice());
  timed[0].focus();
  found.focused = document.activeElement === timed[0];
  const press = async (key, there) => {
    document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
    await wait(() => timed.every((p) => there(axis(p).range)));
    return timed.map((p) => axis(p).range.slice());
  };
  found.closer = await press("+", ([low]) => Math.abs(low - 0.116) < 1e-9);
  found.later = await press("ArrowRight", ([low]) => Math.abs(low - 0.1178) < 1e-9);
  found.reset = await press("0", ([low, high]) => high - low > 0.1);
  await Plotly.relayout(timed[0], { "xaxis.range": [0.11, 0.14] });
  await wait(() => timed.every((p) => axis(p).range[0] === 0.11));
  const folded = document.querySelector("section.folded details");
  if (folded) {
    folded.open = true;
    const inside = folded.querySelector(".plot");
    await wait(() => inside._fullLayout);
    found.unfolded = inside._fullLayout.xaxis.range.slice();
  }
  // only what is on the screen is read
  const read = timed.find((plot) => plot.data.some((trace) => trace.name === "breech, recorded"));
  const readAt = async (plot, time) => {
    const other = timed.find((one) => one !== plot);
    plot.scrollIntoView({ block: "center" });
    other.emit("plotly_hover", { xvals: [time], points: [] });
    await new Promise((next) => setTimeout(next, 100));
    return [other, [...plot.querySelectorAll(".hoverlayer text")].map((text) => text.textContent).join(" ")];
  };
  const [other, readOut] = await readAt(read, 0.12), line = read.querySelector(".instant");
  found.instant = line && line.style.display === "block"
    ? axis(read).p2d(parseFloat(line.style.left) - axis(read)._offset) : null;
  found.readOut = readOut;
  other.emit("plotly_unhover", {});
  found.instantAfter = line && line.style.display;
  // the carriage turns back then
  found.minus = [];
  for (const plot of timed) found.minus.push((await readAt(plot, 0.1395))[1]);
}
const measured = plots.find((plot) => plot.data?.some((trace) => trace.name === "breech, recorded"));
const shown = () => measured.data.map((trace) => trace.visible ?? true);
const buttons = [...document.querySelectorAll("button[data-show]")];
found.switched = {};
for (const button of buttons) {
  button.click();
  await new Promise((next) => setTimeout(next, 300));
  found.switched[button.dataset.show] = shown();
}
const save = document.getElementById("save");
if (save) {
  let kept;
  URL.createObjectURL = (blob) => { kept = blob; return "#"; };
  HTMLAnchorElement.prototype.click = () => {};
  save.click();
  found.saved = JSON.parse(await kept.text());
}
return found;
"""


@pytest.fixture(scope="module")
def browser() -> str:
    found = find_browser()
    if found is None:
        pytest.skip("no browser of Chromium's kind on this machine: pages are not looked at")
    return found


@pytest.fixture(scope="module")
def seen(browser: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    reports = tmp_path_factory.mktemp("reports")
    figures = report_figures(identified("mixed"))
    shot = write_page(reports / "0001", render_page(a_report(), figures), PAGE_NAME)
    alone = write_page(reports / "moved" / "deeper", render_page(LOGGED, figures[:1], standalone=True), PAGE_NAME)
    lost = write_page(reports / "moved" / "lost", render_page(a_report(), figures[:1]), PAGE_NAME)
    write_script(reports)
    campaign = combine(campaign_of((0.0, 120.0) * 3, seed=4).shots)
    document = campaign_document(campaign, version="1", inputs=[], parameters={}, pages=None)
    combined = write_page(reports, render_campaign_page(document, campaign_figures(campaign, None)), "campaign.html")
    asking = reports / "asking.html"
    asking.write_text(f'<title>asking</title><body><img src="{CONTROL}"></body>', encoding="utf-8")
    pages = {
        "screen": (shot, SCREEN_PX),
        "telephone": (shot, TELEPHONE_PX),
        "alone": (alone, SCREEN_PX),
        "lost": (lost, SCREEN_PX),
        "campaign": (combined, TELEPHONE_PX),
        "asking": (asking, TELEPHONE_PX),
    }
    return visit(browser, pages, LOOK, folder=reports / "browser")


@pytest.mark.indispensable("a page in a browser")
def test_the_page_of_a_shot_draws_in_a_browser(browser: str, tmp_path: Path) -> None:
    figures = report_figures(identified("mixed"))
    page = write_page(tmp_path / "0001", render_page(a_report(), figures), PAGE_NAME)
    write_script(tmp_path)
    seen = visit(browser, {"shot": (page, SCREEN_PX)}, MEASURE.replace("WAITS", "true"), folder=tmp_path / "browser")
    assert seen["shot"]["errors"] == []
    assert seen["shot"]["found"]["drawn"] == len(figures) - 1, "one is folded"
    assert seen["shot"]["found"]["beyond"] <= 0


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["screen", "telephone", "alone", "campaign"])
def test_a_page_draws_all_its_figures_without_an_error(seen: dict[str, Any], name: str) -> None:
    page = seen[name]
    assert page["errors"] == []
    assert page["found"]["hints"] == []
    folded = 1 if name in ("screen", "telephone") else 0
    assert page["found"]["drawn"] == page["found"]["plots"] - folded > 0


@pytest.mark.whole_way
def test_no_page_asks_for_anything_beyond_its_files(seen: dict[str, Any]) -> None:
    assert seen[""] == [CONTROL]


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["telephone", "campaign"])
def test_a_page_as_wide_as_a_telephone_does_not_scroll_sideways(seen: dict[str, Any], name: str) -> None:
    assert seen[name]["found"]["beyond"] <= 0
    assert seen[name]["found"]["outside"] == 0
    assert seen[name]["found"]["cut"] == 0


@pytest.mark.whole_way
def test_on_a_telephone_a_cell_of_a_table_bears_its_heading(seen: dict[str, Any]) -> None:
    assert "kg" in seen["telephone"]["found"]["heading"]
    assert seen["screen"]["found"]["heading"] == "none"


@pytest.mark.whole_way
def test_a_report_is_printed_with_each_table_on_the_sheet_of_its_heading(browser: str, tmp_path: Path) -> None:
    report = report_document(virtual_shot("mixed").shot, identified("mixed"), version="1", shot_file=SHOT_FILE)
    page = write_page(tmp_path / "0001", render_page(report, report_figures(identified("mixed"))), PAGE_NAME)
    write_script(tmp_path)
    print_page(browser, page, tmp_path / "sheets.pdf")
    sheets = [" ".join(sheet.extract_text().split()) for sheet in PdfReader(tmp_path / "sheets.pdf").pages]
    for heading, first in (("Methods compared", "calibrated"), ("Uncertainty budget", "packing friction")):
        (sheet,) = (text for text in sheets if heading in text)
        assert first in sheet.partition(heading)[2], heading


@pytest.mark.whole_way
def test_a_page_that_was_moved_away_from_its_script_says_what_it_needs(seen: dict[str, Any]) -> None:
    assert seen["lost"]["found"]["hints"] == ["missing"]
    assert not seen["lost"]["found"]["script"]


@pytest.mark.whole_way
def test_zoom_of_one_figure_moves_all_others_over_that_time_and_those_unfolded_later(seen: dict[str, Any]) -> None:
    found = seen["screen"]["found"]
    assert found["timed"] >= 6
    assert found["ranges"] == [[0.11, 0.14]] * found["timed"]
    assert found["unfolded"] == [0.11, 0.14]


@pytest.mark.whole_way
def test_keys_zoom_and_move_a_figure_and_with_it_all_others_over_that_time(seen: dict[str, Any]) -> None:
    found = seen["screen"]["found"]
    assert found["focused"]
    for low, high in found["closer"]:
        assert (low, high) == pytest.approx((0.116, 0.134))
    for low, high in found["later"]:
        assert (low, high) == pytest.approx((0.1178, 0.1358))
    assert all(high - low > 0.1 for low, high in found["reset"])


@pytest.mark.whole_way
def test_the_instant_that_one_figure_is_read_at_is_shown_in_the_others(seen: dict[str, Any]) -> None:
    found = seen["screen"]["found"]
    assert found["instant"] == pytest.approx(0.12, abs=1e-6)
    assert found["instantAfter"] == "none"
    assert "breech" in found["readOut"]
    assert "MPa" in found["readOut"]


@pytest.mark.whole_way
def test_a_read_out_has_true_minus_signs(seen: dict[str, Any]) -> None:
    told = " ".join(seen["screen"]["found"]["minus"])
    assert "\N{MINUS SIGN}" in told
    assert " -" not in told


@pytest.mark.whole_way
def test_the_switch_shows_what_was_recorded_or_filtered_or_both(seen: dict[str, Any]) -> None:
    switched = seen["screen"]["found"]["switched"]
    assert switched["recorded"] == [True, "legendonly"] * 3
    assert switched["filtered"] == ["legendonly", True] * 3
    assert switched["both"] == [True, True] * 3


@pytest.mark.whole_way
def test_the_report_that_a_page_saves_is_the_one_that_it_was_made_of(seen: dict[str, Any]) -> None:
    assert seen["alone"]["found"]["saved"] == to_json(LOGGED)


SCRIPTS = re.compile("<script.*?</script>", re.DOTALL)
WIDTHS_PX = (1400, 1024, 900, 761, 700, 390)
DARK_PX = (1024, 390)
"""Nothing is wider in another colour."""
KINDS = ("shot", "target", "campaign", "season", "sweep", "index", "certificate")
DRAWN = tuple(name for name in KINDS if name not in ("index", "certificate"))
"""Kinds that have figures."""
SHEET_PX = 690
"""Width of an A4 sheet between its margins."""
LEAST_CONTRAST = 4.5
"""Of text on what is behind it (WCAG 2.2, 1.4.3)."""
MEASURE = """
const told = () => ["missing", "old"].some((id) => getComputedStyle(document.getElementById(id)).display !== "none");
const waits = WAITS && document.getElementById("packed");
for (let k = 0; k < 300 && waits && document.documentElement.dataset.drawn !== "all" && !told(); k++)
  await new Promise((next) => setTimeout(next, 20));
const root = document.documentElement;
const cut = [...document.querySelectorAll("main *")].filter((one) => {
  const box = one.getBoundingClientRect(), style = getComputedStyle(one);
  return box.width > 0 && style.position !== "absolute" && !one.closest("pre, .plot, .skip")
    && box.right > root.clientWidth + 1;
});
const channels = (colour) => colour.match(/[\\d.]+/g).map(Number);
const light = (colour) => {
  const [r, g, b] = channels(colour).map((v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const behind = (one) => {
  for (; one; one = one.parentElement) {
    const colour = getComputedStyle(one).backgroundColor;
    if ((channels(colour)[3] ?? 1) > 0) return colour;
  }
  return "rgb(255, 255, 255)";
};
const contrast = (one) => {
  const [a, b] = [light(getComputedStyle(one).color), light(behind(one))].sort((x, y) => y - x);
  return (a + 0.05) / (b + 0.05);
};
const texts = [...document.querySelectorAll("main :is(.stamp, .chip, .mass, p, th, td, dt, dd, li, a, h2, summary)")];
const faint = texts.filter((one) => one.getBoundingClientRect().width > 0 && contrast(one) < LEAST);
return {
  beyond: root.scrollWidth - root.clientWidth,
  scrolled: [...document.querySelectorAll(".scroll")].filter((one) => one.scrollWidth > one.clientWidth + 1).length,
  cut: cut.map((one) => `${one.tagName} ${one.className} ${one.textContent.slice(0, 40)}`).slice(0, 5),
  still: [...document.querySelectorAll("svg.still")].filter((one) => one.getBoundingClientRect().width > 100).length,
  drawn: [...document.querySelectorAll(".plot")].filter((one) => one._fullLayout).length,
  page: light(behind(document.body)),
  faint: faint.map((one) => [one.tagName, one.className, one.textContent.slice(0, 30), contrast(one)]).slice(0, 5),
  hint: [...document.querySelectorAll(".missing")].filter((one) => getComputedStyle(one).display !== "none")
    .map((one) => one.textContent).join(" "),
  mass: document.querySelector(".plot")?.getBoundingClientRect().top,
  height: root.scrollHeight,
  stamp: document.querySelector(".stamp")?.getBoundingClientRect().bottom,
  identity: document.querySelector(".identity")?.getBoundingClientRect().top,
  verdict: document.querySelector(".verdict")?.getBoundingClientRect().top,
};
""".replace("LEAST", str(LEAST_CONTRAST))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Pages with all that they may have, one of them not valid, beside their script."""
    folder = tmp_path_factory.mktemp("widths")
    virtual = virtual_shot("mixed")
    report = report_document(
        virtual.shot, identified("mixed"), version="1", shot_file=SHOT_FILE, rig=virtual.rig,
        issued=Issue(laboratory="Range North", number="TR-42", concession="accepted by N", tolerance_kg=(-4.0, 4.0)),
    )  # fmt: skip
    quantity = Quantity(
        "stiffness of the ground",
        "k_of_the_ground",
        3.25e7,
        4.0e5,
        "N/m",
        "load on deflection " * 5,
        3.0e7,
        interval=(-9.5e5, 9.5e6),
    )
    mass = Quantity("recoiling mass", "m3", 784.0, 3.0, "kg", "all equations", 782.0, 0.0, of_recoiling_part=True)
    table = Table("Supports", "What each tells.", ("support", "rows", "share"), (("ground", "38", "0.3"),))
    reason = Reason(ReasonCode.RIG, None, "the ground gives way: look at its anchors")
    found = TargetResult(
        "stiffness", "Stiffness", "By inverse dynamics.", (quantity, mass) * 2, tables=(table,), reasons=(reason,)
    )
    target = target_document(
        virtual.shot, found, version="1", shot_file=SHOT_FILE, rig=virtual.rig, issued=Issue(tolerance_kg=(-4.0, 4.0))
    )
    campaign = combine(campaign_of((0.0, 120.0) * 3, seed=4).shots)
    document = campaign_document(campaign, version="1", inputs=[], parameters={}, pages=None)
    figures = report_figures(identified("mixed"))
    pages = {
        "shot": render_page(report, figures),
        "target": render_target_page(target, figures[:1]),
        "campaign": render_campaign_page(document, campaign_figures(campaign, None)),
        "season": a_season(),
        "sweep": a_sweep(),
        "index": an_index(),
        "certificate": a_certificate(report),
    }
    write_script(folder)
    for name in KINDS:
        write_script(folder / name)
    return {name: write_page(folder / name / "in", page, PAGE_NAME) for name, page in pages.items()}


def a_season() -> str:
    """Return the page of a campaign beside three earlier ones, one of which is not compared."""
    shots = campaign_of((0.0, 120.0) * 8, seed=4).shots
    answers = [
        campaign_document(combine(shots[4 * k : 4 * k + 4]), version="1", inputs=[], parameters={}) for k in range(4)
    ]
    rows = [row_of(one, f"earlier/of the {name} of 2026") for one, name in zip(answers, SEASONS, strict=False)]
    rows[1]["remark"] = "it is of another rig, field-2013-with-the-other-cradle"
    compared = [one for number, one in enumerate(answers) if number != 1]
    covariance = [[a["mass"]["u"] ** 2 if a is b else shared_kg2(a, b) for b in compared] for a in compared]
    document = with_history(answers[-1], history_document([*rows, row_of(answers[-1], THIS)], covariance))
    figures = [*campaign_figures(combine(shots[12:]), None)]
    season = history_figure(document)
    assert season is not None
    return render_campaign_page(document, [season, *figures])


def a_certificate(report: dict[str, Any]) -> str:
    """Return the page of a certificate with long texts, and of a report that is conceded."""
    issued = Issue(
        laboratory="Range North, 1 Proof Road, 123 45 Northtown", number="K-2026-0001-of-the-third-campaign",
        concession="accepted by N because only the peaks are needed", tolerance_kg=(-4.0, 4.0), date="2026-11-28",
        replaces="K-2026-0000, issue 1: the customer's name was wrong", decision_rule="guard band",
    )  # fmt: skip
    inputs = [{"file": "0001/report.json", "kind": Behind.REPORT, "sha256": "ab" * 32}]
    return render_certificate_page(certificate_document(report, [report], issued, version="1", inputs=inputs, drawn={}))


SEASONS = ("spring", "summer", "autumn")


def a_sweep() -> str:
    """Return the page of a sweep, one value of which allows no mass and one of which is not valid."""
    own = found_row(identified("mixed"))
    further = {key: own[key] + 9.0 for key in ("mass_kg", "U95_low_kg", "U95_high_kg")}
    worse = {**own, **further, "valid": False, "reason": "the bracket is wider than u " * 6}
    document = sweep_document(
        "cutoff_hz",
        {None: own, 150.0: "no mass: fewer rows than unknowns are left behind the low-pass", 200.0: own, 250.0: worse},
        shot="0001", rig="mixed", specification_kg=782.0, version="1", inputs=[], options={"cutoff_hz": None},
    )  # fmt: skip
    return render_results_page(document, sweep_figures(document))


def an_index() -> str:
    """Return the page of an index with shots of two rigs, one excluded, one without a report, and one unread file."""
    row = row_of_report(a_report(shot_log={"configuration": "with the heavier ring", "added_mass_kg": 120.0}))
    reason = "the offset of the clock of the camera is known to 0.33 ms only: declare its delay_s"
    rows = [
        {**row, "report": "../reports/0001/report.html"},
        {**row, "shot": "0002", "rig": "field-2013", "valid": False, "reason": reason, "exclude": "misfire"},
        {
            **dict.fromkeys(row),
            "shot": "a_shot_of_a_long_name_0003",
            "rig": "mixed",
            "state": "not usable",
            "warnings": 3,
        },
    ]
    failed = [{"file": "shots/0004.h5", "error": "shots/0004.h5: the file was cut off: " + "expected more " * 9}]
    return render_results_page(index_document(rows, version="1", failed=failed))


def looked_at(written: dict[str, Path], how: str, widths: tuple[int, ...], **settings: Any) -> dict[str, Any]:
    """What each page shows at each width, all in one browser; without its scripts unless they are waited for."""
    browser = find_browser()
    if browser is None:
        pytest.skip("no browser of Chromium's kind on this machine: pages are not looked at")
    places: dict[str, tuple[Path, int]] = {}
    waits = settings.pop("scripts", False)
    for name, path in written.items():
        text = path.read_text("utf-8")
        page = path.with_name(f"{how}.html")
        text = text if waits else SCRIPTS.sub("", text)
        if how == "print":  # what a sheet has stands on the screen, and what a screen has does not
            text = text.replace("@media print", "@media all").replace("@media screen", "@media not all")
        page.write_text(text, encoding="utf-8")
        places |= {f"{name}-{width}": (page, width) for width in widths}
    script = MEASURE.replace("WAITS", "true" if waits else "false")
    return visit(browser, places, script, folder=next(iter(written.values())).parents[2] / f"browser-{how}", **settings)


@pytest.fixture(scope="module")
def measured(written: dict[str, Path]) -> dict[str, Any]:
    return looked_at(written, "plain", WIDTHS_PX)


@pytest.fixture(scope="module")
def dark(written: dict[str, Path]) -> dict[str, Any]:
    return looked_at(written, "dark", DARK_PX, dark=True)


@pytest.fixture(scope="module")
def on_a_sheet(written: dict[str, Path]) -> dict[str, Any]:
    return looked_at(written, "print", (SHEET_PX,))


@pytest.fixture(scope="module")
def shut_in(written: dict[str, Path]) -> dict[str, Any]:
    figures = report_figures(identified("mixed"))[:1]
    page = render_page(a_report(), figures, standalone=True)
    alone = write_page(written["shot"].parents[2] / "alone" / "in", page, PAGE_NAME)
    found: dict[str, Any] = {}
    for name, path in {**written, "alone": alone}.items():  # a browser for each: their scripts take long
        found |= looked_at({name: path}, f"shut-{name}", (1400, 390), scripts=True, sandbox="allow-scripts")
    return found


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("how", "width"), [*(("measured", width) for width in WIDTHS_PX), *(("dark", width) for width in DARK_PX)]
)
@pytest.mark.parametrize("name", KINDS)
def test_nothing_of_a_page_is_cut_off_at_any_width(
    how: str, name: str, width: int, request: pytest.FixtureRequest
) -> None:
    found = request.getfixturevalue(how)[f"{name}-{width}"]["found"]
    assert found["cut"] == []
    assert found["beyond"] <= 0
    assert found["scrolled"] == 0


@pytest.mark.whole_way
@pytest.mark.parametrize("name", KINDS)
def test_nothing_of_a_page_is_cut_off_on_a_sheet(on_a_sheet: dict[str, Any], name: str) -> None:
    found = on_a_sheet[f"{name}-{SHEET_PX}"]["found"]
    assert found["cut"] == []
    assert found["beyond"] <= 0
    assert found["scrolled"] == 0


TELEPHONE_SCREEN_PX, MOST_SCREENS = 844, 20


@pytest.mark.whole_way
def test_a_telephone_has_the_verdict_on_its_first_screen_before_who_signs_it(measured: dict[str, Any]) -> None:
    narrow, wide = (measured[f"shot-{width}"]["found"] for width in (TELEPHONE_PX, SCREEN_PX))
    assert narrow["stamp"] < TELEPHONE_SCREEN_PX / 4
    assert narrow["verdict"] < narrow["identity"] < TELEPHONE_SCREEN_PX * 1.5
    assert wide["identity"] < wide["verdict"]
    assert narrow["height"] <= MOST_SCREENS * TELEPHONE_SCREEN_PX


@pytest.mark.whole_way
@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("how", ["measured", "dark"])
def test_every_text_stands_out_from_what_is_behind_it(how: str, name: str, request: pytest.FixtureRequest) -> None:
    found = request.getfixturevalue(how)[f"{name}-1024"]["found"]
    assert found["faint"] == []
    assert found["page"] < 0.05 if how == "dark" else found["page"] > 0.8


@pytest.mark.whole_way
@pytest.mark.parametrize("width", [1400, 390])
@pytest.mark.parametrize("name", [*DRAWN, "alone"])
def test_a_page_in_a_frame_that_is_shut_in_shows_its_figures(shut_in: dict[str, Any], name: str, width: int) -> None:
    page = shut_in[f"{name}-{width}"]
    assert page["found"]["cut"] == []
    assert page["found"]["beyond"] <= 0
    if name == "alone":
        assert page["errors"] == []
        assert page["found"]["drawn"] >= 1
    else:  # such a frame reads no file beside the page: its figures stand still
        assert all("plotly.min.js" in error for error in page["errors"])
        assert page["found"]["still"] >= 1
        assert "--standalone" in page["found"]["hint"]


@pytest.mark.whole_way
def test_an_index_needs_no_script_in_a_frame_that_is_shut_in(shut_in: dict[str, Any]) -> None:
    for width in (1400, 390):
        assert shut_in[f"index-{width}"]["errors"] == []
        assert shut_in[f"index-{width}"]["found"]["cut"] == []


@pytest.mark.whole_way
@pytest.mark.parametrize("name", DRAWN)
def test_figures_stand_still_on_a_page_without_scripts(measured: dict[str, Any], name: str) -> None:
    assert measured[f"{name}-1024"]["found"]["still"] >= (1 if name in ("target", "sweep") else 2)


@pytest.mark.whole_way
def test_the_figure_of_the_mass_begins_on_the_first_screen(measured: dict[str, Any]) -> None:
    assert measured["shot-1400"]["found"]["mass"] < 720


@pytest.mark.whole_way
@pytest.mark.parametrize("name", KINDS)
def test_what_is_printed_lies_within_its_sheets_and_nothing_is_left_out(
    written: dict[str, Path], name: str, tmp_path: Path
) -> None:
    browser = find_browser()
    if browser is None:
        pytest.skip("no browser of Chromium's kind on this machine: nothing is printed")
    print_page(browser, written[name], tmp_path / "sheets.pdf")
    sheets, beyond = PdfReader(tmp_path / "sheets.pdf").pages, []
    for sheet in sheets:
        width = float(sheet.mediabox.width)

        def seen(text: str, at: list[float], place: list[float], *_: Any, width: float = width) -> None:
            left = at[0] * place[4] + at[2] * place[5] + at[4]
            if text.strip() and not 0.0 <= left <= width - 20.0:
                beyond.append((text, left))

        sheet.extract_text(visitor_text=seen)
    assert beyond == []
    # ligatures are letters again
    text = unicodedata.normalize("NFKC", " ".join(sheet.extract_text() for sheet in sheets))
    whole = re.sub(r"\s", "", text)
    page = written[name].read_text("utf-8")
    tables = "budget|quantities|shots|constants|history|values"
    for table in re.findall(rf'<section id="(?:{tables})".*?</section>', page, re.DOTALL):
        names = re.findall(r'<td class="name">(.*?)</td>', table, re.DOTALL)
        for written_name in names:
            assert re.sub(r"<[^>]+>|\s", "", html.unescape(written_name)) in whole, written_name
