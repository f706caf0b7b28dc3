"""A target's finding on the terminal."""

from __future__ import annotations

from recoil_daq.console import output_console
from recoil_daq.tables import print_table
from recoil_daq.targets import TargetReported
from recoil_identification.report.tables import quantities


def print_target(one: TargetReported) -> None:
    """Print a target's quantities with their intervals, and what speaks against them."""
    d = one.document
    print_table(
        f"Shot {d['shot']} on rig {d['rig']}: {d['title']}",
        ("quantity", "value", "u", "95 % interval", "unit", "declared", "how"),
        [
            (row["name"], row["value"], row["u"], row["interval"], row["unit"], row["expected"], row["basis"])
            for row in quantities(d)
        ],
        numeric=(1, 2, 3, 5),
    )
    console = output_console()
    for note in d["notes"]:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    if d["valid"]:
        console.print("[bold green]VALID[/]", end=" ")
    else:
        console.print("[bold red]NOT VALID[/]:", end=" ")
        console.print("; ".join(d["reasons"]), markup=False, soft_wrap=True)
    console.print(f"-> {one.folder / (d['target'] + '.html')}", markup=False, soft_wrap=True)
