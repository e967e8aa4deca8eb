"""Numbers in text files, read piece by piece: memory for the numbers, not for their text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import IO

import numpy as np

from irtscots_cl.maths.arrays import FloatArray

PIECE = 2**16  # characters read at once
MAX_LINE = 2**24  # characters of one line


def opened_text(path: Path) -> IO[str]:
    """A text file for reading, whatever its line ends; bytes that are no UTF-8 become characters that no number has."""
    return open(path, encoding="utf-8-sig", errors="replace", newline=None)


def cut_off(path: Path) -> tuple[str, ...]:
    """A warning where a text file does not end with a line: its last number may have lost digits."""
    with open(path, "rb") as file:
        file.seek(max(0, path.stat().st_size - 1))
        last = file.read(1)
    return () if last.isspace() else ("the file ends within a line: its last number may be cut off",)


def short(text: str) -> str:
    """A part of a file for a message: printable, at most 40 characters."""
    return "".join(c if c.isprintable() else "?" for c in text.strip()[:40])


def comment_lines(lines: Iterable[str]) -> tuple[str, ...]:
    """Lines of a comment as a map keeps them: printable ASCII without blank ones, at most 20 of 200 characters."""
    plain = ("".join(c if " " <= c <= "~" else "?" for c in line.strip()[:200]) for line in islice(lines, 1000))
    return tuple(islice((line for line in plain if line), 20))


def line_of(file: IO[str], where: str, number: int) -> str:
    """The next line of a file, empty at its end. Raises ValueError for one that is endless."""
    line = file.readline(MAX_LINE)
    if len(line) >= MAX_LINE:
        raise ValueError(f"{where}: line {number}: more than {MAX_LINE} characters")
    return line


def tokens(file: IO[str]) -> Iterator[list[str]]:
    """The rest of a file as words, a piece at a time."""
    rest = ""
    while piece := file.read(PIECE):
        words = (rest + piece).split()
        rest = words.pop() if words and not piece[-1].isspace() else ""
        if len(rest) > PIECE:
            raise ValueError(f"a number of more than {PIECE} characters")
        if words:
            yield words
    if rest:
        yield [rest]


def numbers(file: IO[str], count: int, where: str, missing: dict[str, float] | None = None) -> FloatArray:
    """The next `count` numbers, the rest of a file. missing: words that stand for a value, such as BAD.

    Raises ValueError for another number of them, and for what is no number.
    """
    values = np.empty(count)
    at = 0
    for words in tokens(file):
        if at + len(words) > count:
            raise ValueError(f"{where}: more than its {count} values")
        values[at : at + len(words)] = [number(word, where, missing) for word in words]
        at += len(words)
    if at < count:
        raise ValueError(f"{where}: {at} of its {count} values: cut off or broken")
    return values


def number(word: str, where: str, missing: dict[str, float] | None = None) -> float:
    """A number of a text; NaN and infinities as they are written. Raises ValueError for what is none."""
    try:
        return float(word)
    except ValueError:
        if missing and word.strip().lower() in missing:
            return missing[word.strip().lower()]
        raise ValueError(f"{where}: {short(word)!r}: must be a number") from None


def whole_number(word: str, where: str, least: int, most: int) -> int:
    """A whole number of a text in a range. Raises ValueError for what is none."""
    try:
        value = int(word) if len(word) < 20 else most + 1
    except ValueError:
        raise ValueError(f"{where}: {short(word)!r}: must be a whole number") from None
    if not least <= value <= most:
        raise ValueError(f"{where}: {short(word)}: must be {least} to {most}")
    return value
