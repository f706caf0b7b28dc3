"""The page of growth says what was measured, and its slopes are those of straight lines on logarithmic axes."""

from __future__ import annotations

import json

import pytest

from tests.growth.__main__ import DOCS, POINTS, last_slope, page, plot, slope
from tests.growth.measure import SERIES, Point, campaign_of_shots


def test_a_power_is_found_as_the_slope() -> None:
    points = [Point(n, 0.01 * n**1.5, n, 200.0) for n in (10, 100, 1000)]
    assert slope(points, "cpu_s") == pytest.approx(1.5)
    assert last_slope(points, "peak_mb") == pytest.approx(0.0)


def test_the_last_slope_is_that_of_the_largest_sizes() -> None:
    points = [Point(1, 1.0, 1.0, 1.0), Point(10, 1.0, 1.0, 1.0), Point(100, 100.0, 1.0, 1.0)]
    assert last_slope(points, "cpu_s") == pytest.approx(2.0)
    assert slope(points, "cpu_s") == pytest.approx(1.0)


@pytest.mark.whole_way
def test_a_point_is_measured_in_a_process_of_its_own() -> None:
    point = campaign_of_shots(2)
    assert point.size == 2
    assert 0.0 < point.cpu_s < 60.0
    assert 50.0 < point.peak_mb < 1000.0


def test_the_page_and_its_plots_are_those_of_the_measured_points() -> None:
    measured = {name: [Point(*one) for one in points] for name, points in json.loads(POINTS.read_text("utf-8")).items()}
    assert set(measured) == set(SERIES)
    written = (DOCS / "growth.md").read_text("utf-8")
    said = [line for line in page(measured).splitlines() if not line.startswith("proportional")]  # its Python
    assert said == [line for line in written.splitlines() if not line.startswith("proportional")]
    for name, points in measured.items():
        assert (DOCS / f"growth-{name}.svg").read_text("utf-8") == plot(name, points)
