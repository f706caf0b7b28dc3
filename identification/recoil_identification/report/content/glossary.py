"""The terms of a report in plain words: explained where they stand, and listed at the end of the page.

One sentence a term. `Glossary.text` writes a text as HTML with every term explained at its first place in it, and
remembers which terms the page has; the list at its end holds those.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from recoil_acquisition.errors import visible

if TYPE_CHECKING:
    from markupsafe import Markup

TERMS: dict[str, str] = {
    "95 % coverage interval": "From where to where the true value lies with a probability of 95 %, as far as the "
    "uncertainties that went in are right (JCGM 100).",
    "RPE": "Relative percentage error: the mean distance of the mass over time from the specification mass, in percent "
    "of the latter; equation (37) of the method's paper of 2013.",
    "E_n": "Deviation from the specification over the expanded uncertainty (k = 2) of the difference: between −1 "
    "and 1 the two agree (ISO/IEC 17043).",
    "specification": "The mass that the forces should move: m3 of the rig file, oil and rods that go along as it "
    "states them, and what the shot log says was added.",
    "standard uncertainty": "Standard deviation of what is not known of a value; its symbol is u.",
    "u": "Standard uncertainty: the standard deviation of what is not known of a value.",
    "w": "Normalised residual: how far a value is from what all others say, over the standard deviation of that; "
    "beyond 3.3 either way it is no chance.",
    "normalised residual": "How far a value is from what all others say of it, over the standard deviation of that.",
    "identification interval": "The stretch of time from which the mass is identified: from the onset of force to the "
    "end of recoil travel.",
    "memory": "How far the mass over time looks back at each instant; a short memory follows changes, a long one has "
    "less noise.",
    "identified share": "Share of the identification interval in which the signals tell the mass at all: where force "
    "and acceleration are small, they do not.",
    "calibrated": "The method of the reported mass: acceleration on forces, both filtered alike, while every sensor's "
    "scale may be off by as much as its calibration says.",
    "reverse": "Least squares of the filtered acceleration on the filtered force.",
    "forward": "Least squares of the filtered force on the filtered acceleration: noise of the acceleration makes it "
    "read low.",
    "paper": "The method as published in 2013: force on acceleration, unfiltered; low, because of noise in the "
    "acceleration.",
    "kinematic": "As reverse, with the acceleration from the camera's displacement instead of the accelerometer's.",
    "camera": "High-speed camera that tracks a marker on the recoiling part: its displacement over time.",
    "tls": "Total least squares: noise in force and in acceleration is taken into account.",
    "sensitivity": "By how much the mass changes for a unit of change of its source.",
    "degrees of freedom": "How much data an uncertainty rests on; ∞ where it is a statement, of a certificate say.",
    "ν": "Degrees of freedom: how much data an uncertainty rests on; ∞ where it is a statement, of a certificate say.",
    "Welch-Satterthwaite": "Formula for how many degrees of freedom an uncertainty has that is put together of several "
    "(JCGM 100, G.4).",
    "Monte Carlo": "The whole evaluation repeated with values drawn at random within their uncertainties (JCGM 101), "
    "to check the interval.",
    "Frisch's bracket": "The masses by force on acceleration and by acceleration on force: noise alone puts the truth "
    "between them.",
    "Bayes factor": "How much likelier the samples are if the mass changes than if it does not; of its "
    "logarithm (ln), 3 is 20 to 1.",
    "Durbin-Wu-Hausman": "Statistical test of whether noise in the acceleration biases plain least squares here.",
    "low-pass": "Filter that leaves slow changes and takes off fast ones.",
    "zero-phase": "A filter that runs forward and backward, so that it delays nothing.",
    "Butterworth": "A common low-pass, flat below its cut-off.",
    "cut-off": "Frequency at which a filter leaves 71 % of an oscillation (−3 dB).",
    "stress waves": "Vibration of the structure after a blow: it is in the signals, but it is no motion of the body as "
    "a whole.",
    "F'": "Active force: all that drives the moving part, less all that resists it.",
    "a'": "Acceleration of the moving part along its travel, as one at rest beside the stand would see it.",
    "residual": "What the equation of motion leaves unexplained.",
    "breech": "Rear end of the barrel: the gas pressure on it drives the recoil.",
    "brake": "Hydraulic brake that takes up the energy of the recoil.",
    "recuperator": "Gas spring that holds the recoiling part in battery and brings it back after the shot.",
    "packing friction": "Friction of seals and slides, which no gauge reads.",
    "tipping and recoiling part": "What tips with the elevation, and the recoiling part that slides in it.",
    "release from the battery stop": "Push that stop and packing give the recoiling part while they let it go, "
    "which no gauge reads.",
    "recuperator_pressure delay of its line": "By how much the recuperator's gauge is later than the others, by "
    "the line or orifice before it: that makes nothing early.",
    "brake_pressure delay": "By how much the brake's gauge is later than the other sensors.",
    "bow of the camera's picture": "Distortion by which the camera reads the middle of the travel too long or too "
    "short against its ends.",
    "S of the camera's picture": "Distortion by which the camera reads the first half of the travel too long and the "
    "second half too short, or the reverse.",
    "fused": "From camera and accelerometers together, each with the weight that its uncertainty gives it.",
    "reference clock": "The clock that all other instruments' times are brought to.",
    "zero offsets": "What a sensor reads before the shot less what it should read at rest.",
    "offset": "Difference of an instrument's clock to the reference clock.",
    "drift": "By how much faster or slower an instrument's clock runs.",
    "ppm": "Millionths: 1 ppm is 1 µs in a second.",
    "likelihood": "How well each value explains the data; the best one has the largest.",
    "spectrum": "How much of a signal lies at which frequency.",
    "random walk": "A quantity that may change a little at every step, and no faster than the data ask for.",
    "ringing": "Vibration that goes on after a blow, and dies away.",
    "damping": "How fast a vibration dies away, in percent of the damping that stops it in one go.",
    "impulse": "Force times time: what the driving force gives the moving part until the end of travel.",
    "clipped": "Cut off at the end of the range of a sensor or recorder.",
    "baseline": "What a sensor reads before the shot.",
    "control chart": "A value shot by shot with limits that it leaves by chance hardly ever.",
    "control charts": "Values shot by shot with limits that they leave by chance hardly ever.",
    "moving range": "Difference of a value to the one before.",
    "EWMA": "Exponentially weighted moving average: it shows small changes that last.",
    "Nelson's rules": "Patterns in a control chart that chance hardly ever makes: a value far out, or several in a row "
    "on one side, rising, or near a limit.",
    "ARX": "A model that predicts a sample from earlier ones and from the force, without any mechanics.",
    "SHA-256": "Digest of a file: another content has another digest.",
}

ONLY_NAMED = frozenset({"reverse", "forward", "paper", "kinematic", "camera", "offset", "drift"})
"""Words of every day as well: no text's words are taken for these."""

