"""Uncertainties that a clock's alignment cannot see: delays that are uncertain, and what another method says."""

from __future__ import annotations

import math
from dataclasses import replace

from recoil_acquisition.measured import worded
from recoil_acquisition.shot.shot import AlignmentStatus, ClockAlignment
from recoil_processing.alignment.align import MOST_U_OFFSET_S, hardly_known

SECOND_SIGMA = 4.0
"""Standard uncertainties by which two methods may differ."""


def with_uncertainty(found: ClockAlignment, u_offset_s: float, **details: object) -> ClockAlignment:
    """Return an alignment whose offset is less sure than its method could know, with the reasons in its details.

    Parameters
    ----------
    found
        Alignment as the method found it; a failed one stays as it is.
    u_offset_s
        Standard uncertainty of the offset, all in all.
    **details
        Further details, JSON types only.
    """
    if found.status == "failed":
        return found
    reasons = found.reasons
    if u_offset_s > MOST_U_OFFSET_S >= found.u_offset_s:
        reasons = (*reasons, hardly_known(u_offset_s))
    status: AlignmentStatus = "ambiguous" if reasons else "ok"
    merged = {**(found.details or {}), **details}
    return replace(found, u_offset_s=u_offset_s, status=status, reasons=reasons, details=merged)


def with_second_opinion(found: ClockAlignment, other: ClockAlignment, at_s: float) -> ClockAlignment:
    """Compare an alignment with one by another method, which must agree within both uncertainties.

    Parameters
    ----------
    at_s
        Instant of the source's clock at which they are compared.
    """
    if found.status == "failed":
        return found
    if other.status == "failed":
        reasons = tuple(worded(f"by {other.method}: ", reason) for reason in other.reasons)
        return replace(found, status="ambiguous", reasons=(*found.reasons, *reasons))
    apart = other.to_reference(at_s) - found.to_reference(at_s)
    details = {**(found.details or {}), "second_method": other.method, "second_apart_s": apart}
    details["u_second_s"] = other.u_offset_s
    if abs(apart) <= SECOND_SIGMA * math.hypot(found.u_offset_s, other.u_offset_s):
        return replace(found, details=details)
    doubt = f"{other.method} gives an offset {1e6 * apart:+.0f} us away (u {1e6 * other.u_offset_s:.0f} us)"
    return replace(found, status="ambiguous", reasons=(*found.reasons, doubt), details=details)
