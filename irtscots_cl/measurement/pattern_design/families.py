"""Families of fringe sets: which numbers of periods stand beside the highest one."""

from __future__ import annotations

from irtscots_cl.measurement.pattern_design.fringe_errors import Fringes

LOWEST = 0.9  # periods over the screen: its phase alone tells the place, with a margin at both ends
GEOMETRIC, BEATS = "geometric", "beats"
MOST_SERIES = 4
STEPS = (3, 4, 5, 6, 8, 12, 16)


def periods_of(family: str, series: int, highest: float) -> tuple[float, ...]:
    """Numbers of periods over the screen, rounded so that they can be typed, growing.

    geometric: by equal factors from LOWEST to the highest: each phase tells the order of the next one. beats: all but
    LOWEST are near the highest and so nearly as precise; the differences to it grow by equal factors from LOWEST, and
    their beats tell the orders (after Towers, Jones and Jones, Opt. Lett. 28, 887 (2003)).
    """
    if series == 1:
        return (float(f"{highest:.4g}"),)
    steps = [LOWEST * (highest / LOWEST) ** (k / (series - 1)) for k in range(series)]
    if family == BEATS:
        steps = [LOWEST, *(highest - step for step in reversed(steps[1:-1])), highest]
    return tuple(float(f"{p:.4g}") for p in steps)


def families(frames: int) -> list[Fringes]:
    """All kinds of sets that so many frames allow, with LOWEST in place of their numbers of periods."""
    found = []
    for series in range(1, MOST_SERIES + 1):
        kinds = (GEOMETRIC,) if series < 3 else (GEOMETRIC, BEATS)
        for steps in STEPS:
            if 2 * series * steps <= frames:
                found += [Fringes(kind, (LOWEST,) * series, steps) for kind in kinds]
    return found