_WORDS = "|".join(
    re.escape(term) for term in sorted(TERMS, key=len, reverse=True) if len(term) > 1 and term not in ONLY_NAMED
)
# u and w are words of their own only before what they are of
_PATTERN = re.compile(rf"(?<![\w'-])(?:(?i:{_WORDS})|[uwν](?=$|[\s\xa0]*(?:/|[\d.]+|of |is |are )))(?![\w'])")
_KEYS = {term.casefold(): term for term in TERMS}

_UNITS = (
    (re.compile(r"\b(m|rad|mm)/s(?:\^2|2)(?!\w)"), r"\1/s²"),
    (re.compile(r"\bs2/m2\b"), "s²/m²"),
    (re.compile(r"(?<=\d )us\b"), "µs"),
    (re.compile(r"(?<![\w.)\]/\\-])-(?=\d)|(?<=\de)-(?=\d)"), "\N{MINUS SIGN}"),
)


def notation(text: str) -> str:
    """Write units and minus signs of a text as all of a page does: m/s², µs, −1."""
    for pattern, written in _UNITS:
        text = pattern.sub(written, text)
    return text


class Glossary:
    """The terms of one page, as they are met."""

    def __init__(self) -> None:
        self._met: set[str] = set()

    def text(self, text: object) -> Markup:
        """Write a text as HTML, in the page's notation, each term explained at its first place."""
        from markupsafe import Markup, escape

        parts, at, said = [], 0, notation(visible(str(text)))
        explained: set[str] = set()
        for found in _PATTERN.finditer(said):
            key = _KEYS[found.group().casefold()]
            if key in explained:
                continue
            explained.add(key)
            parts += [escape(said[at : found.start()]), self.term(key, found.group())]
            at = found.end()
        return Markup("").join([*parts, escape(said[at:])])

    def heading(self, name: str, unit: str = "") -> Markup:
        """Write a heading of a column as HTML, its name and its unit explained."""
        from markupsafe import Markup

        key = _KEYS.get(name.casefold())
        named = self.text(name) if key is None else self.term(key, name)
        return Markup("{}&nbsp;/&nbsp;{}").format(named, self.term(unit)) if unit else named

    def term(self, key: str, shown: str | Markup | None = None) -> Markup:
        """Write one term as HTML, explained.

        One that has no sentence stays as it is.
        """
        from markupsafe import Markup, escape

        if key not in TERMS:
            return escape(visible(key) if shown is None else shown)
        self._met.add(key)
        if key == "E_n":
            shown = Markup("E<sub>n</sub>")
        return Markup('<abbr title="{}">{}</abbr>').format(TERMS[key], key if shown is None else shown)

    @property
    def met(self) -> list[tuple[str, str]]:
        """Terms and sentences that the page has, in alphabetical order."""
        return [(term, TERMS[term]) for term in sorted(self._met, key=str.casefold)]
