"""Checks of losses on the way from the devices to the shot, and of the devices' clocks.

A packet or message counter shows exactly which frames are missing, so where a recording has one, its verdict
is the one that counts, and what the host met (drops, damaged entries) is a warning that says where to look.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from itertools import pairwise
from types import MappingProxyType
from typing import Any

from recoil_acquisition.devices.tick_clock import TICK_ANCHORS
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.shot.acquisition import AcquiredSource, Acquisition
from recoil_acquisition.shot.quality_check import Check, QualityCheck, Verdict

LIMITS = MappingProxyType(
    {
        "lost_share": 1e-2,  # single frames, spread over the record, over which the signals are interpolated
        "longest_gap_s": 1e-2,  # of several frames; an eighth of a recoil, as for lost samples (`quality`)
        "late_s": 0.25,  # what an adapter or a driver may hold back, and the trigger waits for
        "gone_s": 0.0,  # a device that was away lost one stretch, of which nothing says that the motion is not in it
    }
)
"""Check -> fail beyond, if the source has a channel with a role; below it, and of other sources, it warns."""

CABLE = "check the cable and the bus load before the next shot"


def check_acquisition(
    acquisition: Acquisition | None,
    recordings: Mapping[str, Recording],
    essential: Collection[str],
    replaced: Collection[str] = (),
) -> tuple[QualityCheck, ...]:
    """Check what was lost of each source, and whether the shot was acquired as the trigger asks for.

    Parameters
    ----------
    acquisition
        Record of the acquisition; None for files that were recorded otherwise: their own counters are checked all the
        same.
    recordings
        Recordings by source.
    essential
        Sources that have a channel with a role: what they lose can fail the shot.
    replaced
        Sources whose instrument's own file took the place of what was read live: what that lost is in the file.

    Returns
    -------
    tuple of QualityCheck
        Checks by source, then of the shot.
    """
    live = {} if acquisition is None else {source.name: source for source in acquisition.sources}
    end_s = None if acquisition is None else _end_s(acquisition)
    checks: list[QualityCheck] = []
    for name in dict.fromkeys((*recordings, *live)):
        metadata = recordings[name].metadata if name in recordings else {}
        source = live.get(name)
        gone_s = 0.0 if source is None or end_s is None else _gone_s(source, end_s[0], end_s[1])
        worst: Verdict = "fail" if name in essential else "warn"
        found = [*_counted(metadata, gone_s, worst), *_stream(metadata, worst)]
        if source is not None:
            met: Verdict = "warn" if name in replaced else worst
            found += _connection(source, metadata, gone_s, met)
            found += _met(source, metadata, met)
            if name in replaced:
                pass
            elif name not in recordings and source.file:
                found.append((Check.FILE, "warn", f"its capture {source.file} was not given; add it"))
            elif name in recordings and source.file and recordings[name].path.name != source.file:
                file = f"acquired as {source.file}, given as {recordings[name].path.name}: are they of one shot?"
                found.append((Check.FILE_NAMES, "warn", file))
        checks += [QualityCheck(name, check, verdict, detail) for check, verdict, detail in found]
    if acquisition is not None:
        checks += [QualityCheck("shot", check, verdict, detail) for check, verdict, detail in _whole(acquisition)]
    return tuple(checks)


def check_clock_fits(clock_fits: Mapping[str, Mapping[str, Any]]) -> tuple[QualityCheck, ...]:
    """Say how the devices' clocks went against the host's, and which of their steps were taken out.

    Parameters
    ----------
    clock_fits
        Fits by source, as `recoil_acquisition.clocks.clock_fit.ClockFit.to_json` or, of a clock that counts samples,
        `recoil_acquisition.devices.tick_clock.tick_anchors`.
    """
    checks = []
    for source, fit in clock_fits.items():
        if TICK_ANCHORS in fit:
            checks.append(QualityCheck(source, Check.CLOCK_FIT, "ok", _anchored(fit)))
            continue
        u_drift = "unknown" if fit["u_drift"] is None else f"{1e6 * fit['u_drift']:.1f}"
        checks.append(
            QualityCheck(
                source,
                Check.CLOCK_FIT,
                "ok",
                f"drift {1e6 * fit['drift']:+.1f} +- {u_drift} ppm against the host,"
                f" offset u {1e6 * fit['u_offset_s']:.1f} us, {len(fit['steps'])} steps, {fit['frames']} frames;"
                f" the host was late by {1e3 * fit['typical_delay_s']:.3f} ms typically,"
                f" {1e3 * fit['largest_delay_s']:.3f} ms at most",
            )
        )
        if fit["steps"]:
            shown = "; ".join(_step(step, fit) for step in fit["steps"][:4])
            more = f" and {len(fit['steps']) - 4} more" if len(fit["steps"]) > 4 else ""
            detail = f"the device's clock stepped {len(fit['steps'])} times, taken out: {shown}{more};"
            remedy = " check the device's supply, and that nothing sets its clock"
            checks.append(QualityCheck(source, Check.CLOCK_STEPS, "warn", detail + remedy))
        if fit["wrong_stamps"]:
            detail = (
                f"{fit['wrong_stamps']} of {fit['frames']} stamps of the device are wrong: dated by the host instead"
            )
            checks.append(QualityCheck(source, Check.CLOCK_STAMPS, "warn", detail))
    return tuple(checks)


_Found = tuple[Check, Verdict, str]


def _anchored(fit: Mapping[str, Any]) -> str:
    """Say how the samples that an instrument counted go against the host's clock."""
    anchors = fit[TICK_ANCHORS]
    largest_u_us = 1e-3 * max((one["u_ns"] for one in anchors), default=0.0)
    told = f"{len(anchors)} anchors of its ticks on the host's clock, u {largest_u_us:.0f} us at most"
    if len(anchors) < 2 or any(after["tick"] <= one["tick"] for one, after in pairwise(anchors)):
        return told  # too short for a drift, or counted anew
    first, last = anchors[0], anchors[-1]
    ticks_s = (last["tick"] - first["tick"]) / fit["rate_hz"]
    host_s = (last["host_ns"] - first["host_ns"]) / 1e9
    u_ppm = 1e-3 * math.hypot(first["u_ns"], last["u_ns"]) / ticks_s
    return f"{told}; drift {1e6 * (host_s / ticks_s - 1.0):+.0f} +- {u_ppm:.0f} ppm over {ticks_s:.2f} s"


