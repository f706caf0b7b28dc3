"""Output of the command ``certificate``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import quoted
from recoil_daq.terminal.report import print_conformity
from recoil_daq.terminal.tables import say


def print_certificate(document: Mapping[str, Any], folder: Path) -> None:
    """Print number, result and word of a certificate, what its header leaves open, and how it is checked.

    Parameters
    ----------
    document
        Contents of ``certificate.json``.
    folder
        Folder that holds it.
    """
    from recoil_identification.report.content.certificate_tables import number_of, results, tested

    row = results(document)[0]
    verdict = "VALID" if document["valid"] else "NOT VALID, by concession"
    say(
        f"certificate {number_of(document)} of {tested(document)} on rig {document['rig']}: {verdict}, mass "
        f"{row['value']} kg, U {row['U']} kg (k = {row['k']}, {row['nu']} degrees of freedom)"
    )
    print_conformity(document)
    if document["not_stated"]:
        say(f"not stated in the header, and so on the certificate: {', '.join(document['not_stated'])}")
    uncovered = [one["channel"] for one in document["calibrations"] if one["in_force"] is False]
    if uncovered:
        say(f"not in force on the day of firing: the calibrations of {', '.join(uncovered)}")
    signed = ", signed" if document["provenance"]["signatures"] else ""
    digital = " and certificate.xml" if document["provenance"].get("dcc") else ""
    say(
        f"-> {folder / 'certificate.pdf'}{digital}{signed}; check it with `recoil-daq explain {quoted(folder)} --check`"
    )
