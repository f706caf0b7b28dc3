"""All commands of the command line, put together."""

from __future__ import annotations

from functools import cache
from typing import Any

import typer

from recoil_daq.cli import COMMANDS, app


@cache
def all_commands() -> dict[str, Any]:
    """Return name -> command, as Click, or typer's copy of it, knows it."""
    group: Any = typer.main.get_command(app)
    return {name: group.get_command(None, name) for name in COMMANDS}
