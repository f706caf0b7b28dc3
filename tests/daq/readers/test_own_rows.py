"""A channel that stands in every so many rows of a table was measured at a lower rate; it has lost nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.readers.own_rows import own_rows
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.remark import NoteCode
from tests.builders.vendor_files import dewesoft_text


@given(apart=st.integers(2, 50), phase=st.integers(0, 49), held=st.integers(8, 40), beyond=st.integers(0, 49))
def test_the_rows_are_found_whatever_their_distance_and_phase(apart, phase, held, beyond):
    phase, beyond = phase % apart, beyond % apart
    samples = np.full(phase + apart * (held - 1) + 1 + beyond, np.nan)
    samples[phase::apart] = np.arange(held)
    assert own_rows(samples) == slice(phase, None, apart)


@given(apart=st.integers(2, 20), lost=st.lists(st.integers(0, 39), max_size=15, unique=True))
def test_what_a_slower_channel_lost_itself_leaves_its_rows_as_they_are(apart, lost):
    samples = np.full(40 * apart, np.nan)
    samples[::apart] = 1.0
    samples[apart * np.array(lost, dtype=int)] = np.nan
    rows = own_rows(samples)
    assert rows is not None
    assert rows.step % apart == 0
    assert np.count_nonzero(np.isfinite(samples[rows])) == 40 - len(lost)


@pytest.mark.parametrize("empty", [[], [3], [3, 50], list(range(0, 100, 2))[:30], list(range(100))])
def test_lost_samples_of_a_fast_channel_are_no_rate(empty):
    samples = np.arange(100.0)
    samples[empty] = np.nan
    assert own_rows(samples) is None


def test_samples_lost_at_random_are_no_rate():
    samples = np.random.default_rng(1).choice([1.0, np.nan], p=[0.2, 0.8], size=500)
    assert own_rows(samples) is None


def test_a_text_says_the_rate_and_no_loss(tmp_path: Path):
    path = tmp_path / "a.csv"
    rows = [(0.001 * k, 0.1 * k, 0.5 if k % 10 == 3 else float("nan")) for k in range(400)]
    path.write_bytes(dewesoft_text(rows))
    notes = recognise(path).open(path, Declarations("dewetron")).notes
    (note,) = [note for note in notes if note.code in (NoteCode.OWN_RATE, NoteCode.LOST)]
    assert note.code is NoteCode.OWN_RATE
    assert "1 of 10 rows holds a sample, from row 4 on" in note
