"""The head of a document: verdict, number and reasons, and what belongs to them, as page and paper both show it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from recoil_acquisition.measured import worded
from recoil_acquisition.shot.quality_check import Check
from recoil_identification.estimate.rounding import NO_NUMBER, fixed, plain, signed
from recoil_identification.report.content import campaign_tables, certificate_tables, sentences, tables
from recoil_identification.report.content.chosen_units import ChosenUnits
from recoil_identification.report.document.certificate_document import SCHEMA as CERTIFICATE
from recoil_rigs.tables.calibration_day import calibrations_in_words
from recoil_rigs.tables.specification import mass_decimals

Document = Mapping[str, Any]
Tone = Literal["ok", "doubt", "bad"]
IDENTITY = (
    "laboratory", "customer", "order", "number", "issue", "date", "replaces", "approval", "item", "received",
    "fired_from", "fired_until", "place", "operator", "remark",
)  # fmt: skip
"""Keys of the identity of a document, in the order in which they are read."""
LABELS = {
    "date": "date of issue", "approval": "authorized by", "item": "item tested", "received": "item received",
    "fired_from": "fired from", "fired_until": "fired until", "place": "place of the test", "operator": "tested by",
}  # fmt: skip
"""Keys of the identity that have other words on page and paper."""
PEAKS = "Peaks"
"""Title of the facts that stand with the verdict."""
Facts = tuple[tuple[str, str], ...]
"""Label and text of each."""


@dataclass(frozen=True)
class Measure:
    """A number that stands beside the result.

    Attributes
    ----------
    label, text
        Name and number with its unit.
    agrees
        Whether it agrees with what it is compared with; None where it says nothing of that, or nobody should go by it.
    """

    label: str
    text: str
    agrees: bool | None = None


@dataclass(frozen=True)
class Listed:
    """A list of sentences under the verdict.

    Attributes
    ----------
    title
        Heading of the list.
    folded
        Whether a page shows the list when it is asked for.
    """

    title: str
    items: tuple[str, ...]
    folded: bool = False


@dataclass(frozen=True)
class Head:
    """The head of a document.

    Attributes
    ----------
    of
        Name of what the document is of.
    rig, when
        Rig, and date and time; empty where nothing tells.
    tone, stamp
        Colour and words of the verdict.
    conformity
        The one word of the conformity with the tolerance, in capitals; empty where there is nothing to state it of.
    result
        Number with its spread, or the title of what has none.
    unit
        Unit of the number; empty where there is none.
    words
        Sentences beside the verdict.
    reasons, changes
        Reasons against the result, and changes that do not speak against it.
    measures
        Numbers beside the result.
    groups
        Further facts: title, and labels with texts.
    lists
        Lists of sentences.
    identity
        Identity of the document: who issues it, for whom, under which number.
    logo
        Picture of who issues it, as ``data:``; empty where there is none.
    concession
        Sentence on who accepts the result all the same, and why; empty where nobody does.
    """

    of: str
    rig: str
    when: str
    tone: Tone
    stamp: str
    result: str
    conformity: str = ""
    unit: str = ""
    words: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()
    measures: tuple[Measure, ...] = ()
    groups: tuple[tuple[str, Facts], ...] = ()
    lists: tuple[Listed, ...] = ()
    identity: Facts = ()
    logo: str = ""
    concession: str = ""

    @property
    def has_small_print(self) -> bool:
        """Whether anything stands behind the verdict beside the peaks."""
        return any(facts for title, facts in self.groups if title != PEAKS) or any(one.items for one in self.lists)

    @property
    def valid(self) -> bool:
        """Whether nothing speaks against the result."""
        return self.tone != "bad"

    @property
    def whole(self) -> str:
        """The result with its unit."""
        return f"{self.result} {self.unit}".rstrip()


def head_of(document: Document) -> Head:
    """Return the head of a shot's report, of a target's document or of a campaign's answer, by what it is."""
    if document.get("schema") == CERTIFICATE:
        head = _of_certificate(document)
    elif "target" in document:
        head = _of_target(document)
    else:
        head = _of_campaign(document) if "shots" in document else _of_shot(document)
    issued, units = document.get("issued") or {}, ChosenUnits.of(document)
    return replace(
        head,
        words=tuple(map(units.text, head.words)),
        reasons=tuple(map(units.text, head.reasons)),
        changes=tuple(map(units.text, head.changes)),
        groups=tuple(
            (title, tuple((label, units.text(text)) for label, text in facts)) for title, facts in head.groups
        ),
        lists=tuple(replace(one, items=tuple(map(units.text, one.items))) for one in head.lists),
        identity=(
            *identity_of(issued),
            *((LABELS.get(key, key), certificate_tables.NOT_STATED) for key in document.get("not_stated") or ()),
        ),
        logo=str(issued.get("logo") or ""),
        concession=str(issued.get("concession") or ""),
    )


