from __future__ import annotations

import csv
import json
import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.shot.shot import InputFile
from recoil_identification.report.document.document import report_document, true_mass_kg
from recoil_identification.report.document.report_files import (
    TRACE_COLUMNS,
    TRACE_FILE,
    read_document,
    read_trace,
    trace_text,
    write_document,
    write_files,
)
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import bench_rig, bench_shot
from tests.builders.virtual_shots import identified, virtual_shot

SHOT_FILE = InputFile("s1.h5", "ab" * 32, 123, "", "shot file")
FIXED_KEYS = {
    "schema": str,
    "shot": str,
    "rig": str,
    "started": str,
    "started_source": str,
    "mass": {"value": float, "u": float, "U95": [float, float], "unit": str, "specification": float, "method": str},
    "rpe_percent": {"value": float, "U95": [float, float]},
    "interval_s": [float, float],
    "window_s": float,
    "identified_share": float,
    "trace": {"file": str, "columns": list},
    "budget": [{"source": str, "u_kg": float, "group": str}],
    "alignment": [
        {"clock": str, "offset_s": float, "u_offset_s": float, "drift": float, "u_drift": float, "status": str}
    ],
    "quality": [{"channel": str, "check": str, "verdict": str, "detail": str}],
    "valid": bool,
    "reasons": list,
    "provenance": {"version": str, "inputs": [{"file": str, "sha256": str}], "parameters": dict},
}


def document(**changes):
    return report_document(
        virtual_shot("mixed").shot, identified("mixed"), version="1.2.3", shot_file=SHOT_FILE, **changes
    )


def assert_has(value, shape, place="report"):
    """Compare a value with a sketch of it: types, one element for a list of any length, keys that must be there."""
    if isinstance(shape, dict):
        assert shape.keys() <= value.keys(), place
        for key, inner in shape.items():
            assert_has(value[key], inner, f"{place}.{key}")
    elif isinstance(shape, list):
        assert isinstance(value, list), place
        assert value, place
        inners = shape if len(shape) > 1 else shape * len(value)
        for k, (item, inner) in enumerate(zip(value, inners, strict=True)):
            assert_has(item, inner, f"{place}[{k}]")
    else:
        assert type(value) is shape, (place, value)


def test_the_document_has_every_fixed_key_in_its_type():
    assert_has(document(), FIXED_KEYS)


def test_it_is_strict_json_and_comes_back_as_it_was(tmp_path):
    written = document()
    path = write_document(tmp_path, written)
    assert json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail) == written


def test_its_numbers_are_those_that_were_found():
    found, report = identified("mixed"), document()
    estimate = found.chosen.estimate
    assert report["schema"] == "recoil-daq/report/1"
    assert report["mass"]["value"] == estimate.mass_kg
    assert report["mass"]["U95"] == list(estimate.interval_kg)
    assert report["mass"]["U95"][0] < report["mass"]["value"] < report["mass"]["U95"][1]
    assert report["rpe_percent"]["U95"][0] <= report["rpe_percent"]["value"] <= report["rpe_percent"]["U95"][1]
    assert report["interval_s"] == list(found.route.filtered.interval_s)
    assert report["E_n"] == found.normalised_error
    assert report["measurand"].startswith("the mass that the forces move")
    low, high = report["mass"]["U95"]
    assert report["mass"]["U_kg"] == pytest.approx((high - low) / 2)
    assert report["mass"]["U_kg"] == report["uncertainty"]["coverage_factor"] * report["mass"]["u"]
    assert report["deviation"] is None
    assert "one-sided" in report["rpe_percent"]["meaning"]
    assert math.sqrt(sum(row["u_kg"] ** 2 for row in report["budget"])) == pytest.approx(report["mass"]["u"])
    assert [a["clock"] for a in report["alignment"]] == ["can", "imu", "camera"]
    assert [m["name"] for m in report["methods"]] == list(found.results)
    assert all(m["note"] for m in report["methods"])


def test_the_true_mass_is_what_the_forces_moved():
    assert true_mass_kg({"m3": 782.0}) == 782.0
    assert true_mass_kg({"m3": 782.0, "unread": {"forces": {"carried_oil_kg": 5.0}}}) == 787.0
    assert true_mass_kg({"m3": 782.0, "unread": {"share": 0.01, "forces": {"slide_n_s_m": 30.0}}}) == 782.0


def test_the_budget_is_sorted_and_says_what_a_sensitivity_is_per():
    budget = document()["budget"]
    assert [row["u_kg"] for row in budget] == sorted((row["u_kg"] for row in budget), reverse=True)
    per = {row["source"]: row["sensitivity_per"] for row in budget}
    assert per["packing friction"] == "N"
    assert per["recoil_acceleration zero"] == "m/s^2"
    assert per["breech_pressure sensitivity and area"] == "1"
    assert per["alignment of clock can"] == "s"
    assert per["breech_pressure zero"] == "Pa"


def test_every_sensor_is_listed_with_its_departure_and_how_significant_it_is():
    calibration = identified("mixed").route.calibration
    sensors = {s["source"]: s for s in document()["sensors"]}
    assert sensors.keys() == calibration.pulls.keys()
    for source, sensor in sensors.items():
        assert sensor["pull"] == calibration.pulls[source]
        assert sensor["normalised_residual"] == calibration.normalised_residuals[source]


def test_the_inputs_are_the_shot_file_and_what_it_was_made_from():
    inputs = document()["provenance"]["inputs"]
    assert inputs[0] == {"file": "s1.h5", "sha256": "ab" * 32, "size": 123, "source": "", "reader": "shot file"}
    assert [i["source"] for i in inputs[1:]] == ["dewetron", "can", "imu", "camera"]


