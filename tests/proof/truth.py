"""How near the truth the virtual rig's answers are, beside other methods on the same shots, and beside bounds."""

from __future__ import annotations

import warnings
from functools import partial
from pathlib import Path

import numpy as np

from recoil_rigs.rig import parse_rig
from tests.benchmarks import test_alignment_benchmark as aligning
from tests.benchmarks import test_campaign_benchmark as campaigns
from tests.benchmarks import test_coverage_benchmark as coverage
from tests.benchmarks import test_documented_day_benchmark as documented
from tests.builders.documented_days import Day
from tests.builders.judged import halves, interval_score, worst_group
from tests.builders.line_shots import identified
from tests.builders.real_records import EMPS_KG, Carriage, emps_rig, write_carriage
from tests.proof.row import Row, beside, significant, times

WINDOW_S, WINDOW_HZ = 2.0, 40.0
"""Length of a real record's windows, and the cut-off behind which a grey box is fitted to them."""
WINDOW_ROLES = ("driving_force", "recoil_acceleration", "recoil_velocity")


def alignment(quick: bool, _: Path) -> list[Row]:
    """A camera's clock beside obspy's pick correction, and beside the bound of Cramer and Rao."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # obspy 1.4 asks for its plug-ins as Python 3.9 did
        found = aligning.aligned(aligning.SHOTS[:2] if quick else aligning.SHOTS)
    error_s, bound_s = aligning.beside_its_bound(range(3 if quick else 200))
    ours = float(np.median(np.abs(found.errors_s["likelihood (this)"])))
    what = f"clock of a camera, {len(found.u_s)} shots: median error"
    names = {"obspy pick correction": "obspy xcorr_pick_correction", "whole frames": "correlation to a frame"}
    medians = {
        one: float(np.median(np.abs(found.errors_s[name]))) for name, one in names.items() if name in found.errors_s
    }
    peers = {one: (f"{significant(1e6 * theirs)} µs", theirs / ours) for one, theirs in medians.items()}
    rows = [beside(what, f"{significant(1e6 * ours)} µs", peers, "alignment")]
    if len(peers) < len(names):
        rows.append(Row(what, "", "obspy is not installed: extra `bench`", "", "alignment"))
    rows.append(
        Row(
            "clock of a camera: RMS error where only the camera is noisy",
            f"{significant(1e6 * error_s, 3)} µs",
            f"Cramér-Rao bound: {significant(1e6 * bound_s, 3)} µs",
            f"{error_s / bound_s:.2f} of the bound",
            "alignment",
        )
    )
    holds = float(np.mean(np.abs(found.pulls) < 1.96))
    rows.append(Row("clock of a camera: 95 % interval holds", f"{100 * holds:.0f} %", "95 %", "", "alignment"))
    return rows


def shots(quick: bool, _: Path) -> list[Row]:
    """The mass of single shots: coverage, and error beside the published method."""
    rows, judged = [], list[tuple[str, float, bool, dict[str, float]]]()
    count = 1 if quick else coverage.SHOTS
    for name in ("field-2013",) if quick else ("field-2013", "mixed"):
        settings = dict(coverage.DRAWN)
        outcomes = (
            [coverage.outcome(name, coverage.FIRST_SEED[name], settings)]
            if quick
            else coverage.all_of(name, settings, count)
        )
        both = {
            method: np.array([(*one.methods[method][:4], one.truth_kg) for one in outcomes]).T
            for method in ("calibrated", "paper")
        }
        errors = {
            method: 100 * float(np.sqrt(np.mean((mass / true - 1) ** 2)))
            for method, (mass, _, _, _, true) in both.items()
        }
        held = {method: int(np.sum((low <= true) & (true <= high))) for method, (_, _, low, high, true) in both.items()}
        for one in outcomes:
            intervals = {method: one.methods[method][2:4] for method in both}
            score = {
                method: 100 * interval_score(*interval, one.truth_kg) / one.truth_kg
                for method, interval in intervals.items()
            }
            low, high = intervals["calibrated"]
            judged.append((name, one.methods["calibrated"][1], low <= one.truth_kg <= high, score))
        what = f"mass of a shot, `{name}`"
        rows.append(
            Row(
                f"{what}: 95 % interval holds the truth; RMS error",
                f"{held['calibrated']} of {count} shots; {significant(errors['calibrated'])} %",
                f"published method: {held['paper']} of {count}; {significant(errors['paper'])} %",
                times(errors["paper"] / errors["calibrated"]),
                "shots",
            )
        )
    names, u_kg, holds, scores = zip(*judged, strict=True)
    share, group = worst_group(holds, {"rig": names, "": halves(u_kg)})
    ours, theirs = (float(np.mean([one[method] for one in scores])) for method in ("calibrated", "paper"))
    rows.append(
        Row(
            "mass of a shot: worst group by rig and u; mean interval score",
            f"{100 * share:.0f} % ({group.strip()}); {significant(ours)} %",
            f"published method: {significant(theirs)} %",
            times(theirs / ours),
            "shots",
        )
    )
    return rows


def many_shots(quick: bool, _: Path) -> list[Row]:
    """Campaigns of eight shots beside the weighted mean of their masses."""
    if quick:
        one = campaigns.fired(0, shots=2)
        found = campaigns.combine(one.shots).mass
        sets = {
            "a quick one": ([(found.mass_kg, found.u_kg, one.mass_kg)], [(*campaigns.naive(one.shots), one.mass_kg)])
        }
    else:
        replayed = {
            kind: list(campaigns.over_replays(partial(campaigns.answered, ringed=ringed)))
            for kind, ringed in (("nothing added", False), ("120 kg on every second shot", True))
        }
        campaigns.send_home()
        sets = {kind: ([one[0] for one in answers], [one[1] for one in answers]) for kind, answers in replayed.items()}
    rows = []
    for kind, (joint, mean) in sets.items():
        (_, hits, _, rms), (_, mean_hits, _, mean_rms) = campaigns.judged(joint), campaigns.judged(mean)
        what, count = f"mass of 8 shots, {kind}", len(joint)
        rows += [
            Row(
                f"{what}: 95 % interval holds the truth",
                f"{hits} of {count} campaigns",
                f"weighted mean: {mean_hits} of {count}",
                "",
                "campaign",
            ),
            Row(
                f"{what}: RMS error",
                f"{significant(rms)} %",
                f"weighted mean: {significant(mean_rms)} %",
                times(mean_rms / rms),
                "campaign",
            ),
        ]
    return rows


def days(quick: bool, _: Path) -> list[Row]:
    """Days as this page plans them, each with sensors and noise of its own: are they valid, and do they hold?"""
    lived = (
        documented.lived([Day("field-2013", "120 kg", 3, shots=2, shorter=True)]) if quick else documented.documented()
    )
    valid, held, rms = documented.scores(lived)
    means = np.array([(*campaigns.naive(one.shots), one.mass_kg) for one in lived]).T
    mean_held = int(np.sum(np.abs(means[0] - means[2]) <= 1.96 * means[1]))
    return [
        Row(
            "a day of 8 shots, plain or with 120, 160 or 310 kg on every second: valid; 95 % interval holds the truth",
            f"{valid}; {held} of {len(lived)} days (rms of error over u {rms:.2f})",
            f"weighted mean holds: {mean_held}",
            "",
            "days",
        )
    ]


def windows(quick: bool, folder: Path) -> list[Row]:
    """Windows of a real machine's record beside least squares of a grey box, its covariance taken as exact."""
    import statsmodels.api as sm
    from scipy.signal import butter, filtfilt

    record, holds, widths = Carriage.read(), {"ours": 0, "theirs": 0}, {"ours": list[float](), "theirs": list[float]()}
    length, low = round(WINDOW_S / float(record.times_s[1] - record.times_s[0])), butter(4, 2e-3 * WINDOW_HZ)
    count, valid = 2 if quick else record.times_s.size // length, 0
    text = emps_rig(*WINDOW_ROLES).replace("u_rel = 0.01, u_zero_rel", "u_rel = 0.001, u_zero_rel")
    rig = parse_rig(text, Path("emps.toml"))
    for number in range(count):
        part = record.part(number * length, (number + 1) * length)
        way = np.sign(part.speed_m_s)
        # where it goes one way only, a constant is the friction
        columns = [part.acceleration_m_s2, part.speed_m_s, np.ones(length), *([way] if np.ptp(way) > 0 else [])]
        # one row for each two of the cut-off, so that the errors of neighbours are about independent
        every = slice(None, None, round(250.0 / WINDOW_HZ))
        design = np.column_stack([filtfilt(*low, column) for column in columns])[every]
        fitted = sm.OLS(filtfilt(*low, part.force_n)[every], design).fit()
        found = identified(rig, [write_carriage(part, WINDOW_ROLES, folder / f"{number}.csv")], folder / f"{number}")
        valid += found.valid
        for name, (first, last) in (
            ("ours", found.chosen.estimate.interval_kg),
            ("theirs", tuple(fitted.conf_int(0.05)[0])),
        ):
            holds[name] += first <= EMPS_KG <= last
            widths[name].append(interval_score(first, last, EMPS_KG))
    ours, theirs = (float(np.mean(widths[name])) for name in ("ours", "theirs"))
    return [
        Row(
            f"EMPS, {count} windows of {WINDOW_S:g} s, force to 0.1 %: 95 % interval holds the mass; "
            "mean interval score",
            f"{holds['ours']} of {count}, {valid} valid; {significant(ours)} kg",
            f"grey box by statsmodels, its covariance taken as exact: {holds['theirs']} of {count}; "
            f"{significant(theirs)} kg",
            times(theirs / ours),
            "windows",
        )
    ]
