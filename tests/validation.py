"""Real records with a known mass, identified: ``python -m tests.validation`` writes the tables of docs and README.

The records lie beside the checkout, or nowhere; nothing of them is in the project.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from recoil_acquisition.errors import IdentificationError
from recoil_identification.estimate.rounding import rounded
from recoil_identification.shot.identified import Identification
from recoil_rigs.rig import parse_rig
from tests.builders.line_shots import identified
from tests.builders.real_records import EMPS_KG, Carriage, Rocket, emps_rig, rocket_rig, write_carriage

PAGE = Path(__file__).resolve().parents[1] / "docs" / "validation.md"
README = PAGE.parents[1] / "README.md"
SHORT_HEAD = (
    "| real records of other machines ([what](docs/validation.md)) | known | recoil-daq | plain least squares |",
    "| --- | --- | --- | --- |",
)
BEGIN, END = "<!-- measured -->", "<!-- end of measured -->"
WITH_RATES = ("driving_force", "recoil_acceleration", "recoil_velocity")
"""Roles of the carriage's record with its encoder differentiated."""
TRAVEL_ALONE = ("driving_force", "recoil_displacement")
"""Roles of the carriage's record as it is: the drive's force and the encoder."""
HEAD = (
    "| data | channels | known, kg | mass, kg | U95, kg | off by | verdict | plain least squares, kg |",
    "|---|---|---|---|---|---|---|---|",
)


@dataclass(frozen=True)
class Measured:
    """One part of a real record, identified.

    Attributes
    ----------
    data, channels
        Record and what of it was taken, in words.
    known_kg
        Mass that is known of it: the mean where it changes.
    plain_kg
        Mass by plain least squares of the same samples.
    found
        Outcome; an error where there is no mass.
    """

    data: str
    channels: str
    known_kg: float
    plain_kg: float
    found: Identification | IdentificationError

    @property
    def interval_kg(self) -> tuple[float, float] | None:
        """95 % interval; None where there is no mass."""
        return None if isinstance(self.found, IdentificationError) else self.found.chosen.estimate.interval_kg

    @property
    def covers(self) -> bool:
        """Whether the interval holds the mass that is known."""
        return self.interval_kg is not None and self.interval_kg[0] <= self.known_kg <= self.interval_kg[1]

    @property
    def u_rel(self) -> float:
        """Relative standard uncertainty; infinite where there is no mass."""
        if isinstance(self.found, IdentificationError):
            return float("inf")
        return self.found.chosen.estimate.u_kg / self.found.chosen.estimate.mass_kg

    @property
    def valid(self) -> bool:
        """Whether nothing speaks against it."""
        return isinstance(self.found, Identification) and self.found.valid

    @property
    def reasons(self) -> tuple[str, ...]:
        """What speaks against it."""
        return (str(self.found),) if isinstance(self.found, IdentificationError) else tuple(self.found.reasons)

    def row(self) -> str:
        """Return its row of the table."""
        mass, expanded, off = "none", "", ""
        if isinstance(self.found, Identification):
            e = self.found.chosen.estimate
            low, high = e.interval_kg
            mass, _ = rounded(e.mass_kg, e.u_kg)
            expanded, _ = rounded((high - low) / 2, e.u_kg)
            off = f"{100 * (e.mass_kg / self.known_kg - 1):+.1f} %".replace("-", "−")
        verdict = "valid" if self.valid else f"not valid: {self.reasons[0].partition(';')[0].partition(': ')[0]}"
        known, plain = f"{self.known_kg:.2f}", f"{self.plain_kg:.2f}"
        return f"| {self.data} | {self.channels} | {known} | {mass} | {expanded} | {off} | {verdict} | {plain} |"


def outcome(rig_text: str, write: Callable[[Path], Path]) -> Identification | IdentificationError:
    """Write a record as a file, ingest it, and identify it."""
    with tempfile.TemporaryDirectory() as folder:
        rig = parse_rig(rig_text, Path(folder) / "rig.toml")
        try:
            return identified(rig, [write(Path(folder) / "0001_daq.csv")], Path(folder) / "shots")
        except IdentificationError as error:
            return error


