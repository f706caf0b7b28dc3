"""Our own JSON: nothing in it is passed over."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.files.strict_json import read_json

NUMBERS = st.integers() | st.floats(allow_nan=False, allow_infinity=False)
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(),
    lambda part: st.lists(part, max_size=3) | st.dictionaries(st.text(), part, max_size=3),
)


@given(VALUES)
def test_what_the_standard_library_wrote_is_read_alike(value):
    assert read_json(json.dumps(value)) == value


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"mass": 1, "mass": 2}', "the key 'mass' twice in one object"),
        ('{"mass": 1, "mass": 1}', "the key 'mass' twice in one object"),
        ('[{"a": {"b": 1, "c": 2, "b": null}}]', "the key 'b' twice in one object"),
        (r'{"\u0061": 1, "a": 2}', "the key 'a' twice in one object"),
        ("NaN", "the number NaN"),
        ('{"a": [Infinity]}', "the number Infinity"),
        ("-Infinity", "the number -Infinity"),
        ("1e999", "the number 1e999"),
        ("9" * 400, "the number 9"),
    ],
)
def test_what_somebody_else_would_read_otherwise_is_refused(text, said):
    with pytest.raises(ValueError, match=said):
        read_json(text)


def test_numbers_that_are_not_finite_are_read_where_they_may_be():
    assert math.isnan(read_json('{"a": NaN}', finite=False)["a"])
    with pytest.raises(ValueError, match="twice"):
        read_json('{"a": NaN, "a": 1}', finite=False)
