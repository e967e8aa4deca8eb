"""Cases: light curves that cannot be used. Each must be flagged; none may silently become a number."""

from __future__ import annotations

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.measurement.centroids import centroids
from irtscots_cl.measurement.light_curves import Flag, flag_curves
from irtscots_cl.stability.checks import Bench, Case, Finding, Limit, count, finding

LINES, PITCH_MM = 41, 0.2
HALF_WIDTH_MM = 0.7  # of the curves; the geometry allows light this far from the centroid
LIMIT_W = 0.9
POSITIONS_MM = (np.arange(LINES) - (LINES - 1) / 2) * PITCH_MM
EXACT = Limit(1e-12, "mm", "rounding of a mean of a few lines")


def _bell(middle_mm: float, height: float = 0.8) -> np.ndarray:
    """A raised cosine over the lines: its centroid is its middle, also after sampling by lines."""
    phase = np.clip((POSITIONS_MM - middle_mm) / HALF_WIDTH_MM, -1, 1)
    return height * np.cos(np.pi / 2 * phase) ** 2


def _curves() -> dict[str, tuple[np.ndarray, Flag]]:
    edge = POSITIONS_MM[-1] + PITCH_MM / 2
    lone = np.where(np.arange(LINES) == 25, 0.5, 0.0)
    return {
        "good": (_bell(0.0), Flag.GOOD),
        "good, just inside the screen": (_bell(edge - HALF_WIDTH_MM), Flag.GOOD),
        "good, one line alone": (lone, Flag.GOOD),
        "good, as faint as 1e-300 W": (_bell(1.0, 1e-300), Flag.GOOD),
        "empty": (np.zeros(LINES), Flag.EMPTY),
        "negative after a background was taken off": (-_bell(0.0), Flag.EMPTY),
        "clipped by half at the screen's edge": (_bell(edge), Flag.CLIPPED),
        "clipped by a line": (_bell(edge - HALF_WIDTH_MM + PITCH_MM), Flag.CLIPPED),
        "clipped at the other edge": (_bell(-edge + 0.3), Flag.CLIPPED),
        "double-peaked": (_bell(-2.0) + _bell(1.5), Flag.STRAY),
        "a second peak of a fifth": (_bell(-1.0) + _bell(2.0, 0.2), Flag.STRAY),
        "light everywhere": (np.full(LINES, 0.1), Flag.STRAY),
        "saturated": (np.minimum(_bell(0.5, 2.0), LIMIT_W), Flag.SATURATED),
        "saturated in one sample": (_bell(0.0, LIMIT_W), Flag.SATURATED),
        "saturated and clipped": (np.minimum(_bell(edge - 0.3, 2.0), LIMIT_W), Flag.SATURATED),
    }


def _flags(bench: Bench) -> list[Finding]:
    """Check all curves, as the pixels of one detector."""
    curves = _curves()
    images = np.stack([curve for curve, _ in curves.values()], -1)[:, None, :]  # [lines, 1 row, columns]
    scan = ImageStack(*(Scan.from_images(axis, POSITIONS_MM, images) for axis in "xy")).saturating_at(LIMIT_W).x
    found = centroids(scan, scan.mean_w())
    reach = np.full(len(curves), HALF_WIDTH_MM)
    flags = flag_curves(scan, scan.mean_w(), found, reach)
    findings = [
        count(name, int(flags[k] != expected), 1, f"{expected.name.lower()}: what its centroid is worth")
        for k, (name, (_, expected)) in enumerate(curves.items())
    ]
    middles = {"good": 0.0, "good, one line alone": POSITIONS_MM[25], "good, as faint as 1e-300 W": 1.0}
    errors = [found[list(curves).index(name)] - middle for name, middle in middles.items()]
    return [*findings, finding("centroids of good curves", errors, EXACT)]


CASES = (Case("light curves", "flags of curves good and bad", _flags, on_host=True),)
