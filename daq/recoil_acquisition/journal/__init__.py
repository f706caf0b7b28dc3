"""The crash-safe journal of live acquisition: written by `writer`, read back by `folder`, bytes in `layout`."""

from recoil_acquisition.journal.folder import Journal, find_journals, read_journal, remove_journal
from recoil_acquisition.journal.records import JournalCounters, JournalRecord
from recoil_acquisition.journal.writer import SEGMENT_BYTES, JournalWriter

__all__ = [
    "SEGMENT_BYTES",
    "Journal",
    "JournalCounters",
    "JournalRecord",
    "JournalWriter",
    "find_journals",
    "read_journal",
    "remove_journal",
]
