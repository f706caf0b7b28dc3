"""Each screen says which low-pass is whose."""

from __future__ import annotations

from typing import Any

import pytest

from recoil_daq.terminal.report import low_passes
from tests.builders.campaigns import ring_campaign


def document(method: str = "calibrated", shared_hz: float | None = None, **said: Any) -> dict[str, Any]:
    return {
        "mass": {"method": method},
        "filter": {"cutoff_hz": 600.0, "mass_cutoff_hz": 282.0, "basis": "shot", "reason": "why", "spectra_hz": 600.0}
        | said,
        "provenance": {"parameters": {"options": {"mass_cutoff_hz": shared_hz}}},
    }


OWN, SHARED, SHOWN = (
    "this force's own band",
    "the force's band, one for all shots",
    "of the mass over time, RPE and peaks",
)
AS_RECORDED = "low-pass: the mass is of what was recorded, without one; what is shown over time, peaks"
LIMITED = "a fifth of the rate of its slowest force (600 Hz by the spectra of all shots)"
BY_SHOT = "600 Hz, by this shot's spectra"


@pytest.mark.parametrize(
    ("of", "said"),
    [
        (document(), f"low-pass of the mass: 282 Hz, {OWN}; {SHOWN}: {BY_SHOT}"),
        (
            document(shared_hz=283.0, mass_cutoff_hz=283.0, cutoff_hz=399.4, basis="campaign"),
            f"low-pass of the mass: 283 Hz, {SHARED}; {SHOWN}: 399.4 Hz, {LIMITED}",
        ),
        (
            document(mass_cutoff_hz=500.0, cutoff_hz=500.0, basis="given", spectra_hz=None),
            "low-pass of the mass, of what is shown over time, RPE and peaks: 500 Hz, as asked for",
        ),
        (
            document(basis="default", cutoff_hz=300.0, spectra_hz=None, reason="the fixed 300 Hz: no spectrum"),
            f"low-pass of the mass: 282 Hz, {OWN}; {SHOWN}: 300 Hz, the fixed 300 Hz: no spectrum",
        ),
        (document("camera", mass_cutoff_hz=None), f"{AS_RECORDED}: {BY_SHOT}"),
        (document("paper"), f"{AS_RECORDED}: {BY_SHOT}"),
    ],
)
def test_the_low_pass_of_the_mass_is_told_from_that_of_what_is_shown(of: dict[str, Any], said: str) -> None:
    assert low_passes(of) == said


def test_identify_and_the_report_say_both(identified) -> None:
    said, output = identified.report["filter"], " ".join(identified.result.output.split())
    assert said["mass_cutoff_hz"] < said["cutoff_hz"] == said["spectra_hz"]
    assert f"low-pass of the mass: {said['mass_cutoff_hz']:.4g} Hz, this force's own band" in output
    assert f"RPE and peaks: {said['cutoff_hz']:.4g} Hz, by this shot's spectra" in output


@pytest.mark.whole_way
def test_a_campaign_says_whose_its_low_pass_is(run, tmp_path) -> None:

    answer = ring_campaign().answer
    result = run("campaign", answer / "reports", "--out", tmp_path / "again")
    assert "low-pass of the mass, one for all shots: " in " ".join(result.output.split())
    assert "low-pass</" in (tmp_path / "again" / "campaign.html").read_text(encoding="utf-8")