def of_carriage(data: str, part: Carriage, roles: tuple[str, ...]) -> Measured:
    """Identify a part of the carriage's record."""
    channels = "force, encoder" if "recoil_displacement" in roles else "force, speed and acceleration of the encoder"
    found = outcome(emps_rig(*roles), partial(_write_carriage, part, roles))
    return Measured(data, channels, EMPS_KG, float(part.least_squares(40.0)[0]), found)


def _write_carriage(part: Carriage, roles: tuple[str, ...], path: Path) -> Path:
    return write_carriage(part, roles, path)


def of_rocket(data: str, part: Rocket) -> Measured:
    """Identify a part of the rocket's ascent."""
    channels = "thrust by its curve, drag computed, accelerometer"
    return Measured(data, channels, part.known_kg, part.least_squares_kg(), outcome(rocket_rig(), part.write))


def cases() -> Mapping[str, Callable[[], Measured]]:
    """Return all parts of real records by name, each to be identified when it is called."""
    found: dict[str, Callable[[], Measured]] = {}
    for roles, name in ((WITH_RATES, "rates"), (TRAVEL_ALONE, "travel")):
        for number in range(4):
            found[f"stroke {number + 1} {name}"] = partial(_stroke, number, roles)
        found[f"record {name}"] = partial(_record, roles)
    found["rocket"] = partial(_ascent, 0.0, 3.6)
    found["rocket's first second"] = partial(_ascent, 0.3, 1.0)
    found["rocket in flight"] = partial(_ascent, 1.0, 2.0)
    return found


def _stroke(number: int, roles: tuple[str, ...]) -> Measured:
    return of_carriage(f"EMPS, stroke {number + 1}", Carriage.read().strokes()[number], roles)


def _record(roles: tuple[str, ...]) -> Measured:
    return of_carriage("EMPS, the whole record", Carriage.read(), roles)


def _ascent(from_s: float, to_s: float) -> Measured:
    data = f"NDRT 2020, {from_s:g} to {to_s:g} s"
    return of_rocket(data, Rocket.read().part(from_s, to_s))


def rows(measured: Iterable[Measured]) -> Iterator[str]:
    """Yield the lines of the page's table."""
    yield from HEAD
    for one in measured:
        yield one.row()


def short_rows(measured: Mapping[str, Measured]) -> Iterator[str]:
    """Yield the lines of the README's table: strokes together, the record, the rocket."""
    yield from SHORT_HEAD
    strokes = [one for name, one in measured.items() if re.fullmatch(r"stroke \d rates", name)]
    for data, together in (
        ("EMPS, a carriage on a screw: four strokes of 1.3 s", strokes),
        ("the same: the whole record of 25 s", [measured["record rates"]]),
        ("NDRT 2020, a rocket that burns a tenth of itself, thrust by its certificate", [measured["rocket"]]),
    ):
        found = [one.found.chosen.estimate for one in together if isinstance(one.found, Identification)]
        masses = sorted({f"{e.mass_kg:.1f}" for e in found})
        wide = max((0.5 * (e.interval_kg[1] - e.interval_kg[0]) for e in found), default=0.0)
        counts = f"{sum(one.covers for one in together)} of {len(together)} hold it"
        valid = f"{sum(one.valid for one in together)} valid"
        plain = sorted({f"{one.plain_kg:.1f}" for one in together})
        own = f"{_span(masses)} kg, U95 {wide:.1f} kg: {counts}, {valid}" if found else "no mass"
        yield f"| {data} | {together[0].known_kg:.2f} kg | {own} | {_span(plain)} kg |"


def _span(numbers: Sequence[str]) -> str:
    return numbers[0] if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"


def with_table(page: str, table: str) -> str:
    """Return a page with another table between its marks."""
    marked = re.compile(f"{re.escape(BEGIN)}.*?{re.escape(END)}", re.DOTALL)
    return marked.sub(lambda _: f"{BEGIN}\n{table}\n{END}", page)


if __name__ == "__main__":
    done = {name: case() for name, case in cases().items()}
    for page, lines in ((PAGE, rows(done.values())), (README, short_rows(done))):
        text = page.read_text(encoding="utf-8")
        page.write_text(with_table(text, "\n".join(lines)), encoding="utf-8", newline="\n")
