"""One thing that a check of a scene has to say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["error", "warning", "info"]
LEVELS: tuple[Level, ...] = ("error", "warning", "info")


@dataclass(frozen=True)
class Finding:
    """code: a heading of docs/checks.md. level: error (the test as described cannot work), warning (it measures less or
    worse than it should), info (what to expect). text: one line with the numbers and what to change."""

    code: str
    level: Level
    text: str