def test_a_truth_gives_the_error_and_none_leaves_it_out():
    report = document(truth={"m3": 780.0})
    error = 100 * (report["mass"]["value"] / 780.0 - 1)
    assert report["truth"] == {"mass_kg": 780.0, "error_percent": pytest.approx(error)}
    assert "truth" not in document()
    assert "truth" not in document(truth={"seed": 1})


def test_numbers_that_are_not_finite_are_null(tmp_path):
    found = identified("mixed")
    failed = {c: replace(a, status="failed", u_offset_s=math.inf) for c, a in found.alignments.items()}
    nothing = replace(found.chosen, rpe_percent=math.nan, rpe_interval_percent=(math.nan, math.nan))
    found = replace(found, alignments=failed, results={**found.results, "calibrated": nothing})
    report = report_document(virtual_shot("mixed").shot, found, version="1", shot_file=SHOT_FILE)
    assert [a["u_offset_s"] for a in report["alignment"]] == [None] * 3
    assert (report["rpe_percent"]["value"], report["rpe_percent"]["U95"]) == (None, [None, None])
    json.loads(write_document(tmp_path, report).read_text(encoding="utf-8"), parse_constant=pytest.fail)


@pytest.mark.whole_way
def test_a_shot_of_one_clock_has_a_document_too():
    found = identify_shot(FiredShot(bench_shot(), bench_rig()), Options())
    report = report_document(bench_shot(), found, version="1", shot_file=SHOT_FILE)
    assert report["alignment"] == []
    assert [row["taken"] for row in report["assumptions"]].count("not measured") == 4
    json.dumps(report, allow_nan=False)


def test_the_mass_over_time_is_stated_at_its_nodes_between_which_its_logarithm_is_straight():
    walk, stated = identified("mixed").walk, document()["mass_over_time"]
    nodes_s, mass_kg, u_kg = (np.array(stated[key]) for key in ("time_s", "mass_kg", "u_kg"))
    assert nodes_s.size == 13
    np.testing.assert_allclose(nodes_s[[0, -1]], walk.times_s[[0, -1]], rtol=0, atol=1e-12)
    again = np.exp(np.interp(walk.times_s, nodes_s, np.log(mass_kg)))
    np.testing.assert_allclose(again, walk.mass_kg, rtol=2e-5)
    assert np.all(np.isin(u_kg, walk.u_kg))
    assert np.all(u_kg > 0)


def test_the_trace_is_a_table_of_the_interval_with_blanks_where_nothing_was_identified(tmp_path):
    result = identified("mixed").chosen
    holes = result.trace.identified.copy()
    holes[10:20] = False
    result = replace(result, trace=replace(result.trace, identified=holes))
    write_files(tmp_path, {TRACE_FILE: trace_text(result)})
    with (tmp_path / TRACE_FILE).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == TRACE_COLUMNS
    assert len(rows) == result.trace.times_s.size
    np.testing.assert_allclose([float(r["time_s"]) for r in rows], result.trace.times_s, atol=1e-8)
    assert [r["identified"] == "1" for r in rows] == holes.tolist()
    assert all(r["mass_kg"] == r["u_kg"] == "" for r, whole in zip(rows, holes, strict=True) if not whole)
    seen = [float(r["mass_kg"]) for r, whole in zip(rows, holes, strict=True) if whole]
    np.testing.assert_allclose(seen, result.trace.mass_kg[holes], atol=1e-6)


@pytest.mark.parametrize("written", ["NaN", "-Infinity", "1e999", "1" + 400 * "0", 40 * "[" + 40 * "]"])
def test_a_report_with_what_no_report_holds_is_none(tmp_path, written):
    stated = '"shot": "1", "rig": "r", "mass": {"value": 0.0}, "rpe_percent": {}, "valid": true, "provenance": {}'
    text = f'{{"schema": "recoil-daq/report/1", {stated}}}'
    assert read_document(tmp_path, text.encode())["mass"] == {"value": 0.0}
    with pytest.raises(ReadError, match="this is no report of a shot"):
        read_document(tmp_path, text.replace("0.0", written).encode())


def test_a_trace_whose_rows_lack_their_time_is_none(tmp_path):
    (tmp_path / TRACE_FILE).write_text(f"{','.join(TRACE_COLUMNS)}\n0.1,782,1,1\n,782,1,1\n", encoding="utf-8")
    with pytest.raises(ReadError, match="without a time"):
        read_trace(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [("0.1,782,1\n", "rows of another length"), ("", "rows of another length"), ("0.1,a,1,1\n", "could not convert")],
)
def test_a_trace_of_other_rows_is_none(tmp_path, text, words):
    (tmp_path / TRACE_FILE).write_text(f"{','.join(TRACE_COLUMNS)}\n{text}", encoding="utf-8")
    with pytest.raises(ReadError, match=words):
        read_trace(tmp_path)


@pytest.mark.whole_way
def test_a_long_trace_takes_little_more_memory_than_its_numbers(tmp_path):
    rows = [f"{k * 1e-5:.9g},782.000000,1.500000,1" for k in range(50_000)]
    rows[7] = "7e-05,,,0"
    (tmp_path / TRACE_FILE).write_text("\n".join([",".join(TRACE_COLUMNS), *rows, ""]), encoding="utf-8")
    tracemalloc.start()
    try:
        trace = read_trace(tmp_path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert trace.shape == (50_000, 3)
    assert np.isnan(trace[7]).tolist() == [False, True, True]
    assert peak < 5 * trace.nbytes


def test_a_trace_that_no_shot_has_is_not_read(tmp_path):
    with (tmp_path / TRACE_FILE).open("wb") as file:
        file.write(bytes(65_000_000))
    with pytest.raises(ReadError, match=r"too large; expected a trace of at most 64 MB"):
        read_trace(tmp_path)
