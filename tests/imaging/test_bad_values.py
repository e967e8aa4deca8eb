"""The first value that is no measurement."""

from __future__ import annotations

import numpy as np
import pytest

from irtscots_cl.imaging.bad_values import MAX_VALUE, check_values, first_bad_value


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e101, -1e101])
@pytest.mark.parametrize("place", [(0, 0, 0), (1, 2, 3), (2, 3, 4)])
def test_the_first_bad_value_is_found(bad, place):
    values = np.zeros((3, 4, 5))
    assert first_bad_value(values) is None
    values[place] = values[2, 3, 4] = bad
    assert first_bad_value(values) == place
    with pytest.raises(ValueError, match="^images/x") as caught:
        check_values("images/x", values)
    assert str(caught.value) == f"images/x{list(place)} = {bad}: must be a finite number within 1e+100"


def test_where_nan_marks_a_missing_sample_it_is_no_bad_value():
    values = np.full((3, 4), np.nan)
    assert first_bad_value(values, nan_allowed=True) is None
    values[0] = 1.0
    assert first_bad_value(values, nan_allowed=True) is None
    values[2, 1] = np.inf
    assert first_bad_value(values, nan_allowed=True) == (2, 1)
    values[1, 3] = 1e101
    assert first_bad_value(values, nan_allowed=True) == (1, 3)


def test_large_and_whole_numbers_are_good():
    assert first_bad_value([MAX_VALUE, -MAX_VALUE]) is None
    assert first_bad_value(np.array([0, 2**64 - 1], np.uint64)) is None
    assert first_bad_value(np.array([np.float16(np.inf)])) == (0,)
    assert first_bad_value(np.zeros((0, 3))) is None
    assert first_bad_value(np.nan) == ()
    with pytest.raises(ValueError, match="^here = nan: "):
        check_values("here", np.nan)
