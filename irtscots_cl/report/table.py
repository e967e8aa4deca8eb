"""A table of strings, for the terminal and the HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """A titled table of strings."""

    title: str
    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
