"""The sensitivity of a sensor as its certificate has it: 40 mV/MPa, 2.5 pC/bar, 10 mV/g, 0.05 mV/V/kN."""

from __future__ import annotations

from dataclasses import dataclass

from recoil_acquisition.errors import nearest_first
from recoil_acquisition.quantities.quantity import UNITS, Unit, find_unit, normalise_unit
from recoil_acquisition.quantities.typed_quantity import number_and_unit

OUTPUTS = ("voltage", "charge", "current", "voltage_ratio")
"""Quantities that a sensor gives out. A voltage ratio is a bridge's output per volt of its supply."""

_EXAMPLE = 'a number and its unit as on the certificate, such as "40 mV/MPa"'


@dataclass(frozen=True)
class Sensitivity:
    """Sensitivity of a sensor: its output per unit of what it measures.

    Attributes
    ----------
    value
        Output per unit of the measured quantity, positive.
    output, per
        Units of what it gives out, and of what it measures.
    output_name, per_name
        Spellings of the units.
    """

    value: float
    output: Unit
    per: Unit
    output_name: str
    per_name: str

    @property
    def needs_amplifier(self) -> bool:
        """Whether an amplifier must be known to get from the recorder's volts to it."""
        return "voltage" not in self.output.quantities

    def same_unit(self, other: Sensitivity) -> bool:
        """Whether another one is in the same unit, however it is spelled."""
        return (self.output, self.per) == (other.output, other.per)

    def turned_into(self, recorded: Unit) -> bool:
        """Whether the chain behind the sensor ends in a unit: volts, or what the sensor gives out itself."""
        return bool(recorded.quantities & {"voltage", *self.output.quantities})

    def per_recorded(self, recorded: Unit, amplifier: float) -> float:
        """SI units of what is measured per SI unit of what is recorded.

        Parameters
        ----------
        recorded
            A unit that the chain ends in, see `turned_into`.
        amplifier
            Gain of a voltage; else volts per picocoulomb, per milliampere, or per mV/V. It counts where volts are
            recorded of the output.
        """
        if "voltage" not in recorded.quantities:
            return self.per.factor / (self.value * self.output.factor)
        amplified = self.output.factor / AMPLIFIED.get(min(self.output.quantities), 1.0)
        return self.per.factor / (self.value * amplified * amplifier)


AMPLIFIED = {"charge": 1e-12, "current": 1e-3, "voltage_ratio": 1e-3}
"""Output -> the part of its SI unit that ``amplifier`` states volts per: pC, mA, mV/V."""
AMPLIFIERS = {"charge": "V per pC", "current": "V per mA", "voltage_ratio": "V per mV/V"}
"""Output -> the unit of its ``amplifier``, in words."""


def bare_sensitivity(value: float, output: str, si_unit: str) -> Sensitivity:
    """Return the sensitivity that a bare number of pC, mV or V states, per SI unit of the quantity."""
    return Sensitivity(value, UNITS[output], UNITS[si_unit], output, si_unit)


def sensitivity_from_text(text: str) -> Sensitivity:
    """Read a sensitivity as it stands on a certificate.

    Parameters
    ----------
    text
        ``40 mV/MPa``, ``pC/(m/s2)`` and ``pC/ms⁻²`` alike, ``mV/V/kN`` of a bridge.

    Raises
    ------
    ValueError
        With every fault of it.
    """
    try:
        value, behind = number_and_unit(text)
    except ValueError as error:
        raise ValueError(f"{error}; it must be {_EXAMPLE}") from error
    faults = []
    if value == 0:
        faults.append("is zero: such a sensor gives nothing out")
    elif value < 0:
        faults.append("is negative: write it without the sign, and `polarity = -1` where the record is upside down")
    elif not 1e-30 < value < 1e30:
        faults.append("is no number that a sensor has")
    units = _units(behind, value)
    if isinstance(units, str):
        faults.append(units)
    if faults or isinstance(units, str):
        raise ValueError("; ".join(faults))
    output, per = units
    return Sensitivity(value, UNITS[output], UNITS[per], output, per)


def output_from_text(text: str) -> tuple[float, Unit]:
    """Read what a chain gives out, such as the ``2.5 V`` at zero of an accelerometer with a bias.

    Raises
    ------
    ValueError
        If it is no number with the unit of an output.
    """
    value, behind = number_and_unit(text)
    unit = find_unit(behind) if behind else None
    if unit is None or not unit.quantities & set(OUTPUTS):
        raise ValueError('must be an output with its unit, such as "2.5 V" or "4 mA"')
    return value, unit


def _units(text: str, value: float) -> tuple[str, str] | str:
    """Return the spellings of both units, or say what is wrong with them and how the value is written.

    Where several slashes may divide it the last one does that leaves a unit behind it: mV/V/kN is mV/V per kN.
    """
    outputs = [name for name, unit in UNITS.items() if unit.quantities & set(OUTPUTS)]
    output = text.rstrip("/").strip()
    if "/" not in output:
        is_output = normalise_unit(output) in outputs
        return f"is {output} per what? write {_EXAMPLE}" if is_output else f"has no unit per unit: write {_EXAMPLE}"
    cuts = [(text[:i].strip(), text[i + 1 :].strip()) for i, letter in enumerate(text) if letter == "/"]
    for output, per in reversed(cuts):
        if normalise_unit(output) in outputs and per and find_unit(per) is not None:
            return normalise_unit(output), normalise_unit(per)
    for per, output in cuts:
        if find_unit(per) is not None and normalise_unit(output) in outputs:
            turned = f", such as {1 / value:g} {output}/{per}" if value > 0 else ""
            return f"is turned round: write {output} per {per}{turned}"
    known = [(output, per) for output, per in cuts if normalise_unit(output) in outputs]
    if not known:
        nearest = ", ".join(nearest_first(cuts[0][0], outputs)[:3])
        return f"{cuts[0][0]!r} is nothing that a sensor gives out; nearest known: {nearest}"
    per = known[0][1]
    nearest = ", ".join(nearest_first(normalise_unit(per), sorted(UNITS))[:3])
    return f"{per!r} is no known unit; nearest known: {nearest}"


def amplifier_missing(sensitivity: Sensitivity) -> str:
    """Say that the volts behind a sensor's output are not known."""
    unit = AMPLIFIERS[min(sensitivity.output.quantities)]
    return f"is needed, {unit}: `sensitivity` is in {sensitivity.output_name}, and volts are recorded"
