"""Thin curves of a shot, against its samples."""

import numpy as np
import pytest

from recoil_identification.shot.firing_record import CURVE_POINTS, CURVES, curves_of
from recoil_identification.shot.peaks import peaks_of
from tests.builders.virtual_shots import identified, virtual_shot


def test_curves_begin_before_the_onset_and_end_after_the_travel():
    found = identified("field-2013")
    curves, (t0, t1) = curves_of(found), found.route.filtered.interval_s
    assert curves.times_s.size == CURVE_POINTS
    assert curves.times_s[0] < 0 < t1 - t0 < curves.times_s[-1]
    assert tuple(curves.values) == CURVES
    travel_m = curves.values["recoil_travel_m"]
    assert np.nanmax(travel_m) == pytest.approx(peaks_of(found)["recoil_travel_m"].value, rel=5e-3)
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
