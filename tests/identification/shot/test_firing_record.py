"""Peaks and thin curves of a shot, against its samples."""

import numpy as np
import pytest

from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.firing_record import CURVE_POINTS, CURVES, curves_of, peaks_of
from recoil_identification.shot.identified import Options
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import identified, virtual_shot, with_channels


def test_peaks_are_those_of_what_was_fired():
    virtual, found = virtual_shot("field-2013"), identified("field-2013")
    peaks = peaks_of(found)
    breech = virtual.shot.channels["p_breech"]
    assert peaks["breech_pressure_pa"] == pytest.approx(np.max(breech.samples), rel=0.01)
    # the gauge's droop is mended in the signals, and would take a twentieth off the impulse
    times_s, pressure_pa = found.route.signals.times_s, found.route.signals.series["breech_pressure"]
    inside = (times_s >= found.route.recorded.interval_s[0]) & (times_s <= found.route.recorded.interval_s[1])
    impulse_n_s = virtual.rig.mechanism.bore_area * np.trapezoid(pressure_pa[inside], times_s[inside])
    assert peaks["impulse_n_s"] == pytest.approx(impulse_n_s, rel=1e-3)
    camera = virtual.shot.by_role("recoil_displacement")
    assert peaks["recoil_travel_m"] == pytest.approx(np.nanmax(camera.measured), rel=0.01)
    t0, t1 = found.route.recorded.interval_s
    assert peaks["recoil_time_s"] == t1 - t0
    assert peaks["recoil_velocity_m_s"] > peaks["recoil_travel_m"] / peaks["recoil_time_s"]


@pytest.mark.whole_way
def test_of_a_clipped_channel_no_peak_is_claimed():
    virtual = virtual_shot("field-2013")
    breech = virtual.shot.channels["p_breech"]
    range_pa = 1e6 * virtual.rig.channel("p_breech").sensor.range[1]
    samples = np.minimum(np.asarray(breech.samples) * 1.1 * range_pa / np.max(breech.samples), range_pa)
    found = identify_shot(FiredShot(with_channels(virtual.shot, p_breech=samples), virtual.rig), Options())
    assert any(one.repair.kind.clips for one in found.route.signals.repairs)
    whole = peaks_of(identified("field-2013"))
    assert whole.keys() - peaks_of(found).keys() == {"breech_pressure_pa", "impulse_n_s"}


def test_curves_begin_before_the_onset_and_end_after_the_travel():
    found = identified("field-2013")
    curves, (t0, t1) = curves_of(found), found.route.filtered.interval_s
    assert curves.times_s.size == CURVE_POINTS
    assert curves.times_s[0] < 0 < t1 - t0 < curves.times_s[-1]
    assert tuple(curves.values) == CURVES
    travel_m = curves.values["recoil_travel_m"]
    assert np.nanmax(travel_m) == pytest.approx(peaks_of(found)["recoil_travel_m"], rel=1e-3)
    assert abs(travel_m[0]) < 1e-3
    pressure_pa = curves.values["breech_pressure_pa"]
    assert abs(pressure_pa[0]) < 0.01 * np.nanmax(pressure_pa)


def test_the_curve_of_the_pressure_is_behind_the_same_filter_as_the_force():
    found = identified("field-2013")
    curves, filtered = curves_of(found), found.route.filtered
    bore_m2 = virtual_shot("field-2013").rig.mechanism.bore_area
    force_n = np.interp(curves.times_s, filtered.times_s - filtered.interval_s[0], filtered.forces_n[:, 0])
    inside = (curves.times_s > 0.01) & (curves.times_s < 0.05)
    np.testing.assert_allclose(
        curves.values["breech_pressure_pa"][inside] * bore_m2, force_n[inside], atol=0.01 * force_n.max()
    )
