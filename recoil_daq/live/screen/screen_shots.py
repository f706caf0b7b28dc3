"""Shots on the armed screen: a row for each, with verdict, figures and mass; their warnings in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from recoil_acquisition.errors import visible
from recoil_daq.live.range_state import FigureCode, RangeFigure, RangeShot, RangeState
from recoil_daq.live.screen.large_letters import large
from recoil_daq.live.screen.screen_cells import folder_text
from recoil_daq.live.screen.screen_look import Look
from recoil_daq.live.screen.screen_table import line_of, wrapped
from recoil_daq.live.shot import ShotState
from recoil_daq.terminal.engineering import engineering
from recoil_rigs.tables.specification import mass_decimals

if TYPE_CHECKING:
    from rich.text import Text

COLOURED_S = 180.0
"""Time after its verdict for which a shot's row is in colour, s."""
LARGE_S = 60.0
"""Time for which the last verdict is in large letters, s, unless somebody has seen it."""
_VERDICT_WIDTH, _FIGURE_WIDTH = 25, 9
_MOST_REASON = 4
SHOT_STYLES = {
    ShotState.USABLE: "green",
    ShotState.RECORD_ONLY: "bold yellow",
    ShotState.NOT_USABLE: "bold red",
    ShotState.NOT_WHOLE: "bold red",
    ShotState.FAILED: "bold red",
    ShotState.INCOMPLETE: "yellow",
}


def shots_in_order(shots: Sequence[RangeShot]) -> list[RangeShot]:
    """Put the shots that are on the way first, then the others, the newest first."""
    return [*(s for s in reversed(shots) if not s.settled), *(s for s in reversed(shots) if s.settled)]


def shot_lines(
    shots: Sequence[RangeShot], head: Sequence[Text], blocks: Sequence[Sequence[Text]], rows: int, width: int
) -> list[Text]:
    """Return the rows of shots in so many lines; where not all have room, the last counts those that have none.

    Parameters
    ----------
    blocks
        Lines of each shot: where not all have room, the first of each is shown.
    """
    if len(head) + sum(map(len, blocks)) <= rows:
        return [*head, *(line for block in blocks for line in block)]
    lines = [block[0] for block in blocks]
    if len(head) + len(lines) <= rows:
        return [*head, *lines]
    if rows < 2 and len(lines) < 2:
        return lines[:rows]
    if rows < 2:
        more = line_of(f"  +{len(lines) - 1} more", "dim")
        return [line + more if line.cell_len + more.cell_len <= width else line for line in lines[:rows]]
    kept = rows - 1 - len(head)
    if kept < 1:
        head, kept = (), rows - 1
    return [*head, *lines[:kept], _more(shots[kept:])]


def _more(shots: Sequence[RangeShot]) -> Text:
    """Count the shots that have no line of their own, by what they are."""
    counted = ", ".join(f"{count} {state}" for state, count in Counter(shot.state for shot in shots).items())
    return line_of(f"+{len(shots)} more: {counted}", "dim")


def _codes(shots: Sequence[RangeShot]) -> tuple[FigureCode, ...]:
    """Return the figures that any of the shots has."""
    there = {figure.code for shot in shots for figure in shot.figures}
    return tuple(code for code in FigureCode if code in there)


def shot_titles(shots: Sequence[RangeShot]) -> Text:
    """Write the titles of the columns, of those figures that any of the shots has."""
    cells = "".join(f"{code.value:>{_figure_width(code)}}" for code in _codes(shots))
    return line_of(f"{'shot':6}{'verdict':{_VERDICT_WIDTH - 6}}{cells}  mass, kg", "bold")


def _figure_width(code: FigureCode) -> int:
    """Return the width of a column of figures; one of a compound unit is longer."""
    return _FIGURE_WIDTH + (code is FigureCode.SPEED)


def shot_block(shot: RangeShot, look: Look, shots: Sequence[RangeShot]) -> list[Text]:
    """Write how far a shot is, what it waits for, or its verdict, figures and mass; below it what speaks against it."""
    style = SHOT_STYLES.get(shot.state, "cyan")
    if shot.settled and (shot.age_s is None or shot.age_s > COLOURED_S):
        style = ""
    name = visible(shot.name)
    why = visible(" ".join(shot.why.split()))
    if shot.state is ShotState.USABLE:
        return [_judged_line(shot, name, look, style, shots)]
    if shot.settled and (shot.figures or shot.mass is not None):
        indent = len(name) + (1 if look.narrow else 2)
        below = wrapped(f"{' ' * indent}{why}", look.width, indent=indent, most=_MOST_REASON) if why else []
        return [_judged_line(shot, name, look, style, shots), *below]
    text = line_of(f"{name}{' ' if look.narrow else '  '}").append(
        _state_words(shot, offered=look.has_keys and not look.narrow), style
    )
    text.append(", excluded" if shot.excluded else "", "yellow")
    return [text.append(f": {why}" if why else "")]


def _state_words(shot: RangeShot, *, offered: bool) -> str:
    awaited = [*(f"the rest of {name}" for name in shot.growing), *shot.missing]
    if shot.state is ShotState.WAITING and awaited:
        left = "" if shot.left_s is None else f", {shot.left_s:.0f} s left"
        without = "; c goes on without" if offered and not shot.growing else ""
        return f"waiting for {visible(', '.join(awaited))}{left}{without}"
    if shot.state is ShotState.WAITING:
        return "waiting for its turn"
    if shot.state in (ShotState.CUTTING, ShotState.CONVERTING):
        return "captured, being cut" if shot.state is ShotState.CUTTING else "being converted"
    return str(shot.state).upper()


