"""The verdict on a shot in one line: what it is good for, how many warnings, and the first reason with its remedy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from recoil_acquisition.remark import Severity
from recoil_acquisition.shot.quality_check import Check, Verdict
from recoil_acquisition.shot.usability import Usability


@dataclass(frozen=True)
class VerdictLine:
    """The verdict of a document of ``ingest --json``, or of `recoil_acquisition.store.shot_summary`.

    Attributes
    ----------
    reasons
        Sentences on why the shot is not usable, the first one first.
    warned
        Sentences of the warnings, in the order of the checks.
    findings
        Findings of the document: reasons, warnings and notes with their codes.
    """

    state: Usability
    reasons: tuple[str, ...] = ()
    warned: tuple[str, ...] = ()
    findings: tuple[Mapping[str, Any], ...] = ()

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> VerdictLine:
        """Take the verdict out of a document; one of before there were three states knows two."""
        usual = Usability.USABLE if document["usable"] else Usability.NOT_USABLE
        warned = (f"{c['channel']}: {c['detail']}" for c in document["quality"] if c["verdict"] == "warn")
        if "findings" in document:  # which say a cause once
            warned = (one["text"] for one in document["findings"] if one["severity"] == Severity.WARN)
        return cls(
            Usability(document.get("state", usual)),
            tuple(document["reasons"]),
            tuple(warned),
            tuple(document.get("findings", ())),
        )

    @property
    def worst(self) -> Verdict:
        """Verdict of the worst of all checks."""
        if self.state is Usability.NOT_USABLE:
            return "fail"
        return "warn" if self.warned or self.state is Usability.RECORD_ONLY else "ok"

    @property
    def first(self) -> str:
        """The first reason; where there is none, the first warning; empty if there is neither."""
        return next(iter((*self.reasons, *self.warned)), "")

    @property
    def without(self) -> str:
        """Names of what the mass of a usable shot is found without, in words behind the state; empty for nothing."""
        if self.state is not Usability.USABLE:
            return ""
        aside = dict.fromkeys(str(one["about"]) for one in self.findings if one["code"] == Check.SET_ASIDE)
        return f" without {', '.join(aside)}" if aside else ""

    @property
    def counted(self) -> str:
        """How many warnings there are, in words behind the state; empty for none."""
        count = len(self.warned)
        return f", {count} warning{'' if count == 1 else 's'}" if count else ""

    def __str__(self) -> str:
        return f"{self.state}{self.without}{self.counted}" + (f": {self.first}" if self.first else "")
