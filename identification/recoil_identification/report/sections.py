"""The sections of all documents, in reading order: the one list that page and paper read.

A new section is one entry here: its heading, its caption, its columns, and the function that makes its rows of the
document. CONTRIBUTING.md has the recipe.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from recoil_identification.report.content import campaign_tables, certificate_tables, sentences, tables
from recoil_identification.report.content.section import ALL_OTHERS, Column, Section
from recoil_identification.report.document.certificate_document import SCHEMA as CERTIFICATE_SCHEMA
from recoil_identification.report.results import beside, day, history, shot_index, sweep

Document = Mapping[str, Any]

INPUTS = Section(
    "inputs",
    "Recorded and read files",
    "Every file that this document rests on; another content has another SHA-256.",
    (
        Column("file", "File", "name", wide=True),
        Column("source", "Source"),
        Column("size", "Bytes", "number"),
        Column("sha256", "SHA-256", "code"),
    ),
    tables.inputs,
    fold_beyond=20,
    link=None,
    sparse=True,
    as_stated=True,
)

CHANNELS = Section(
    "channels",
    "Channels and their sensors",
    "Each sensor with its certificate: u is the relative standard uncertainty of its scale; the chain is what the rig "
    "file states of the way from the sensor to the number, in the keys of that file.",
    (
        Column("channel", "Channel", "name"),
        Column("role", "Role"),
        Column("sensor", "Sensor"),
        Column("certificate", "Certificate"),
        Column("calibrated", "Calibrated"),
        Column("due", "Due"),
        Column("range", "Range"),
        Column("u", "u", "number"),
        Column("clock", "Clock"),
        Column("chain", "Chain", "long"),
    ),
    tables.channels,
    link="Sensors",
    sparse=True,
    as_stated=True,
)
CONSTANTS = Section(
    "constants",
    "Areas and constants",
    "What the rig file states of the mechanism, and what is taken where it does not; exact is what has no uncertainty "
    "there.",
    (
        Column("symbol", "Symbol", "name"),
        Column("value", "Value", "number"),
        Column("u", "u", "number"),
        Column("meaning", "What it is, and its unit", "long"),
    ),
    tables.constants,
    link="Constants",
    as_stated=True,
)
CORRELATIONS = Section(
    "correlations",
    "Correlations",
    "The largest ones of what was estimated together; ln is the logarithm of a mass or of a scale. The rows of the "
    "budget are of independent sources, so that none has to be added to their squares.",
    (
        Column("one", "Quantity", "name"),
        Column("other", "With", "name"),
        Column("r", "Correlation", "number"),
    ),
    tables.correlations,
)

_BUDGET_FIGURES = (
    Column("estimate", "Estimate", "number"),
    Column("u_source", "u of the source", "number"),
    Column("sensitivity", "Sensitivity", "number"),
    Column("freedom", "ν", "number"),
    Column("u", "u", "number", "kg"),
    Column("share", "Share", "number", "%"),
    Column("width", "", "bar"),
)
"""Columns of a source's figures in the budget of a shot and of a campaign."""