def identity_of(issued: Mapping[str, Any]) -> Facts:
    """Return the identity of a document as it is read."""
    return tuple((LABELS.get(key, key), str(issued[key])) for key in IDENTITY if issued.get(key))


def _conformity(document: Document) -> tuple[str, tuple[str, ...], Facts]:
    """Return the one word of the conformity, that with its rule where one was agreed, and what both rest on."""
    found = tables.conformity(document)
    return found["word"], tuple(filter(None, [found["said"]])), (("conformity", found["words"]),)


def _of_shot(report: Document) -> Head:
    verdict, mass = tables.verdict(report), report["mass"]
    valid, unit = verdict["valid"], verdict["unit"]
    number = f"{verdict['mass']} {verdict['spread'] or ''}".rstrip() if verdict["number"] else "no number"
    factor = f" (k = {verdict['coverage_factor']}, U = {verdict['expanded']})" if verdict["coverage_factor"] else ""
    budget = tables.budget_total(report)
    word, ruled, conformity = _conformity(report)
    given = [
        ("specification", verdict["specification"] and f"{verdict['specification']} {unit}", None),
        ("deviation from the specification", verdict["off"], None),
        ("E_n to the specification (k = 2)", verdict["e_n"], verdict["agrees"] if valid else None),
        ("relative percentage error (RPE)", verdict["rpe"] and f"{verdict['rpe']} %", None),
    ]
    details = [
        (f"95 % coverage interval{factor}", verdict["interval"]),
        ("standard uncertainty u", budget and mass.get("u") and f"{budget['u']} {unit}"),
        ("RPE, 95 % coverage interval", verdict["rpe_interval"]),
    ]
    notes = [*(report.get("notes") or ()), *([verdict["rpe_meaning"]] if verdict["rpe_meaning"] else ())]
    assumed, dated = sentences.assumed(report), (*_previewed(report), *_dated(report))
    against = list(report.get("reasons") or ()) or ([] if valid else ["No reason was given."])
    return Head(
        of=f"Shot {report['shot']}",
        rig=str(report["rig"]),
        when=str(report.get("started") or "").replace("T", " "),
        tone="bad" if not valid else "doubt" if verdict["deviation"] or dated else "ok",
        stamp="VALID" if valid else "NOT VALID",
        result=number,
        unit=unit if verdict["number"] else "",
        words=(*ruled, *_measurand(report), sentences.in_words(report)),
        reasons=(*([f"Valid, {verdict['deviation']}."] if verdict["deviation"] else ()), *against, *dated),
        measures=tuple(Measure(label, text, agrees) for label, text, agrees in given if text),
        conformity=word,
        groups=(
            (PEAKS, tuple(tables.peaks(report))),
            ("The shot", (*((label, text) for label, text in details if text), *conformity, *tables.facts(report))),
        ),
        lists=(Listed("Notes", (*notes, *([worded("Assumed: ", assumed, ".")] if assumed else ()))),),
    )


def _previewed(report: Document) -> tuple[str, ...]:
    """Say that a result is by what was read live of an instrument whose own file is to come."""
    live = [str(one["about"]) for one in report.get("findings") or () if one["code"] == Check.PREVIEW.value]
    told = f"By a preview: what was read live of {', '.join(live)}. The instrument's own file takes its place."
    return (told,) if live else ()