def _step(step: Mapping[str, Any], fit: Mapping[str, Any]) -> str:
    at_s = (step["host_ns"] - fit["host_zero_ns"]) / 1e9
    return f"{step['step_s']:+.6f} s (u {step['u_step_s']:.1g} s) at {at_s:.3f} s"


def _by_share(lost: int, whole: int, worst: Verdict) -> Verdict:
    """Return how bad it is that something of a whole, what was lost included, is lost."""
    return worst if lost > LIMITS["lost_share"] * whole else "warn"


def _counted(metadata: Mapping[str, Any], gone_s: float, worst: Verdict) -> Iterator[_Found]:
    """Frames that are missing by the packet or message counter."""
    if "missing_frames" not in metadata:
        return
    missing, places, counted = metadata["missing_frames"], metadata["counter_gaps"], metadata["counted_frames"]
    if not places:
        yield Check.MISSING_FRAMES, "ok", f"none of {counted} by the counter"
        return
    whole, unsized = counted + missing, metadata["unsized_gaps"]
    longest, longest_s = metadata["longest_gap_frames"], metadata["longest_gap_s"]
    verdict = _by_share(missing, whole, worst)
    if gone_s > LIMITS["gone_s"] or ((longest > 1 or unsized) and longest_s > LIMITS["longest_gap_s"]):
        verdict = worst
    text = (
        f"{missing} of {whole} ({100 * missing / whole:.3g} %, limit {100 * LIMITS['lost_share']:g} %) in {places} gaps"
        f" of the counter, at most {longest} in a row, {1e3 * longest_s:.2f} ms"
        f" (limit {1e3 * LIMITS['longest_gap_s']:g} ms)"
    )
    if unsized:
        text += f"; at {unsized} places it stands still or goes back and does not show how many"
    yield Check.MISSING_FRAMES, verdict, f"{text}; {CABLE}"


def _stream(metadata: Mapping[str, Any], worst: Verdict) -> Iterator[_Found]:
    """Bytes of a port that belong to no frame, where a capture does not just begin or end within one."""
    if "skipped_bytes" not in metadata or "received" not in metadata:
        return
    skipped, damaged, received = metadata["skipped_bytes"], metadata["bad_checksum"], metadata["received"]
    inside = skipped - metadata.get("skipped_at_ends", 0)
    if not inside:
        yield Check.STREAM, "ok", f"{received} frames without a damaged byte between them"
        return
    verdict: Verdict = "warn"
    if "missing_frames" not in metadata:
        verdict = _by_share(damaged, received + damaged, worst)
    text = f"{skipped} of {metadata['bytes']} bytes belong to no good frame, {inside} of them between frames"
    remedy = "check the cable, the baud rate and the declared framing before the next shot"
    yield Check.STREAM, verdict, f"{text}; {damaged} checksums were wrong in {received} good frames; {remedy}"


def _end_s(acquisition: Acquisition) -> tuple[float, float]:
    """Return first and last instant of a shot, from its trigger."""
    held = [source.pre_s for source in acquisition.sources if source.pre_s is not None]
    first_s = -max(held, default=acquisition.pre_s)
    return first_s, first_s + acquisition.duration_s