SHOT_SECTIONS: tuple[Section, ...] = (
    Section("mass", figure="mass"),
    Section(
        "methods",
        "Methods compared",
        "Every method sees the same signals; the one in bold gives the result.",
        (
            Column("name", "Method", "term"),
            Column("mass", "Mass", "number", "kg"),
            Column("u", "u", "number", "kg"),
            Column("deviation", "Deviation from specification", "number", "%"),
            Column("rpe", "RPE", "number", "%"),
            Column("note", "Note", "long"),
        ),
        tables.methods,
        link="Methods",
    ),
    Section(
        "peaks",
        "Peaks, time and impulse",
        "Largest values from the onset of force to the end of recoil travel, without what the fit of the mass found of "
        "the sensors' scales and zeros; each with what contributes most to its uncertainty.",
        (
            Column("quantity", "Quantity", "name"),
            Column("value", "Value", "number"),
            Column("u", "u", "number"),
            Column("interval", "95 % interval", "number"),
            Column("unit", "Unit"),
            Column("ruled_by", "Largest contribution", "long"),
        ),
        tables.peak_rows,
        link="Peaks",
    ),
    Section(
        "budget",
        "Uncertainty budget",
        "Standard uncertainty of the mass from each source, the largest first: A by statistics of this shot, B by "
        "other knowledge; the estimate is by how much the source was found to be off; ν are degrees of freedom, the "
        "share is that of the variance.",
        (
            Column("source", "Source", "name", wide=True),
            Column("group", "Group", "long"),
            Column("kind", "Type"),
            *_BUDGET_FIGURES,
        ),
        tables.budget,
        total=tables.budget_total,
        rest=tables.budget_rest,
        folded="sources below 1 % of the variance each",
        after=sentences.coverage,
        sparse=True,
    ),
    CORRELATIONS,
    Section(
        "could-hide",
        "What this shot could not have told",
        sentences.HIDDEN,
        (
            Column("source", "Source", "name", wide=True),
            Column("largest", "Largest error that passes", "number"),
            Column("mass", "Change of the mass by it", "number", "kg"),
            Column("per", "Change of the mass", "number"),
        ),
        tables.hidden,
        link="Not told",
    ),
    Section("force", figure="force"),
    Section("residuals", figure="residuals"),
    Section("whiteness", figure="whiteness"),
    Section("measured", figure=ALL_OTHERS),
    Section("spectrum", figure="spectrum"),
    Section("alignments", figure="alignment-*"),
    Section(
        "alignment",
        "Alignment of the clocks",
        "How each source's clock maps to the reference clock, in which the figures' times are: reference time = (1 + "
        "drift) × time of the source + offset; u is that of the mapped time in the middle of the motion.",
        (
            Column("clock", "Clock", "name"),
            Column("offset", "Offset", "number", "ms"),
            Column("u_offset", "u", "number", "µs"),
            Column("drift", "Drift", "number", "ppm"),
            Column("u_drift", "u", "number", "ppm"),
            Column("status", "Status", "chip"),
            Column("method", "Method", "long"),
        ),
        tables.alignment,
        link="Alignment",
    ),
    Section("conditioning", "What was done to the signals", sentences=sentences.conditioning, link="Conditioning"),
    Section(
        "ringing",
        "Ringing taken off",
        "",
        (
            Column("channel", "Channel", "name", wide=True),
            Column("share", "Energy taken off", "number", "%"),
            Column("frequency", "Mode", "number", "Hz"),
            Column("damping", "Damping", "number", "%"),
            Column("mode", "Its energy", "number", "%"),
            Column("amplitude", "Amplitude", "number"),
        ),
        tables.ringing,
        link=None,
    ),
    Section(
        "repairs",
        "Repairs",
        "",
        (
            Column("channel", "Channel", "name"),
            Column("what", "Repair"),
            Column("samples", "Samples", "number"),
            Column("detail", "Detail", "long"),
        ),
        tables.repairs,
        link=None,
    ),
    Section(
        "quality",
        "Quality of the recording",
        tables.quality_in_words,
        (
            Column("channel", "Channel", "name"),
            Column("check", "Check"),
            Column("verdict", "Verdict", "chip"),
            Column("detail", "Detail", "long"),
        ),
        tables.quality,
        folded="passed",
        link="Quality",
    ),
    CHANNELS,
    CONSTANTS,
    INPUTS,
)
"""Sections of a shot's report."""

_QUANTITIES = Section(
    "quantities",
    "What was identified",
    "u is the standard uncertainty; the interval covers the true value with 95 % (k = 1.96 where it is symmetric). E_n "
    "compares with what the rig file declares (k = 2): within 1 the two agree.",
    (
        Column("name", "Quantity", "name", wide=True),
        Column("symbol", "Symbol", "text"),
        Column("value", "Value", "number"),
        Column("u", "u", "number"),
        Column("interval", "95 % interval", "number"),
        Column("unit", "Unit"),
        Column("expected", "Declared", "number"),
        Column("e_n", "E_n", "number"),
        Column("conforms", "Conformity"),
        Column("basis", "How", "long"),
    ),
    tables.quantities,
    after=tables.tolerances,
    link="Quantities",
    sparse=True,
)

