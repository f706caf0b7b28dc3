"""Tables of a prediction in a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from recoil_daq.terminal.console import output_console
from recoil_daq.terminal.tables import print_table, say
from recoil_rigs.tables.specification import mass_decimals


def print_predicted(document: Mapping[str, Any]) -> None:
    """Print what to expect of shots and campaigns, what would be better, and which changes would be found.

    Parameters
    ----------
    document
        Document of ``predict --json``.
    """
    from rich.text import Text

    d = document
    shots, added_kg, mass_kg = d["shots"], d["added_mass_kg"], d["mass_kg"]
    places = mass_decimals(mass_kg * d["u_rel"])
    columns = ["shots", "u", "u, kg"] + ([f"u, {added_kg:g} kg on every second", "u, kg"] if added_kg else [])
    print_table(f"Campaigns to expect on rig {d['rig']}", columns, _by_shots(d), numeric=range(len(columns)))
    both = ("u_rel_shot", "u_rel_campaign") if shots > 1 else ("u_rel_shot",)
    print_table(
        f"What would change it, best for {_of_shots(shots)} first",
        ("change", "u of a shot", "u of the campaign")[: 1 + len(both)],
        [(one["change"], *(_percent(one[key]) for key in both)) for one in d["what_if"]],
        numeric=(1, 2),
    )
    found = d["least_found"]
    step_kg = found["mass_step_kg"]
    if step_kg is not None:
        print_table(
            "Smallest changes that half of such campaigns find",
            ("change", "size"),
            [
                (
                    "mass, from one half of the shots to the other",
                    f"{step_kg:.{mass_decimals(step_kg, 1)}f} kg",
                ),
                *((f"drift of {one['influence']}", _percent(one["size"], 2)) for one in found["drifts"]),
            ],
            numeric=(1,),
        )
        u_kg = found["u_difference_kg"]
        say(f"difference of two configurations, half of the bare shots each: u {u_kg:.{mass_decimals(u_kg)}f} kg")
    repeats, charges = d["repeatability"], d["charges"]
    nominal = "of the virtual rig" if d["from"] is None else f"as {d['from']}"
    charged = (
        "all with the same charge" if len(set(charges)) == 1 else f"charges {', '.join(f'{c:g}' for c in charges)}"
    )
    say(
        f"taken: shots {nominal}, {charged}; from shot to shot gains scatter by {_percent(repeats['gain_rel'])}, "
        f"friction by {_percent(repeats['friction_rel'], 1)}"
    )
    for note in d["notes"]:
        say(f"note: {note}")
    for reason in d["reasons"]:
        say(f"the nominal shot itself is not valid: {reason}")
    line = Text(f"u {_percent(d['u_rel'])}", style="bold")
    whole = f"{mass_kg:.{places - 2}f} kg"
    line.append(f" ({mass_kg * d['u_rel']:.{places}f} kg of {whole}) from one shot", style="default not bold")
    if shots > 1:
        base = next(one for one in d["campaign"] if (one["shots"], one["added_mass_kg"]) == (shots, added_kg))
        carried = f", {added_kg:g} kg added to every second" if added_kg else ""
        line.append(f", u {_percent(base['u_rel'])}")
        line.append(f" ({mass_kg * base['u_rel']:.{places}f} kg) from {shots} shots{carried}", style="default not bold")
    output_console().print(line, soft_wrap=True)


def _by_shots(document: Mapping[str, Any]) -> list[tuple[str, ...]]:
    rows: dict[int, list[str]] = {}
    places = mass_decimals(document["mass_kg"] * document["u_rel"])
    for one in document["campaign"]:
        u = one["u_rel"]
        rows.setdefault(one["shots"], []).extend((_percent(u), f"{document['mass_kg'] * u:.{places}f}"))
    wide = max(len(cells) for cells in rows.values())
    return [(str(shots), *cells, *[""] * (wide - len(cells))) for shots, cells in rows.items()]


def _percent(share: float, places: int = 3) -> str:
    return f"{100 * share:.{places}f} %"


def _of_shots(shots: int) -> str:
    return "one shot" if shots == 1 else f"{shots} shots"
