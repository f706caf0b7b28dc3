from __future__ import annotations

import math

import pytest

from recoil_acquisition.clocks.time_lock import TimeLock


@pytest.mark.parametrize(
    ("words", "lock"),
    [
        ("PTP", TimeLock.PTP),
        ("IEEE 1588 slave, locked", TimeLock.PTP),
        ("GPS", TimeLock.GPS),
        ("IRIG-B DC", TimeLock.IRIG_B),
        ("irig_b", TimeLock.IRIG_B),
        ("PTP, not locked", TimeLock.FREE),
        ("GPS: no fix", TimeLock.FREE),
        ("Free run", TimeLock.FREE),
        ("internal clock", TimeLock.FREE),
        ("Waiting_for_sync", TimeLock.FREE),
        ("TRION-SYNC-BUS", None),
        ("", None),
    ],
)
def test_a_recorders_own_words_tell_its_lock_and_what_denies_one_counts(words: str, lock: TimeLock | None) -> None:
    assert TimeLock.of_words(words) is lock


def test_two_clocks_of_one_lock_are_apart_by_what_the_data_sheet_says() -> None:
    apart = {lock: math.hypot(lock.u_s, lock.u_s) for lock in TimeLock}
    assert apart == pytest.approx({"ptp": 150e-9, "gps": 1e-6, "irig-b": 10e-6, "free": math.inf})
