from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.analysis import Identification, Options, identify_shot
from recoil_identification.report.figure import Figure
from recoil_identification.report.figures import report_figures
from tests.builders.bench_shots import bench_rig, bench_shot
from tests.builders.virtual_shots import identified


def figures(found: Identification | None = None) -> dict[str, Figure]:
    return {f.key: f for f in report_figures(found or identified("mixed"))}


def traces(figure: Figure):
    return [t for panel in figure.panels for t in panel.traces]


def test_all_figures_of_a_full_shot_are_there_in_reading_order():
    names = list(figures())
    assert names == ["mass", "angular-rate", "force", "travel", "residuals", "alignment-camera", "spectrum"]


@pytest.mark.parametrize("name", ["angular-rate", "force", "travel", "residuals", "alignment-camera", "spectrum"])
def test_traces_are_finite_within_the_interval(name):
    found, figure = identified("mixed"), figures()[name]
    for trace in traces(figure):
        x, y = np.asarray(trace.x), np.asarray(trace.y)
        assert x.size > 10
        if trace.kind == "points":
            assert np.isfinite(y).mean() > 0.98  # lost frames
        elif figure.x_label.startswith("time"):
            inside = (x >= found.filtered.interval_s[0]) & (x <= found.filtered.interval_s[1])
            assert np.isfinite(y[inside]).all(), trace.name
        else:
            assert np.isfinite(y).all(), trace.name


def test_the_mass_has_its_band_the_specification_and_gaps_where_nothing_was_identified():
    found = identified("mixed")
    (panel,) = figures()["mass"].panels
    band = panel.traces[0]
    identified_ = found.chosen.trace.identified
    np.testing.assert_array_equal(np.isfinite(np.asarray(band.y)), identified_)
    assert (np.asarray(band.y_low)[identified_] < np.asarray(band.y)[identified_]).all()
    assert [line.y for line in panel.lines] == [782.0]
    low, high = panel.y_shown
    assert 0.85 * 782 <= low < 782 < high <= 1.15 * 782
    walk, *others = panel.traces[1:]
    assert walk.name == "mass that may change, together with all sensors, 95 % interval"
    assert not walk.visible  # nothing speaks for a change
    assert {t.name for t in others} == {"reverse", "kinematic", "paper"}


def test_a_mass_of_which_nothing_was_identified_can_be_drawn():
    found = identified("mixed")
    trace = found.chosen.trace
    none = replace(trace, identified=np.zeros_like(trace.identified), mass_kg=np.full_like(trace.mass_kg, np.nan),
                   u_kg=np.full_like(trace.u_kg, np.nan))  # fmt: skip
    found = replace(found, results={**found.results, "calibrated": replace(found.chosen, trace=none)})
    assert all(np.isfinite(figures(found)["mass"].panels[0].y_shown))


def test_force_and_mass_times_acceleration_coincide():
    found = identified("mixed")
    by_name = {t.name: np.asarray(t.y) for t in traces(figures()["force"])}
    inside = found.filtered.inside
    apart = by_name["F', filtered"] - by_name["m a', filtered"]
    assert np.abs(apart[inside]).max() < 0.02 * by_name["F', filtered"][inside].max()


def test_the_cameras_points_lie_on_the_travel():
    points, travel = traces(figures()["travel"])[:2]
    at = np.interp(np.asarray(points.x), np.asarray(travel.x), np.asarray(travel.y))
    apart = np.asarray(points.y) - at
    inside = (np.asarray(points.x) > travel.x[0]) & (np.asarray(points.x) < travel.x[-1])
    assert np.nanstd(apart[inside]) < 0.1  # mm; the marker's noise is 0.05


def test_the_likelihood_has_its_maximum_at_the_offset():
    panel = figures()["alignment-camera"].panels[1]
    (trace,) = panel.traces
    assert abs(np.asarray(trace.x)[np.argmax(np.asarray(trace.y))]) < 2.0
    assert np.asarray(trace.y).max() == 0.0


def test_a_clock_that_failed_or_was_not_aligned_by_motion_has_no_figure():
    found = identified("mixed")
    camera = found.alignments["camera"]
    for other in (
        replace(camera, status="failed"),
        replace(camera, method="trigger", details={"edges": 1, "residual_s": 0.0}),
        replace(camera, method="fixed", details=None),
    ):
        drawn = figures(replace(found, alignments={**found.alignments, "camera": other}))
        assert "alignment-camera" not in drawn
        assert ("camera" in [t.name for t in traces(drawn["travel"])]) == (other.status != "failed")


def test_a_shot_of_one_clock_without_noise_has_its_figures_too():
    found = identify_shot(bench_shot(), bench_rig(), Options())
    drawn = {f.key for f in report_figures(found)}
    assert drawn == {"mass", "force", "travel", "residuals", "spectrum"}