CAMPAIGN_SECTIONS: tuple[Section, ...] = (
    Section("mass", figure="mass"),
    Section("season", figure="season"),
    Section(
        "history",
        "Earlier campaigns",
        history.caption,
        history.HISTORY.columns,
        history.HISTORY.worded,
        sparse=True,
    ),
    Section("residuals", figure="residuals"),
    Section(
        "mechanisms",
        "Configurations with other parts",
        "Each has a mass of its own; the difference from the first has a smaller uncertainty than either, because most "
        "of what they may be off by is common.",
        (
            Column("name", "Configuration", "name", wide=True),
            Column("shots", "Shots", "number"),
            Column("mass", "Mass", "number", "kg"),
            Column("u", "u", "number", "kg"),
            Column("difference", "Difference", "number", "kg"),
            Column("u_difference", "u", "number", "kg"),
        ),
        campaign_tables.mechanisms,
        link="Configurations",
    ),
    Section(
        "budget",
        "Uncertainty budget",
        campaign_tables.BUDGET,
        (
            Column("source", "Source", "name", wide=True),
            Column("group", "Group", "long"),
            Column("scope", "Shared by"),
            *_BUDGET_FIGURES,
        ),
        tables.budget,
        after=campaign_tables.coverage,
        total=tables.budget_total,
        rest=tables.budget_rest,
        folded="sources below 1 % of the variance each",
        sparse=True,
    ),
    Section(
        "learnt",
        "What the campaign learnt of the sensors",
        "What the shots share, and may be off by: the wide bar is what was known before, the narrow one what is known "
        "now, 95 % each, on the scale of the former; w is by how much the shots contradict what was known. What "
        "is counted in u is counted in the u that was known before.",
        (
            Column("influence", "Influence", "name", wide=True),
            Column("span", "", "span"),
            Column("prior", "Known to", "number"),
            Column("value", "Found", "number"),
            Column("u", "u now", "number"),
            Column("gained", "Times better", "number"),
            Column("w", "w", "number"),
        ),
        campaign_tables.learnt,
        link="Sensors",
        style="learnt",
    ),
    Section(
        "gauges",
        "Dynamic scale of each gauge",
        "By how much a gauge reads its force too large in these shots, as all of them tell it, with all that turns its "
        "reading into a force; beside it the part that is the gauge's by what was stated of each.",
        (
            Column("gauge", "Gauge", "name", wide=True),
            Column("known", "Known to", "number", "%"),
            Column("value", "Reads too large by", "number", "%"),
            Column("u", "u now", "number", "%"),
            Column("beside", "With", "name"),
            Column("own", "The gauge alone", "number", "%"),
            Column("u_own", "its u", "number", "%"),
        ),
        campaign_tables.gauges,
        style="plain",
    ),
    Section(
        "next",
        "What to do next",
        "What would make the mass surer, tried on what these shots tell.",
        (
            Column("change", "Change", "name", wide=True),
            Column("u", "u", "number", "kg"),
            Column("percent", "u", "number", "%"),
        ),
        campaign_tables.next_steps,
    ),
    Section("curves", figure="curves"),
    Section(
        "peaks",
        "Peaks, time and impulse over the shots",
        "Of shots that were fired alike the mean and how far they scatter; U is that of the mean with 95 % coverage, k "
        "its factor: by the scatter of so few shots, and by what all of them may be off by together.",
        (
            Column("quantity", "Quantity", "name"),
            Column("kind", "Fired with"),
            Column("shots", "Shots", "number"),
            Column("value", "Mean", "number"),
            Column("scatter", "Scatter", "number", "%"),
            Column("u", "u", "number"),
            Column("expanded", "U", "number"),
            Column("factor", "k", "number"),
            Column("unit", "Unit"),
        ),
        campaign_tables.peaks,
        figure="peaks",
        link="Peaks",
        sparse=True,
    ),
    Section(
        "before",
        "Sensors before the shot",
        "Zero, or reading where the zero is not known, and noise in the silence before each shot, with control limits; "
        "a trend is the median slope, tested by ranks.",
        figure=ALL_OTHERS,
        link="Before the shot",
    ),
    Section(
        "shots",
        "Shots",
        "In the order of firing; a click on a heading sorts. Mass and u are the shot's by itself, with what was added; "
        "bare and own u are without it, with the sensors' errors as the campaign found them.",
        campaign_tables.SHOTS.columns,
        campaign_tables.SHOTS.worded,
        style="shots",
        sparse=True,
    ),
    Section("notes", "Notes, and what was assumed", sentences=campaign_tables.notes, listed=True, link="Notes"),
    CHANNELS,
    CONSTANTS,
    INPUTS,
)
"""Sections of a campaign's answer."""

INDEX_SECTIONS: tuple[Section, ...] = (
    Section(
        "shots",
        "Shots",
        "In the order of firing; a click on a heading sorts. A shot's name leads to its report. u is the standard "
        "uncertainty of the mass with what was added, U half the width of its 95 % interval.",
        shot_index.INDEX.columns,
        shot_index.INDEX.worded,
        total=shot_index.sum_row,
        after=shot_index.together,
        style="shots listing",
        sparse=True,
    ),
)
"""Sections of an index of shots."""

SWEEP_SECTIONS: tuple[Section, ...] = (
    Section("mass", figure="mass"),
    Section(
        "values",
        "The mass at each value",
        "In bold what the shot's own options give; the difference is from that.",
        sweep.SWEEP.columns,
        sweep.SWEEP.worded,
        link="Values",
        sparse=True,
    ),
    INPUTS,
)
"""Sections of a sweep of one option."""


