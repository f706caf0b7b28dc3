from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from markupsafe import escape

from recoil_identification.report.content.glossary import TERMS, Glossary
from recoil_identification.report.figure.appearance import dash_of, hue_of
from recoil_identification.report.figure.drawing import drawing
from recoil_identification.report.figure.figure import TIME, Figure, Panel, Span, Trace
from recoil_identification.report.figure.figures import report_figures
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.shot.signals import GaugeReading
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import bench_rig, bench_shot
from tests.builders.virtual_shots import identified

MEASURED = ("pressure", "motion", "angular-rate", "carriage")


def figures(found: Identification | None = None) -> dict[str, Figure]:
    return {f.key: f for f in report_figures(found or identified("mixed"))}


def traces(figure: Figure):
    return [t for panel in figure.panels for t in panel.traces]


def test_all_figures_of_a_full_shot_are_there_in_reading_order():
    names = list(figures())
    assert names == [*MEASURED, "force", "mass", "residuals", "whiteness", "alignment-camera", "spectrum"]


@pytest.mark.parametrize(
    "name", ["pressure", "motion", "angular-rate", "carriage", "force", "residuals", "alignment-camera", "spectrum"]
)
def test_traces_are_finite_within_the_interval(name):
    found, figure = identified("mixed"), figures()[name]
    for trace in traces(figure):
        x, y = np.asarray(trace.x), np.asarray(trace.y)
        assert x.size > 10
        if trace.kind == "points":
            assert np.isfinite(y).mean() > 0.98  # lost frames
        elif figure.x_label.startswith("time"):
            inside = (x >= found.route.filtered.interval_s[0]) & (x <= found.route.filtered.interval_s[1])
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


def test_every_pressure_is_drawn_at_its_own_scale_as_recorded_and_filtered():
    found, figure = identified("mixed"), figures()["pressure"]
    assert figure.switched
    for panel, role in zip(figure.panels, ("breech", "brake", "recuperator"), strict=True):
        recorded, filtered = panel.traces
        assert panel.y_label == f"{role}, MPa"
        assert (recorded.kind, filtered.kind) == ("measured", "filtered")
        np.testing.assert_allclose(recorded.y, 1e-6 * found.route.signals.series[f"{role}_pressure"])
        # a low-pass keeps what lasts
        both = np.isfinite(filtered.y) & np.isfinite(recorded.y)
        assert np.mean(filtered.y[both]) == pytest.approx(np.mean(recorded.y[both]), rel=0.01)


def test_each_of_two_gauges_of_a_pressure_is_a_line_in_its_panel():
    found = identified("mixed")
    pressure, offset = found.route.signals.series["brake_pressure"], found.route.signals.offsets["brake_pressure"]
    gauges = tuple(GaugeReading(name, factor * pressure, offset) for name, factor in (("one", 1.0), ("two", 1.1)))
    both = replace(
        found, route=replace(found.route, signals=replace(found.route.signals, gauges={"brake_pressure": gauges}))
    )
    breech, brake, _ = figures(both)["pressure"].panels
    assert len(breech.traces) == 2
    assert [trace.name for trace in brake.traces[::2]] == ["brake, one, recorded", "brake, two, recorded"]
    assert len({(trace.hue, trace.dash) for trace in brake.traces[1::2]}) == 2


def test_a_method_has_one_look_in_every_figure():
    found = identified("mixed")
    by_name = {t.name: t for t in traces(figures()["mass"])}
    as_paper = figures(replace(found, route=replace(found.route, method="paper")))["mass"].panels[0].traces[0]
    assert by_name["paper"].hue == as_paper.hue


def test_forces_differ_in_dashes_as_well_as_in_colour():
    (panel,) = figures()["force"].panels
    parts = [t for t in panel.traces if t.kind == "reference"]
    assert len({dash_of(t, 0) for t in parts}) == len({hue_of(t, 0) for t in parts}) == 4


def test_force_and_mass_times_acceleration_coincide():
    found = identified("mixed")
    by_name = {t.name: np.asarray(t.y) for t in traces(figures()["force"])}
    inside = found.route.filtered.inside
    apart = by_name["F', filtered"] - by_name["m a', filtered"]
    assert np.abs(apart[inside]).max() < 0.02 * by_name["F', filtered"][inside].max()


def test_the_cameras_points_lie_on_the_travel():
    points, travel = figures()["motion"].panels[-1].traces
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
        assert ("camera" in [t.name for t in traces(drawn["motion"])]) == (other.status != "failed")


@pytest.mark.whole_way
def test_a_shot_of_one_clock_without_noise_has_its_figures_too():
    found = identify_shot(FiredShot(bench_shot(), bench_rig()), Options())
    drawn = {f.key for f in report_figures(found)}
    assert drawn == {"pressure", "motion", "force", "mass", "residuals", "whiteness", "spectrum"}


def test_symbols_of_legends_are_explained_in_the_captions():
    for figure in report_figures(identified("mixed")):
        legends = " ".join(trace.name for panel in figure.panels for trace in panel.traces)
        for symbol in ("F'", "a'"):
            assert symbol not in legends or f'"{escape(TERMS[symbol])}"' in Glossary().text(figure.caption), figure.key


def test_names_of_stretches_beside_one_another_stand_at_the_top_where_no_point_is() -> None:
    """A name at the foot lay over a point of the campaign's masses."""
    x = np.arange(4.0)
    spans = (Span("as built", -0.46, 1.46), Span("120 kg added", 1.54, 3.46), Span("over both", -0.4, 3.0))
    points = Trace("mass", x, x, "points", "kg")
    for several, places in ((spans[:2], ["top left"] * 2), (spans, ["top left", "top left", "bottom left"])):
        figure = Figure("mass", "t", "c", "shot", (Panel("mass, kg", (points,), spans=several),), shown=(-0.6, 4.0))
        shapes = drawing(figure)["layout"]["shapes"]
        assert [shape["label"]["textposition"] for shape in shapes] == places
        low, high = drawing(figure)["layout"]["yaxis"]["range"]
        assert (0.0 - low, high - 3.0) == pytest.approx((0.39, 0.39))


def test_no_two_names_of_stretches_and_instants_of_the_spectrum_lie_on_each_other():
    shapes = drawing(report_figures(identified("mixed"))[-1])["layout"]["shapes"]
    assert [shape["label"]["text"].partition(",")[0] for shape in shapes] == ["cut-off", "gap"]
    assert [shape["label"]["textposition"] for shape in shapes] == ["start", "top left"]


def test_the_names_of_instants_that_are_close_stand_one_above_the_other():
    times_s = np.linspace(0.0, 1.0, 11)
    spans = tuple(Span(name, at, at) for name, at in (("peak", 0.104), ("release", 0.1), ("end", 0.9)))
    panel = Panel("force, N", (Trace("force", times_s, times_s, "measured"),), spans=spans)
    figure = Figure("one", "One", "One.", TIME, (panel,), shown=(0.0, 1.0))
    texts = [shape["label"]["text"] for shape in drawing(figure)["layout"]["shapes"]]
    assert texts == ["peak<br>\u00a0", "release", "end"]
