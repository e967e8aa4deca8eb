"""Drawings of a page as SVG: bars of Zernike terms and error parts, the ledger of rays, the deviation's spectrum."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from irtscots_cl.maths.map_spectrum import radial_psd
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.table import Table

WIDE, BAR, GAP, LABEL = 520, 16, 6, 214  # narrow, so that letters stay readable on phones
IN, OUT, ERROR = "#8a8a8a", "#0b6e99", "#222222"


@dataclass(frozen=True)
class Drawing:
    """A drawing of a page, left out where its svg is empty. table: the same in numbers, beside it; such drawings come
    first."""

    name: str
    svg: str
    caption: str
    table: Table | None = None


def bar_chart(title: str, rows: Sequence[tuple[str, float, float]], unit: str) -> str:
    """Horizontal bars of (name, value, standard error or NaN); all values from 0 up, to the decimals of the largest."""
    most = max((value for _, value, _ in rows if math.isfinite(value)), default=0.0) or 1.0
    decimals = max(2 - math.floor(math.log10(most)), 0)
    parts = []
    for k, (name, value, error) in enumerate(rows):
        y = k * (BAR + GAP) + GAP
        known = math.isfinite(value)
        length = (WIDE - LABEL - 120) * (value / most if known else 0.0)
        spread = f" ± {error:.{decimals}f}" if math.isfinite(error) else ""
        text = f"{value:.{decimals}f}{spread} {unit}" if known else "not known"
        parts.append(_label(name, y) + _bar(LABEL, y, length, OUT) + _text(LABEL + length + 6, y, text))
    return _svg(title, parts, len(rows))


def zernike_chart(rows: Sequence[tuple[str, float | None, float, float]]) -> str:
    """Bars on both sides of zero of (name, put in or None, measured, standard error), in µm."""
    values = [abs(v) for _, given, out, _ in rows for v in (given or 0.0, out) if math.isfinite(v)]
    most, half = max(values, default=0.0) or 1.0, (WIDE - LABEL - 150) / 2
    middle, parts = LABEL + half, []
    for k, (name, given, out, error) in enumerate(rows):
        y = k * (BAR + GAP) + GAP
        if given is not None:
            parts.append(_signed_bar(middle, y, half * given / most, BAR / 2, IN))
        if math.isfinite(out):
            below = BAR / 2 if given is not None else 0
            parts.append(_signed_bar(middle, y + below, half * out / most, BAR - below, OUT))
            if math.isfinite(error):
                low, high = (middle + half * (out + sign * error) / most for sign in (-1, 1))
                at = y + below + (BAR - below) / 2
                parts.append(f'<path d="M{low:.1f} {at:.1f}H{high:.1f}" stroke="{ERROR}" stroke-width="1.5"/>')
        text = f"{out:+.5f}" + (f" ± {error:.5f}" if math.isfinite(error) else "") if math.isfinite(out) else "-"
        parts.append(_label(name, y) + _text(middle + half + 8, y, text))
    parts.append(f'<path d="M{middle:.1f} 0V{len(rows) * (BAR + GAP) + GAP}" stroke="#222"/>')
    return _svg("Zernike coefficients in µm", parts, len(rows))


def ledger_flow(ledger: dict[str, int]) -> str:
    """Where the launched rays went, as a flow from left to right whose widths are shares."""
    launched = max(ledger["launched"], 1)
    ends = [(name, count) for name, count in ledger.items() if name != "launched" and count]
    height, top, parts, y_in = 200.0, 10.0, [], 10.0
    gap, y_out = 26.0, 10.0
    for k, (name, count) in enumerate(sorted(ends, key=lambda end: -end[1])):
        thick = max(height * count / launched, 1.0)
        colour = OUT if name == "detected" else ("#8a8a8a", "#b2772e", "#6f5a9e", "#5d8a3a")[k % 4]
        a, b = y_in + thick / 2, y_out + thick / 2
        parts.append(f'<path d="M100 {a:.1f}C210 {a:.1f} 180 {b:.1f} 285 {b:.1f}" fill="none" stroke="{colour}" '
                     f'stroke-opacity="0.75" stroke-width="{thick:.1f}"/>')  # fmt: skip
        text = f"{name.replace('_', ' ')} {count:,} ({count / launched:.2%})"
        parts.append(f'<text x="293" y="{b + 5:.1f}">{escape(text)}</text>')
        y_in, y_out = y_in + thick, y_out + max(thick, 0.0) + gap
    parts.append(f'<rect x="88" y="{top}" width="12" height="{height}" fill="#222"/>')
    parts.append(f'<text x="82" y="{top + height / 2:.0f}" text-anchor="end">launched</text>')
    parts.append(f'<text x="82" y="{top + height / 2 + 18:.0f}" text-anchor="end">{launched:,}</text>')
    return _frame("Where the rays went", parts, max(y_out, top + height) + 10)


def spectrum_chart(result: Reconstruction) -> str:
    """Power spectral density of the deviation against the frequency on the mirror; "" for too few pixels."""
    pitch = [_pitch(values, axis) for values, axis in ((result.x_mm, 1), (result.y_mm, 0))]
    heights = np.where(result.height_mask, result.levelled(result.deviation_mm), np.nan)
    rows, columns = np.nonzero(np.isfinite(heights))
    if min(np.ptp(rows), np.ptp(columns)) < 16 or not all(math.isfinite(p) and p > 0 for p in pitch):
        return ""
    psd = radial_psd(heights, (pitch[0], pitch[1]))
    good = psd.psd_mm4 > 0
    x, y = np.log10(psd.frequency_per_mm[good]), np.log10(psd.psd_mm4[good] * 1e12)
    if len(x) < 3:
        return ""
    left, right, top, bottom = 66, WIDE - 20, 14, 240
    across = left + (x - x.min()) / (x.max() - x.min()) * (right - left)
    down = bottom - (y - y.min()) / ((y.max() - y.min()) or 1.0) * (bottom - top)
    way = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(across, down, strict=True))
    parts = [f'<path d="{way}" fill="none" stroke="{OUT}" stroke-width="2"/>',
             f'<path d="M{left} {top}V{bottom}H{right}" fill="none" stroke="#222"/>']  # fmt: skip
    for at, value in ((left, x.min()), (right, x.max())):
        anchor = "start" if at == left else "end"
        parts.append(f'<text x="{at}" y="{bottom + 18}" text-anchor="{anchor}">{10**value:.2g} / mm</text>')
    for at, value in ((bottom, y.min()), (top + 10, y.max())):
        parts.append(f'<text x="{left - 6}" y="{at}" text-anchor="end">{10**value:.1e}</text>')
    parts.append(f'<text x="{(left + right) / 2:.0f}" y="{bottom + 18}" text-anchor="middle">frequency</text>')
    return _frame("Power spectral density of the deviation in nm² mm², mean over directions", parts, bottom + 30)


def _pitch(values: np.ndarray, axis: int) -> float:
    steps = np.abs(np.diff(values, axis=axis))
    return float(np.nanmedian(steps)) if np.isfinite(steps).any() else math.nan


def _label(name: str, y: float) -> str:
    return f'<text x="{LABEL - 8}" y="{y + BAR - 3:.1f}" text-anchor="end">{escape(name)}</text>'


def _text(x: float, y: float, text: str) -> str:
    signed = escape(text).replace("-", "\N{MINUS SIGN}")
    return f'<text x="{x:.1f}" y="{y + BAR - 3:.1f}">{signed}</text>'


def _bar(x: float, y: float, length: float, colour: str) -> str:
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{max(length, 0.5):.1f}" height="{BAR}" fill="{colour}"/>'


def _signed_bar(middle: float, y: float, length: float, thick: float, colour: str) -> str:
    x = min(middle, middle + length)
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{abs(length):.1f}" height="{thick:.1f}" fill="{colour}"/>'


def _svg(title: str, parts: list[str], rows: int) -> str:
    return _frame(title, parts, rows * (BAR + GAP) + 2 * GAP)


def _frame(title: str, parts: list[str], high: float) -> str:
    inside = f"<title>{escape(title)}</title>{''.join(parts)}"
    return f'<svg viewBox="0 0 {WIDE} {high:.0f}" role="img" aria-label="{escape(title)}">{inside}</svg>'