_OF_RESULTS = {shot_index.SCHEMA: INDEX_SECTIONS, sweep.SCHEMA: SWEEP_SECTIONS}
"""Sections of documents of results in a row."""


_RESULTS = Section(
    "results",
    "Results",
    "Each value with its expanded uncertainty U = k u for a coverage of 95 %, and effective degrees of freedom ν; a "
    "dash where no uncertainty is known.",
    (
        Column("quantity", "Quantity", "name"),
        Column("value", "Value", "number"),
        Column("U", "U", "number"),
        Column("k", "k", "number"),
        Column("nu", "ν", "number"),
        Column("unit", "Unit"),
    ),
    certificate_tables.results,
    as_stated=True,
)
_OF_A_CERTIFICATE = (
    Section(
        "conditions",
        "Measurand, method, decision rule",
        sentences=certificate_tables.conditions,
        listed=True,
        as_stated=True,
    ),
    Section(
        "shots",
        "What was tested",
        "Each shot as it was fired: what it added, and whether it counts.",
        (
            Column("shot", "Shot", "name"),
            Column("fired", "Fired at"),
            Column("source", "Told by", "long"),
            Column("configuration", "Configuration"),
            Column("added", "Added", "number", "kg"),
            Column("mass", "Own mass", "number", "kg"),
            Column("u", "u", "number", "kg"),
            Column("use", "Use", "long"),
        ),
        certificate_tables.shots,
        sparse=True,
        as_stated=True,
    ),
    Section(
        "calibrations",
        "Calibrations on the day of firing",
        "The sensor of each channel that the result rests on: number of its calibration, relative uncertainty U = k u "
        "of its scale as it is stated, degrees of freedom ν, and whether it was in force when the shots were fired.",
        (
            Column("channel", "Channel", "name"),
            Column("sensor", "Sensor"),
            Column("certificate", "Certificate"),
            Column("calibrated", "Calibrated"),
            Column("due", "Due"),
            Column("U", "U", "number"),
            Column("k", "k", "number"),
            Column("nu", "ν", "number"),
            Column("shots", "Shots", "long"),
            Column("in_force", "On that day", "long"),
        ),
        certificate_tables.calibrations,
        sparse=True,
        as_stated=True,
    ),
    Section(
        "deviations",
        "Deviations, repairs, what is taken for granted",
        sentences=certificate_tables.deviations,
        listed=True,
        as_stated=True,
    ),
    Section(
        "chain",
        "What it rests on",
        "Every document and shot file behind this certificate; another content has another SHA-256.",
        (
            Column("file", "File", "name", wide=True),
            Column("what", "What it is"),
            Column("sha256", "SHA-256", "code"),
        ),
        certificate_tables.chain,
        fold_beyond=20,
        as_stated=True,
    ),
)


def sections_of(document: Document) -> tuple[Section, ...]:
    """Return the sections of a document, by what it is: a target's tables are its own, and so are reports' columns."""
    if (listed := _OF_RESULTS.get(document.get("schema", ""))) is not None:
        return listed
    if document.get("schema") == day.SCHEMA:
        lost = day.LOST if document["lost"] else day.NOTHING_LOST
        return (*INDEX_SECTIONS, day.CAMPAIGN, lost, day.log_section(document), day.COPY)
    if document.get("schema") == beside.SCHEMA:
        return (*beside.differing(document), Section("figures", figure=ALL_OTHERS), INPUTS)
    if document.get("schema") == CERTIFICATE_SCHEMA:
        return (_RESULTS, *certificate_tables.peaks_section(document), *_OF_A_CERTIFICATE)
    if "target" in document:
        return (
            _QUANTITIES,
            Section("figures", figure=ALL_OTHERS),
            *map(_table, enumerate(document["tables"])),
            CHANNELS,
            CONSTANTS,
            INPUTS,
        )
    return CAMPAIGN_SECTIONS if "shots" in document else SHOT_SECTIONS


def _table(numbered: tuple[int, Mapping[str, Any]]) -> Section:
    """Return the section of a table that a target has beside its quantities."""
    number, table = numbered
    columns = tuple(
        Column(str(place), head, "name" if place == 0 else "text") for place, head in enumerate(table["columns"])
    )
    rows = [{str(place): cell for place, cell in enumerate(row)} for row in table["rows"]]
    return Section(f"table-{number}", table["title"], table["caption"], columns, lambda _: rows)