def _of_certificate(document: Document) -> Head:
    word, ruled, _ = _conformity(document)
    mass, uncovered = document["results"][0], [one for one in document["calibrations"] if one["in_force"] is False]
    (row,) = (one for one in certificate_tables.results(document) if one["strong"])
    specification, places = document["specification"], mass_decimals(mass["u"])
    given = [
        ("coverage factor k, degrees of freedom", f"{row['k']}, {row['nu']}"),
        ("specification", specification["value"] and f"{plain(specification['value'])} kg"),
        ("deviation", specification["value"] and f"{signed(fixed(specification['deviation_kg'], places))} kg"),
    ]
    count = len(uncovered)
    dated = (f"{count} of {len(document['calibrations'])} calibrations were not in force on the day of firing.",)
    return Head(
        of=f"Certificate {certificate_tables.number_of(document)}: {certificate_tables.tested(document)}",
        rig=str(document["rig"]),
        when="",
        tone="bad" if not document["valid"] else "doubt" if uncovered else "ok",
        stamp="VALID" if document["valid"] else "NOT VALID",
        result=f"{row['value']} ± {row['U']}",
        conformity=word,
        unit="kg",
        words=(*ruled, *_measurand(document), str(document["statement"])),
        reasons=(*document["reasons"], *(dated if uncovered else ())),
        measures=tuple(Measure(label, text) for label, text in given if text),
    )


def _of_target(document: Document) -> Head:
    dated = _dated(document)
    return Head(
        of=f"Shot {document['shot']}",
        rig=str(document["rig"]),
        when=str(document.get("started") or "").replace("T", " "),
        tone="bad" if not document["valid"] else "doubt" if dated else "ok",
        stamp="VALID" if document["valid"] else "NOT VALID",
        result=str(document["title"]),
        words=(document["summary"],),
        reasons=(*document["reasons"], *dated),
        lists=(Listed("Notes", tuple(document["notes"])),),
    )


def _of_campaign(document: Document) -> Head:
    verdict, dated = campaign_tables.verdict(document), _dated(document)
    unit, valid = verdict["unit"], verdict["valid"]
    word, ruled, conformity = _conformity(document)
    given = [
        ("standard uncertainty", f"{verdict['u']} {unit}", None),
        ("specification, nothing added", verdict["specification"] and f"{verdict['specification']} {unit}", None),
        ("deviation from the specification", verdict["deviation"], None),
        ("E_n to the specification (k = 2)", verdict["e_n"], verdict["agrees"] if valid else None),
        ("shots", verdict["shots"], None),
        ("from shot to shot", verdict["between"] != NO_NUMBER and f"{verdict['between']} {unit}", None),
    ]
    charted = tuple(campaign_tables.charted(document))
    looks = campaign_tables.looks_asked_for(len(charted))
    told = (campaign_tables.unchanged, campaign_tables.agreement, campaign_tables.constancy)
    words = (*ruled, *_measurand(document), *(one(document) for one in told))
    return Head(
        of="Campaign",
        rig=str(document["rig"]),
        when=f"{verdict['shots']} shots",
        tone="bad" if not valid else "doubt" if dated else "ok",
        stamp="VALID" if valid else "NOT VALID",
        result=f"{verdict['mass']} {verdict['spread']}",
        unit=unit,
        words=tuple(word for word in words if word),
        reasons=(*document["reasons"], *dated),
        changes=tuple(campaign_tables.changed(document)),
        measures=tuple(Measure(label, text, agrees) for label, text, agrees in given if text),
        conformity=word,
        groups=(
            (
                "The campaign",
                (
                    (f"95 % coverage interval (k = {verdict['coverage_factor']})", verdict["interval"]),
                    *conformity,
                    *campaign_tables.facts(document),
                ),
            ),
        ),
        lists=(Listed(looks, charted, folded=True),),
    )


def _dated(document: Document) -> tuple[str, ...]:
    """Say that calibrations do not cover the day of the shot; nothing if all do."""
    said = calibrations_in_words(document)
    return (f"{said[0].upper()}{said[1:]}.",) if said else ()


def _measurand(document: Document) -> tuple[str, ...]:
    """Say what mass it is; nothing where an earlier document does not."""
    return (f"It is {document['measurand']}.",) if document.get("measurand") else ()
