"""A signal that goes on from the other end of its word is told as that, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_processing.quality.word_overflow import find_word_overflow

TIMES_S = np.arange(0.0, 0.5, 5e-4)
PULSE = 20.0 * np.exp(-0.5 * ((TIMES_S - 0.2) / 0.04) ** 2) + 0.01 * np.sin(2e3 * TIMES_S)


def in_word(samples: np.ndarray, word: float) -> np.ndarray:
    """Keep what a signed word of a size holds of samples."""
    return (samples + 0.5 * word) % word - 0.5 * word


@pytest.mark.parametrize(("word", "jumps"), [(24.0, 2), (36.0, 2), (16.0, 2)])
def test_a_pulse_that_leaves_its_word_goes_on_from_the_other_end(word: float, jumps: int) -> None:
    for turned in (1.0, -1.0):
        found = find_word_overflow(in_word(turned * PULSE, word))
        assert found is not None
        assert (found.jumps, found.word) == (jumps, pytest.approx(word, rel=0.1))
    verdict, detail = found.outcome("MPa")
    assert verdict == "fail"
    assert "by the whole word, some " in detail
    assert "range" not in detail


@pytest.mark.parametrize("lost", [[], [3], range(400, 420)])
def test_lost_samples_hide_no_overflow(lost: list[int]) -> None:
    samples = in_word(PULSE, 24.0)
    samples[list(lost)] = np.nan
    assert find_word_overflow(samples) is not None


@pytest.mark.parametrize(
    "samples",
    [
        PULSE,
        np.clip(PULSE, -1.0, 12.0),
        np.where((TIMES_S > 0.18) & (TIMES_S < 0.21), 0.0, PULSE),
        np.where(np.arange(TIMES_S.size) == 400, -20.0, PULSE),
        PULSE + 15.0 * np.sin(2 * np.pi * 700.0 * TIMES_S) * (TIMES_S > 0.2),
        np.where(TIMES_S > 0.25, -5.0, 5.0),
        np.zeros(9),
        np.array([1.0, -1.0]),
        np.full(9, np.nan),
    ],
    ids=["sound", "clipped", "drop-out", "spike", "ringing", "switch", "constant", "two", "lost"],
)
def test_what_is_no_overflow_is_not_called_one(samples: np.ndarray) -> None:
    assert find_word_overflow(samples) is None


def test_an_overflow_of_one_sample_is_named_where_it_takes_the_whole_word() -> None:
    times = np.linspace(-1.0, 1.0, 2001)
    counts = np.round(32_700 * np.exp(-((times / 0.3) ** 2)))
    counts[1000] = 32_775 - 65_536
    found = find_word_overflow(0.5e-3 * counts)
    assert found is not None
    assert found.jumps == 2
    # a spike of any other size is one, and so is one of a signal that lies in no steps
    counts[1000] = -20_000
    assert find_word_overflow(0.5e-3 * counts) is None
    noise = np.random.default_rng(1).normal(0, 1e-5, counts.size)
    counts[1000] = 32_775 - 65_536
    assert find_word_overflow(0.5e-3 * counts + noise) is None
