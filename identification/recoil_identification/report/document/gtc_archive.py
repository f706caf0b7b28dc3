"""The mass of a report with its influences as an archive of GTC, the GUM Tree Calculator of MSL, New Zealand.

Each row of the budget is an elementary uncertain number of value 0 and standard uncertainty 1, by which the mass goes
as the row says. Its identifier follows from what it is of: the masses of two shots share those of their sensors and of
their rig, and GTC finds how they correlate. Format: ``GTC.persistence``, JSON schema 1.5.0.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

GTC_SCHEMA = "https://measurement.govt.nz/gtc/json_1.5.0"

Report = Mapping[str, Any]


def gtc_archive(report: Report) -> dict[str, Any]:
    """Return the archive of a report of a shot, with ``mass`` and each of its influences by name, JSON types only."""
    mass, budget = report["mass"], report["budget"]
    leaves, tagged, parts = {}, {}, {}
    for row in budget:
        identity = _identity(row, report)
        uid, label = f"({_number(identity)}, 1)", ", ".join(identity)
        freedom = row["degrees_of_freedom"]
        leaves[uid] = {"CLASS": "LeafNode", "uid": uid, "label": label, "u": 1.0, "df": freedom, "independent": True}
        tagged[label] = {"CLASS": "ElementaryReal", "x": 0.0, "uid": uid}
        # the sign tells two shots' parts apart that move their masses in opposite directions
        parts[uid] = math.copysign(row["u_kg"], row["sensitivity_kg"] or 1.0)
    name = f"mass of shot {report['shot']} on rig {report['rig']}"
    whole = f"({_number((name, json.dumps(mass), report['provenance']['digest']))}, 1, 0)"
    u_kg, freedom = math.hypot(*parts.values()), report["uncertainty"]["degrees_of_freedom"]
    found = {
        "CLASS": "IntermediateReal",
        "value": mass["value"],
        "label": name,
        "uid": whole,
        "u_components": _vector(parts),
        "d_components": _vector({}),
        "i_components": _vector({whole: u_kg}),
    }
    return {
        "CLASS": "Archive",
        "version": GTC_SCHEMA,
        "leaf_nodes": leaves,
        "tagged_real": {"mass": found, **tagged},
        "tagged_complex": {},
        "untagged_real": {},
        "intermediate_uids": {whole: [name, u_kg, freedom]},
    }


def _vector(components: Mapping[str, float]) -> dict[str, Any]:
    """Return components by identifier, in the order that GTC asks for."""
    ordered = sorted(components, key=lambda uid: tuple(map(int, uid.strip("()").split(","))))
    return {"CLASS": "Vector", "index": ordered, "value": [components[uid] for uid in ordered]}


def _number(identity: tuple[str, ...]) -> int:
    """Return a number of 128 bits that nothing else has."""
    return int.from_bytes(hashlib.sha256("\0".join(identity).encode("utf-8")).digest()[:16], "big")


def _identity(row: Report, report: Report) -> tuple[str, ...]:
    """Say what an influence is and what of: of a sensor until it is calibrated anew, of a rig, or of this shot."""
    scope = str(row["scope"])
    if scope == "rig":
        return str(row["source"]), f"rig {report['rig']}"
    if scope == "shot":
        digest = report["provenance"]["inputs"][0]["sha256"]  # two days have a shot 0001 each
        return str(row["source"]), f"shot {report['shot']} on rig {report['rig']}", f"file {digest[:12]}"
    serials = scope.removeprefix("sensor ").split(" and ")
    dates = {one["calibrated"] for one in report["channels"] if one["serial"] in serials and one["calibrated"]}
    return str(row["source"]), scope, *(f"calibrated {one}" for one in sorted(dates))