def _gone_s(source: AcquiredSource, first_s: float, last_s: float) -> float:
    """Return for how much of a shot a device was away."""
    gone_s, lost_at = 0.0, None
    for event in source.events:
        if event.name == "lost" and lost_at is None:
            lost_at = event.time_s
        elif event.name == "reopened" and lost_at is not None:
            gone_s += max(min(event.time_s, last_s) - max(lost_at, first_s), 0.0)
            lost_at = None
    return gone_s if lost_at is None else gone_s + max(last_s - max(lost_at, first_s), 0.0)


def _connection(source: AcquiredSource, metadata: Mapping[str, Any], gone_s: float, worst: Verdict) -> Iterator[_Found]:
    """Whether the device delivered, throughout and in time."""
    if not source.file or not source.bytes:
        yield (
            Check.DELIVERY,
            "fail",
            "delivered nothing within the shot: check its power, its cable and the rig's `device`",
        )
        return
    lost = [event for event in source.events if event.name == "lost"]
    back = sum(event.name == "reopened" for event in source.events)
    if gone_s > LIMITS["gone_s"]:
        text = f"was away for {gone_s:.3f} s of the shot: lost {len(lost)} times, opened again {back} times"
        why = f" ({lost[0].detail})" if lost and lost[0].detail else ""
        yield Check.CONNECTION, worst, f"{text}{why}; check plug, cable and supply before the next shot"
    elif source.reopened or lost:
        times = max(source.reopened, back, len(lost))
        text = f"was lost and opened again {times} times around the shot, counted from {source.counted_from_s:+.3f} s"
        yield Check.CONNECTION, "warn", f"{text}; check plug, cable and supply before the next shot"
    if source.late_s > LIMITS["late_s"]:
        text = f"was read up to {source.late_s:.3f} s late (limit {LIMITS['late_s']:g} s): the computer stood still"
        if metadata.get("dated_by") == "host":
            yield Check.DELIVERY, worst, f"{text}, and its samples are dated by when they were read; end other programs"
        else:
            yield Check.DELIVERY, "warn", f"{text}; nothing is missing for it, and its own clock dates the samples"
    elif source.late:
        text = "had not delivered the whole span when waiting for it ended: the end of its record may be missing"
        yield Check.DELIVERY, "warn", f"{text}; compare its last instant with the others'"


def _met(source: AcquiredSource, metadata: Mapping[str, Any], worst: Verdict) -> Iterator[_Found]:
    """Whether the host met losses; they are judged only where no counter shows which frames are missing."""
    serial = source.kind == "serial"
    unit = "bytes" if serial else "frames"
    delivered = metadata.get("bytes" if serial else "data_frames")
    since = f"counted from {source.counted_from_s:+.3f} s"

    def lost(count: int) -> Verdict:
        if "missing_frames" in metadata or delivered is None:
            return "warn"
        return _by_share(count, delivered + count, worst)

    if source.kernel_drops:
        text = f"the kernel dropped {source.kernel_drops} {unit}, {since}"
        yield Check.KERNEL_DROPS, lost(source.kernel_drops), f"{text}; end other programs, and {CABLE}"
    if source.bad:
        text = f"{source.bad} entries or frames came damaged, {since}"
        yield Check.DAMAGED_ENTRIES, "warn" if serial else lost(source.bad), f"{text}; {CABLE}"
    if source.error_frames:
        text = f"{source.error_frames} error frame{'s' * (source.error_frames != 1)} on the bus, {since}"
        yield Check.ERROR_FRAMES, "warn", f"{text}; check bit rate, termination and cable before the next shot"
    unanswered = sum(event.name == "unanswered" for event in source.events)
    if unanswered:
        yield Check.UNANSWERED, "warn", f"{unanswered} requests to the device went unanswered; {CABLE}"


def _whole(acquisition: Acquisition) -> Iterator[_Found]:
    """Whether the shot as a whole is what the trigger asks for."""
    if acquisition.pre_actual_s < acquisition.pre_s:
        held = {s.name: s.pre_s for s in acquisition.sources if s.pre_s is not None}
        short = ", ".join(f"{name} {pre_s:.3f} s" for name, pre_s in held.items() if pre_s < acquisition.pre_s)
        text = f"{acquisition.pre_actual_s:.3f} s of {acquisition.pre_s:.3f} s asked for" + (short and f" ({short})")
        yield Check.PRE_TIME, "warn", f"{text}; wait that long after arming before the next shot"
    if acquisition.unseen_bytes:
        text = f"{acquisition.unseen_bytes} bytes are recorded, but the trigger did not look at them: it fell behind"
        yield Check.TRIGGER, "warn", f"{text}; end other programs, or watch fewer channels in [trigger]"
    if acquisition.lost_records:
        text = f"{acquisition.lost_records} records of the journal are damaged or missing after the crash"
        yield Check.JOURNAL, "fail", f"{text}: data of any source may be missing; check the disk"
    elif acquisition.recovered:
        yield Check.JOURNAL, "ok", "recovered from a journal that was left over, no record lost"
