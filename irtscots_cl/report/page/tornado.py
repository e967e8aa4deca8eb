"""The tornado chart of an error budget as SVG: what each source costs, the largest at the top, coloured by its kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from irtscots_cl.report.page.drawings import BAR, GAP, WIDE
from irtscots_cl.report.table import Table

LABEL, ROOM = 190, 130  # for names on the left, for numbers on the right
MOST_BARS = 30
# of the kinds of sources: colours that all eyes tell apart (Okabe, Ito), by their names in budget/source.py
COLOURS = {"parameter": "#0072b2", "constant": "#7f7f7f", "fixed pattern": "#b36b00", "process": "#00795a"}


@dataclass(frozen=True)
class Cost:
    """nm: rms height error, piston and tilt removed. share: its square over the sum of all squares; None: not asked."""

    source: str
    kind: str
    nm: float
    share: float | None = None

    @property
    def text(self) -> str:
        """Number and share."""
        return f"{_nm(self.nm)} nm" + ("" if self.share is None else f" ({100 * self.share:.1f} %)")


def tornado_chart(costs: Sequence[Cost]) -> str:
    """Bars of costs in their order, the first MOST_BARS, with a key of the kinds that are among them."""
    shown = costs[:MOST_BARS]
    most = max((cost.nm for cost in shown), default=0.0) or 1.0
    parts, x = [], 0.0
    for kind in COLOURS:
        if any(cost.kind == kind for cost in shown):
            parts.append(f'<rect x="{x:.0f}" y="4" width="12" height="12" fill="{COLOURS[kind]}"/>')
            parts.append(f'<text x="{x + 17:.0f}" y="15">{kind}</text>')
            x += 40 + 7.5 * len(kind)
    for k, cost in enumerate(shown):
        y = 26 + k * (BAR + GAP)
        length = max((WIDE - LABEL - ROOM) * cost.nm / most, 0.5)
        parts.append(f'<text x="{LABEL - 8}" y="{y + BAR - 3}" text-anchor="end">{escape(cost.source)}</text>')
        parts.append(f'<rect x="{LABEL}" y="{y}" width="{length:.1f}" height="{BAR}" fill="{COLOURS[cost.kind]}"/>')
        parts.append(f'<text x="{LABEL + length + 6:.1f}" y="{y + BAR - 3}">{escape(cost.text)}</text>')
    high = 30 + len(shown) * (BAR + GAP)
    title = "Height error of each source in nm rms, piston and tilt removed, the largest at the top"
    inside = f"<title>{title}</title>{''.join(parts)}"
    return f'<svg viewBox="0 0 {WIDE} {high}" role="img" aria-label="{title}">{inside}</svg>'


def tornado_table(costs: Sequence[Cost]) -> Table:
    """All costs as numbers, with as many decimals in each row."""
    with_shares = any(cost.share is not None for cost in costs)
    rows = [
        (cost.source, cost.kind, _nm(cost.nm), *([f"{100 * cost.share:.1f}"] if cost.share is not None else []))
        for cost in costs
    ]
    return Table("The same in numbers", ("source", "kind", "[nm rms]", *(["share [%]"] if with_shares else [])), rows)


def _nm(value: float) -> str:
    return f"{value:,.2f}"
