"""The page on which channels of shots are laid over one another and zoomed, in a real browser, from a file."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.store import read_shot
from recoil_daq.live.page.page_files import write_pages
from recoil_daq.recording.overview import _pieces, refresh_overviews
from tests.builders.driven_browser import DRIVEN, asked, driven, resize, shows, told, until

pytestmark = [pytest.mark.real_time, DRIVEN]


COLUMNS = """
const [pieces, zero, from, span, width] = arguments, found = Curves.columns(pieces, zero, from, from + span, width);
return [found.x, found.low, found.high];
"""


@pytest.fixture(scope="module")
def folder(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("zoomed")
    for name in ("0001", "0002"):
        shutil.copy(stored, made / f"{name}.h5")
    refresh_overviews(made)
    write_pages(made)
    return made


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with driven() as started:
        yield started


def opened(browser: Any, folder: Path, named: str = "") -> None:
    told(browser), asked(browser)
    browser.get("about:blank")
    browser.get((folder / "zoom.html").as_uri() + named)
    until(browser, "document.documentElement.dataset.painted > 0", 5.0)


def test_any_channels_of_any_shots_are_laid_over_one_another(folder: Path, browser: Any) -> None:
    opened(browser, folder, "#0001,0002")
    names = list(read_shot(folder / "0001.h5").channels)
    boxes = browser.execute_script("return [...document.querySelectorAll('#channels input')].map((one) => one.value)")
    assert boxes == names
    browser.execute_script(
        "for (const one of document.querySelectorAll('#channels input')) if (!one.checked) one.click()"
    )
    labels = "[...document.querySelectorAll('figcaption .label')].map((one) => one.innerText.trim())"
    until(browser, f"{labels}.length === {2 * len(names)}", 2.0)
    assert set(browser.execute_script(f"return {labels}")) == {
        f"{shot} {name}" for shot in ("0001", "0002") for name in names
    }
    assert all(one.startswith((folder.as_uri(), "data:,", "about:")) for one in asked(browser))
    assert told(browser) == []


def test_a_channel_may_have_a_figure_of_its_own(folder: Path, browser: Any) -> None:
    opened(browser, folder, "#0001,0002")
    browser.execute_script("document.querySelector('input[value=channel]').click()")
    chosen = browser.execute_script("return document.querySelectorAll('#channels input:checked').length")
    until(browser, f"document.querySelectorAll('figure').length === {chosen}", 2.0)
    assert browser.execute_script("return document.querySelectorAll('figcaption .label').length") == 2 * chosen


def test_what_is_zoomed_far_is_every_sample(folder: Path, browser: Any) -> None:
    opened(browser, folder)
    until(browser, shows("detail", "stands for up to"), 2.0)
    for _ in range(5):
        browser.execute_script("document.querySelector('[data-move=in]').click()")
    until(browser, shows("detail", "Every sample is drawn."), 3.0)
    browser.execute_script("document.querySelector('[data-move=all]').click()")
    until(browser, shows("detail", "stands for up to"), 2.0)
    assert told(browser) == []


def test_a_stretch_is_zoomed_by_dragging_wheel_and_keys(folder: Path, browser: Any) -> None:
    from selenium.webdriver import ActionChains, Keys
    from selenium.webdriver.common.by import By

    opened(browser, folder)
    canvas = browser.find_element(By.TAG_NAME, "canvas")
    seen = "document.getElementById('shown').innerText"
    whole = browser.execute_script(f"return {seen}")
    ActionChains(browser).move_to_element_with_offset(canvas, -200, 0).click_and_hold().move_by_offset(
        300, 0
    ).release().perform()
    until(browser, f"{seen} !== {whole!r}", 2.0)
    dragged = browser.execute_script(f"return {seen}")
    ActionChains(browser).scroll_from_origin(_origin(canvas), 0, -200).perform()
    until(browser, f"{seen} !== {dragged!r}", 2.0)
    canvas.send_keys("0")
    until(browser, f"{seen} === {whole!r}", 2.0)
    canvas.send_keys("+", Keys.ARROW_RIGHT)
    until(browser, f"{seen} !== {whole!r}", 2.0)
    ActionChains(browser).double_click(canvas).perform()
    until(browser, f"{seen} === {whole!r}", 2.0)


def _origin(canvas: Any) -> Any:
    from selenium.webdriver.common.actions.wheel_input import ScrollOrigin

    return ScrollOrigin.from_element(canvas)


@pytest.mark.parametrize(("count", "most"), [(300, 1_000), (5_000, 5_000), (60_000, 50_000), (60_000, 4_000)])
@pytest.mark.parametrize("even", [True, False])
def test_each_column_of_the_screen_holds_the_lowest_and_the_highest_of_its_samples(
    folder: Path, browser: Any, count: int, most: int, even: bool
) -> None:
    opened(browser, folder)
    random = np.random.default_rng(count)
    steps_s = np.full(count, 1e-4) if even else random.uniform(0.5e-4, 1.5e-4, count)
    times_s = 3.0 + np.cumsum(steps_s)
    samples = random.normal(size=count).astype("f4")
    samples[random.random(count) < 0.02] = np.nan
    told_s = (_pieces(times_s, samples, most), times_s[0] + 0.1)
    slack_s = 1e-3 + (0.0 if count <= 2 * most else 2e-4 * count / most)
    for share in (1.0, 0.31, max(0.002, 20 / count)):
        span_s = share * (times_s[-1] - times_s[0])
        window = (random.uniform(0.0, (1 - share) * (times_s[-1] - times_s[0])) - 0.1, span_s, 400)
        x, low, high = browser.execute_script(COLUMNS, *told_s, *window)
        first_s, last_s = told_s[1] + window[0], told_s[1] + window[0] + span_s
        inside = samples[(times_s >= first_s) & (times_s <= last_s) & np.isfinite(samples)]
        around = samples[(times_s >= first_s - slack_s) & (times_s <= last_s + slack_s) & np.isfinite(samples)]
        lowest, highest = (np.nanmin(np.array(low, float)), np.nanmax(np.array(high, float)))
        assert around.min() <= lowest <= inside.min()
        assert inside.max() <= highest <= around.max()
        for at, least, greatest in list(zip(x, low, high, strict=True))[:: max(1, len(x) // 7)]:
            near = np.abs((times_s - first_s) / span_s * 400 - at) <= 1.6 + slack_s / span_s * 400
            if least is not None:
                assert np.nanmin(samples[near]) <= least + 1e-6
                assert greatest - 1e-6 <= np.nanmax(samples[near])


@pytest.mark.parametrize("width", [700, 390])
def test_it_has_room_on_a_telephone(folder: Path, browser: Any, width: int) -> None:
    resize(browser, width)
    try:
        opened(browser, folder)
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    finally:
        resize(browser, 1400)


def test_a_folder_without_overviews_says_what_to_do(tmp_path: Path, browser: Any) -> None:
    write_pages(tmp_path)
    told(browser)
    browser.get((tmp_path / "zoom.html").as_uri())
    until(browser, shows("told", "recoil-daq serve DIR"), 3.0)
    assert told(browser) == []
