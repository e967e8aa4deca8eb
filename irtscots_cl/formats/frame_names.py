"""What the numbers in the names of a series of files tell: which are missing, and which names are not of the series."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

MOST_MISSING = 1.0  # times as many as there are: more are no gaps but numbers with another meaning, as times of day
_NUMBER = re.compile(r"[0-9]+")


@dataclass(frozen=True)
class NameGaps:
    """missing: names that the others' numbers ask for, each with its place in the natural order of all names, those
    missing included. odd: names of another form than most. first: the least number, None where none counts."""

    missing: tuple[tuple[int, str], ...] = ()
    odd: tuple[str, ...] = ()
    first: int | None = None


def name_gaps(names: Sequence[str]) -> NameGaps:
    """The gaps of names such as IMG_1.tif, IMG_2.tif, IMG_4.tif, or x_1_3.tif, where every first number has the same
    second ones. Numbers that do not count one by one tell nothing."""
    forms: dict[str, list[str]] = defaultdict(list)
    for name in names:
        forms[_NUMBER.sub("#", name)].append(name)
    if not forms:
        return NameGaps()
    form, own = max(forms.items(), key=lambda item: len(item[1]))
    if len(own) < 3 or 2 * len(own) <= len(names):
        return NameGaps()
    odd = tuple(name for name in names if _NUMBER.sub("#", name) != form)
    texts = {name: tuple(_NUMBER.findall(name)) for name in own}
    rows = [tuple(map(int, text)) for text in texts.values()]
    varying = [k for k in range(len(rows[0])) if len({row[k] for row in rows}) > 1]
    if not varying or len(set(rows)) < len(rows):
        return NameGaps(odd=odd)
    lost = _counter_gaps(rows, varying)
    counter = lost is not None
    if lost is None:
        lost = _table_gaps(rows, varying)
    if lost is None or len(lost) > MOST_MISSING * len(rows):
        return NameGaps(odd=odd)
    places = {row: k for k, row in enumerate(sorted([*rows, *lost]))}
    widths = [{len(text[k]) for text in texts.values()} for k in range(len(rows[0]))]
    missing = [(places[row], _name(form, row, widths)) for row in sorted(lost)]
    first = min(row[varying[-1]] for row in rows) if counter else None
    return NameGaps(tuple(missing), odd, first)


def _counter_gaps(rows: list[tuple[int, ...]], varying: list[int]) -> list[tuple[int, ...]] | None:
    """Rows that are missing where one number alone counts the names; None where none does."""
    for k in varying if len(varying) == 1 else ():
        values = sorted(row[k] for row in rows)
        steps = Counter(b - a for a, b in pairwise(values))
        step, times = steps.most_common(1)[0]
        if 2 * times < len(values) - 1 or any(own % step for own in steps):
            return None
        if (values[-1] - values[0]) // step + 1 > (1 + MOST_MISSING) * len(values):
            return None
        lost = set(range(values[0], values[-1] + 1, step)) - set(values)
        return [(*rows[0][:k], value, *rows[0][k + 1 :]) for value in sorted(lost)]
    return None


def _table_gaps(rows: list[tuple[int, ...]], varying: list[int]) -> list[tuple[int, ...]] | None:
    """Rows that are missing where half or more of those before it have every value of the last number."""
    last = varying[-1]
    groups: dict[tuple[int, ...], set[int]] = defaultdict(set)
    for row in rows:
        groups[(*row[:last], *row[last + 1 :])].add(row[last])
    common = Counter(value for values in groups.values() for value in values)
    wanted = {value for value, times in common.items() if 2 * times >= len(groups)}
    if len(groups) < 2 or len(wanted) < 2 or not set(common) <= wanted:
        return None
    return [(*key[:last], value, *key[last:]) for key, values in groups.items() for value in sorted(wanted - values)]


def _name(form: str, row: tuple[int, ...], widths: list[set[int]]) -> str:
    """A name of the form with the numbers, filled with zeros where all names have one width."""
    parts = form.split("#")
    numbers = [
        f"{value:0{min(width)}d}" if len(width) == 1 else str(value) for value, width in zip(row, widths, strict=True)
    ]
    return parts[0] + "".join(number + part for number, part in zip(numbers, parts[1:], strict=True))
