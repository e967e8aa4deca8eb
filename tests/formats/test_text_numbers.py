"""Numbers in text, read piece by piece."""

import io

import pytest

from irtscots_cl.formats import text_numbers
from irtscots_cl.formats.text_numbers import cut_off, line_of, number, numbers, short, tokens, whole_number


@pytest.mark.parametrize("piece", [7, 8, 9, 11, 1000])
def test_words_do_not_depend_on_the_pieces(monkeypatch, piece):
    monkeypatch.setattr(text_numbers, "PIECE", piece)
    text = " 1 22\n333\t-4.5e1  6 \n"
    assert [word for words in tokens(io.StringIO(text)) for word in words] == ["1", "22", "333", "-4.5e1", "6"]
    assert numbers(io.StringIO(text), 5, "a").tolist() == [1, 22, 333, -45, 6]


def test_counts_and_words_that_are_no_numbers(monkeypatch):
    with pytest.raises(ValueError, match="a: 2 of its 3 values: cut off"):
        numbers(io.StringIO("1 2"), 3, "a")
    with pytest.raises(ValueError, match="a: more than its 1 values"):
        numbers(io.StringIO("1 2"), 1, "a")
    with pytest.raises(ValueError, match="a: 'x': must be a number"):
        number("x", "a")
    assert number(" BAD", "a", {"bad": 7.0}) == 7.0
    monkeypatch.setattr(text_numbers, "PIECE", 10)
    with pytest.raises(ValueError, match="a number of more than 10 characters"):
        numbers(io.StringIO("1" * 100), 1, "a")


@pytest.mark.parametrize(
    ("word", "said"), [("x", "whole number"), ("1.0", "whole number"), ("9" * 5000, "1 to 5"), ("0", "1 to 5")]
)
def test_whole_numbers(word, said):
    assert whole_number("5", "a", 1, 5) == 5
    with pytest.raises(ValueError, match=said):
        whole_number(word, "a", 1, 5)


def test_lines_end(monkeypatch):
    monkeypatch.setattr(text_numbers, "MAX_LINE", 10)
    assert line_of(io.StringIO("abc\ndef"), "a", 1) == "abc\n"
    with pytest.raises(ValueError, match="a: line 3: more than 10 characters"):
        line_of(io.StringIO("x" * 11), "a", 3)


def test_texts_for_messages(tmp_path):
    assert short(" a\x1bb" + "c" * 100) == "a?b" + "c" * 37
    for text, cut in ((b"1\n", False), (b"1 ", False), (b"1", True), (b"", True)):
        (tmp_path / "a").write_bytes(text)
        assert bool(cut_off(tmp_path / "a")) == cut
