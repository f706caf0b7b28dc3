"""What pages do in a real browser: they draw without an error or a request, keep their width, and move together."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from pypdf import PdfReader

from recoil_acquisition.shot import InputFile
from recoil_identification.campaign.campaign import combine
from recoil_identification.report.campaign_document import campaign_document
from recoil_identification.report.campaign_figures import campaign_figures
from recoil_identification.report.document import report_document
from recoil_identification.report.figures import report_figures
from recoil_identification.report.html import PAGE_NAME, render_campaign_page, render_page, render_target_page
from recoil_identification.report.page_files import write_page, write_script
from recoil_identification.report.report_files import to_json
from recoil_identification.targets.finding import Finding, Quantity, Table
from recoil_identification.targets.target_document import target_document
from recoil_rigs.issue import Issue
from tests.builders.browsers import find_browser, print_page, visit
from tests.builders.campaign_summaries import campaign_of
from tests.builders.virtual_shots import identified, virtual_shot
from tests.identification.report.test_report_html import a_report

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
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    browser = find_browser()
    if browser is None:
        pytest.skip("no browser of Chromium's kind on this machine: pages are not looked at")
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


@pytest.mark.parametrize("name", ["screen", "telephone", "alone", "campaign"])
def test_a_page_draws_all_its_figures_without_an_error(seen: dict[str, Any], name: str) -> None:
    page = seen[name]
    assert page["errors"] == []
    assert page["found"]["hints"] == []
    folded = 1 if name in ("screen", "telephone") else 0
    assert page["found"]["drawn"] == page["found"]["plots"] - folded > 0


def test_no_page_asks_for_anything_beyond_its_files(seen: dict[str, Any]) -> None:
    assert seen[""] == [CONTROL]


@pytest.mark.parametrize("name", ["telephone", "campaign"])
def test_a_page_as_wide_as_a_telephone_does_not_scroll_sideways(seen: dict[str, Any], name: str) -> None:
    assert seen[name]["found"]["beyond"] <= 0
    assert seen[name]["found"]["outside"] == 0
    assert seen[name]["found"]["cut"] == 0


def test_on_a_telephone_a_cell_of_a_table_bears_its_heading(seen: dict[str, Any]) -> None:
    assert "kg" in seen["telephone"]["found"]["heading"]
    assert seen["screen"]["found"]["heading"] == "none"


def test_a_report_is_printed_with_each_table_on_the_sheet_of_its_heading(tmp_path: Path) -> None:
    browser = find_browser()
    if browser is None:
        pytest.skip("no browser of Chromium's kind on this machine: nothing is printed")
    report = report_document(virtual_shot("mixed").shot, identified("mixed"), version="1", shot_file=SHOT_FILE)
    page = write_page(tmp_path / "0001", render_page(report, report_figures(identified("mixed"))), PAGE_NAME)
    write_script(tmp_path)
    print_page(browser, page, tmp_path / "sheets.pdf")
    sheets = [" ".join(sheet.extract_text().split()) for sheet in PdfReader(tmp_path / "sheets.pdf").pages]
    for heading, first in (("Methods compared", "calibrated"), ("Uncertainty budget", "packing friction")):
        (sheet,) = (text for text in sheets if heading in text)
        assert first in sheet.partition(heading)[2], heading


def test_a_page_that_was_moved_away_from_its_script_says_what_it_needs(seen: dict[str, Any]) -> None:
    assert seen["lost"]["found"]["hints"] == ["missing"]
    assert not seen["lost"]["found"]["script"]


def test_zoom_of_one_figure_moves_all_others_over_that_time_and_those_unfolded_later(seen: dict[str, Any]) -> None:
    found = seen["screen"]["found"]
    assert found["timed"] >= 6
    assert found["ranges"] == [[0.11, 0.14]] * found["timed"]
    assert found["unfolded"] == [0.11, 0.14]


def test_keys_zoom_and_move_a_figure_and_with_it_all_others_over_that_time(seen: dict[str, Any]) -> None:
    found = seen["screen"]["found"]
    assert found["focused"]
    for low, high in found["closer"]:
        assert (low, high) == pytest.approx((0.116, 0.134))
    for low, high in found["later"]:
        assert (low, high) == pytest.approx((0.1178, 0.1358))
    assert all(high - low > 0.1 for low, high in found["reset"])


def test_the_instant_that_one_figure_is_read_at_is_shown_in_the_others(seen: dict[str, Any]) -> None:
    found = seen["screen"]["found"]
    assert found["instant"] == pytest.approx(0.12, abs=1e-6)
    assert found["instantAfter"] == "none"
    assert "breech" in found["readOut"]
    assert "MPa" in found["readOut"]


def test_a_read_out_has_true_minus_signs(seen: dict[str, Any]) -> None:
    told = " ".join(seen["screen"]["found"]["minus"])
    assert "\N{MINUS SIGN}" in told
    assert " -" not in told


def test_the_switch_shows_what_was_recorded_or_filtered_or_both(seen: dict[str, Any]) -> None:
    switched = seen["screen"]["found"]["switched"]
    assert switched["recorded"] == [True, "legendonly"] * 3
    assert switched["filtered"] == ["legendonly", True] * 3
    assert switched["both"] == [True, True] * 3


def test_the_report_that_a_page_saves_is_the_one_that_it_was_made_of(seen: dict[str, Any]) -> None:
    assert seen["alone"]["found"]["saved"] == to_json(LOGGED)


SCRIPTS = re.compile("<script.*?</script>", re.DOTALL)
WIDTHS_PX = (1400, 1024, 900, 761, 700, 390)
MEASURE = """
const root = document.documentElement;
const cut = [...document.querySelectorAll("main *")].filter((one) => {
  const box = one.getBoundingClientRect(), style = getComputedStyle(one);
  return box.width > 0 && style.position !== "absolute" && !one.closest("pre, .plot, .skip")
    && box.right > root.clientWidth + 1;
});
return {
  beyond: root.scrollWidth - root.clientWidth,
  scrolled: [...document.querySelectorAll(".scroll")].filter((one) => one.scrollWidth > one.clientWidth + 1).length,
  cut: cut.map((one) => `${one.tagName} ${one.className} ${one.textContent.slice(0, 40)}`).slice(0, 5),
  still: [...document.querySelectorAll("svg.still")].filter((one) => one.getBoundingClientRect().width > 100).length,
};
"""


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What pages without their script show at each width."""
    browser = find_browser()
    if browser is None:
        pytest.skip("no browser of Chromium's kind on this machine: pages are not looked at")
    folder = tmp_path_factory.mktemp("widths")
    virtual = virtual_shot("mixed")
    report = report_document(
        virtual.shot, identified("mixed"), version="1", shot_file=SHOT_FILE, rig=virtual.rig,
        issued=Issue(laboratory="Range North", number="TR-42", concession="accepted by N", tolerance_kg=(-4.0, 4.0)),
    )  # fmt: skip
    quantity = Quantity("stiffness of the ground", "k", 3.25e7, 4.0e5, "N/m", "load on deflection " * 5, 3.0e7)
    table = Table("Supports", "What each tells.", ("support", "rows", "share"), (("ground", "38", "0.3"),))
    found = Finding("stiffness", "Stiffness", "By inverse dynamics.", (quantity,) * 3, tables=(table,))
    target = target_document(virtual.shot, found, version="1", shot_file=SHOT_FILE, rig=virtual.rig)
    campaign = combine(campaign_of((0.0, 120.0) * 3, seed=4).shots)
    document = campaign_document(campaign, version="1", inputs=[], parameters={}, pages=None)
    pages = {
        "shot": render_page(report, report_figures(identified("mixed"))[:2]),
        "target": render_target_page(target, ()),
        "campaign": render_campaign_page(document, campaign_figures(campaign, None)),
    }
    found: dict[str, Any] = {}
    for name, page in pages.items():
        path = write_page(folder / name, SCRIPTS.sub("", page), PAGE_NAME)
        places = {f"{name}-{width}": (path, width) for width in WIDTHS_PX}
        found |= visit(browser, places, MEASURE, folder=folder / f"browser-{name}")
    return found


@pytest.mark.parametrize("width", WIDTHS_PX)
@pytest.mark.parametrize("name", ["shot", "target", "campaign"])
def test_nothing_of_a_page_is_cut_off_at_any_width(measured: dict[str, Any], name: str, width: int) -> None:
    found = measured[f"{name}-{width}"]["found"]
    assert found["cut"] == []
    assert found["beyond"] <= 0
    assert found["scrolled"] == 0


@pytest.mark.parametrize("name", ["shot", "campaign"])
def test_figures_stand_still_on_a_page_without_scripts(measured: dict[str, Any], name: str) -> None:
    assert measured[f"{name}-1024"]["found"]["still"] >= 2
