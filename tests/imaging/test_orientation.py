"""How images lie in files: each word against numbers written out by hand, and the words as a group."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from irtscots_cl.imaging.orientation import CHANGES, TRANSPOSED, UNDONE_BY, combined, stored, stored_shape, upright
from irtscots_cl.scene.instrument import ORIENTATIONS

# The upright image [row, column]: rows grow upwards on the mirror. In files of each word, row by row:
UPRIGHT = np.array([[1, 2, 3], [4, 5, 6]])
FILES = {
    "upright": [[1, 2, 3], [4, 5, 6]],
    "rows-reversed": [[4, 5, 6], [1, 2, 3]],
    "columns-reversed": [[3, 2, 1], [6, 5, 4]],
    "half-turn": [[6, 5, 4], [3, 2, 1]],
    "transposed": [[1, 4], [2, 5], [3, 6]],
    "quarter-turn": [[4, 1], [5, 2], [6, 3]],
    "three-quarter-turn": [[3, 6], [2, 5], [1, 4]],
    "transposed-half-turn": [[6, 3], [5, 2], [4, 1]],
}
TURNS = {"quarter-turn": 1, "half-turn": 2, "three-quarter-turn": 3}


@pytest.mark.parametrize("word", ORIENTATIONS)
def test_each_word_is_what_the_table_says(word):
    lying = np.array(FILES[word])
    np.testing.assert_array_equal(upright(lying, word), UPRIGHT)
    np.testing.assert_array_equal(stored(UPRIGHT, word), lying)
    assert stored_shape(UPRIGHT.shape, word) == lying.shape
    assert (word in TRANSPOSED) == (lying.shape != UPRIGHT.shape)
    if word in TURNS:
        np.testing.assert_array_equal(np.rot90(lying, TURNS[word]), UPRIGHT)
    stack = np.stack([lying, 10 * lying])  # the last two axes alone are turned
    np.testing.assert_array_equal(upright(stack, word), np.stack([UPRIGHT, 10 * UPRIGHT]))


def test_an_ordinary_picture_has_its_first_row_at_the_top():
    """Rows reversed: the picture's first row is the upright grid's last."""
    np.testing.assert_array_equal(stored(UPRIGHT, "rows-reversed")[0], UPRIGHT[-1])


def test_the_eight_words_differ_and_have_all_a_name():
    square = np.arange(9).reshape(3, 3)
    assert len({stored(square, word).tobytes() for word in ORIENTATIONS}) == 8
    assert set(UNDONE_BY) == set(CHANGES) == set(ORIENTATIONS) and len(set(CHANGES.values())) == 8


def test_two_changes_one_after_the_other_are_one_word():
    square = np.random.default_rng(1).normal(size=(4, 4))
    for first, then in itertools.product(ORIENTATIONS, repeat=2):
        both = upright(upright(square, first), then)
        np.testing.assert_array_equal(upright(square, combined(first, then)), both)
    assert combined("rows-reversed", "columns-reversed") == "half-turn"
    assert combined("quarter-turn", "quarter-turn") == "half-turn"
    assert combined("quarter-turn", "upright") == "quarter-turn"