def _judged_line(shot: RangeShot, name: str, look: Look, style: str, shots: Sequence[RangeShot]) -> Text:
    usable = shot.state is ShotState.USABLE
    count = 0 if shot.verdict is None or not usable else len(shot.verdict.warned)
    plural = "" if count == 1 else "s"
    warnings = (f", {count} warn" if look.narrow else f", {count} warning{plural}") if count else ""
    if shot.excluded:
        warnings = ", excluded" if usable and not look.narrow else ", excl."
    of_figures = {figure.code: figure for figure in shot.figures}
    text = line_of(f"{name} " if look.narrow else f"{name:4}  ")
    text.append("usable" if usable else str(shot.state).upper(), style)
    text.append(warnings, "yellow" if shot.excluded or (count and style) else "")
    if look.narrow:
        figures = [_figure(one) for code, one in of_figures.items() if code is not FigureCode.SPEED]
        return text.append("".join(f"  {one}" for one in figures)).append_text(_mass(shot, "  ", " kg", short=True))
    text.align("left", _VERDICT_WIDTH)
    for code in _codes(shots):
        text.append(f"{_figure(of_figures[code]) if code in of_figures else '-':>{_figure_width(code)}}")
    mass = _mass(shot, "  ", "", short=False)
    fits = text.cell_len + mass.cell_len <= look.width
    return text.append_text(mass if fits else _mass(shot, "  ", "", short=True))


def _figure(figure: RangeFigure) -> str:
    return engineering(figure.value, figure.unit)


def _mass(shot: RangeShot, before: str, unit: str, *, short: bool) -> Text:
    """Write a mass and half the width of its interval; what speaks against it in a word."""
    if shot.mass is None:
        return line_of(f"{before}mass to come" if shot.mass_to_come else "", "cyan")
    low, high = shot.mass["U95"]
    places = mass_decimals(shot.mass["u"], 1)
    text = line_of(f"{before}{shot.mass['value']:.{places}f} +- {(high - low) / 2:.{places}f}{unit}")
    if not shot.mass["valid"]:
        return text.append(" NOT VALID", "bold red")
    return text.append((" prov." if short else " provisional") if shot.provisional else "", "yellow")


def newest_verdict(state: RangeState) -> RangeShot | None:
    """Return the shot whose verdict is to be seen from afar; None where there is none, or it was seen."""
    judged = [shot for shot in state.shots if shot.state in SHOT_STYLES and shot.age_s is not None and not shot.seen]
    fresh = [shot for shot in judged if shot.age_s is not None and shot.age_s < LARGE_S]
    return min(fresh, key=lambda shot: shot.age_s or 0.0) if fresh and state.state != "recording" else None


def verdict_lines(shot: RangeShot, look: Look) -> list[Text]:
    """Write a verdict in large letters, with its mass, and what speaks against it below."""
    style = SHOT_STYLES.get(shot.state, "bold")
    lines = [line_of(f" {row}", style) for row in large(str(shot.state), look.width - 1)]
    name = visible(shot.name)
    counted = "" if shot.verdict is None else f"{shot.verdict.without}{shot.verdict.counted}"
    head = line_of(f" shot {name}").append("" if lines else f": {str(shot.state).upper()}", style).append(counted)
    lines.append(head.append_text(_mass(shot, ", ", " kg", short=look.narrow)))
    against = shot.why if shot.state is not ShotState.USABLE else ""
    if not against and shot.mass is not None and not shot.mass["valid"]:
        against = str(shot.mass["reason"])
    return lines + (
        wrapped(f" {' '.join(against.split())}", look.width, indent=1, most=_MOST_REASON) if against else []
    )


def words_of(state: RangeState, look: Look, room: int) -> list[Text]:
    """Return reasons and warnings of the shots in words, the newest first, then the newest notices."""
    lines: list[Text] = []
    for shot in reversed(state.shots):
        verdict = shot.verdict
        against = [] if shot.mass is None or shot.mass["valid"] else [f"mass NOT VALID: {shot.mass['reason']}"]
        texts = [*against, *(() if verdict is None else (*verdict.reasons, *verdict.warned))]
        if shot.problem and shot.problem not in texts:
            texts.insert(0, shot.problem)
        if texts:
            counted = "" if verdict is None else f"{verdict.without}{verdict.counted}"
            lines.append(line_of(f"shot {visible(shot.name)}: {shot.state}{visible(counted)}", "bold"))
            for text in texts:
                lines += wrapped(f"- {text}", look.width, indent=2)
    if not lines:
        lines.append(line_of("no shot has a warning", "bold"))
    of_shots = len(lines)
    if state.notices and len(lines) + 2 < room:
        lines.append(line_of("what happened, the newest first", "bold"))
        for notice in reversed(state.notices):
            lines += wrapped(notice.line, look.width, indent=2)
    if len(lines) > room > 0:
        file = f"{visible(folder_text(state.out, most=30))}ID.h5"
        where = f": `recoil-daq show {file}`" if of_shots >= room else ", printed above"
        lines[room - 1 :] = [line_of(f"+{len(lines) - room + 1} more lines{where}", "dim")]
    return lines[:room]
