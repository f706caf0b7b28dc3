"""A source is known to be empty where somebody kept looking, and not right behind a stall."""

from __future__ import annotations

from recoil_acquisition.devices.device import EmptyLook

SECOND = 1_000_000_000


def looks(*seen: tuple[float, bool]) -> float:
    """Return when a source was last found empty, after some looks from 10 s on."""
    look = EmptyLook()
    look.empty_ns = 0
    look.looked(10 * SECOND, empty=True)
    look.looked(11 * SECOND, empty=False)
    for k in range(30):  # what was not believed at first is believed by now
        look.looked(round((11 + k / 10) * SECOND), empty=True)
    for time_s, empty in seen:
        look.looked(round(time_s * SECOND), empty=empty)
    return look.empty_ns / SECOND


def test_an_empty_look_counts_and_a_full_one_does_not() -> None:
    assert looks((14.0, True)) == 14.0
    assert looks((14.0, False), (14.1, False)) == 13.9


def test_right_behind_a_stall_an_empty_look_is_not_believed() -> None:
    assert looks((14.7, False), (14.701, True), (14.8, True), (14.94, True)) == 13.9
    assert looks((14.7, False), (14.8, True), (14.951, True)) == 14.951


def test_a_stall_within_the_time_of_mistrust_makes_it_begin_again() -> None:
    assert looks((14.7, True), (14.9, True), (15.2, True), (15.4, True)) == 13.9
