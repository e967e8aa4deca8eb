"""What all maps have alike: colours, statistics in the title, axes in millimetres and in pixels, SI prefixes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.report.fiducial import MapFrame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIGNED, SEQUENTIAL, LIGHT = "RdBu_r", "cividis", "inferno"  # colours that all eyes tell apart; SIGNED: zero is white
OUTLIERS = 0.5  # percent of the pixels, noisy ones at the rim, that do not set the scale of a signed map
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p"), (1e-15, "f"), (1e-18, "a"))


def statistics_text(values: FloatArray, unit: str, signed: bool = True) -> str:
    """rms and PV of a map's known values; of a map that is not about zero, such as a height, rms about its mean."""
    known = values[np.isfinite(values)]
    if not known.size:
        return "no values"
    rms = float(np.sqrt(np.mean((known if signed else known - known.mean()) ** 2)))
    return f"rms {three(rms)} {unit}, PV {three(float(np.ptp(known)))} {unit}"


def three(value: float) -> str:
    """A number to three significant digits, zeros at its end included."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    power = math.floor(math.log10(float(f"{abs(value):.2e}")))
    return f"{value:.2e}" if not -4 < power < 6 else f"{value:.{max(0, 2 - power)}f}"


def signed_limit(maps: list[FloatArray]) -> float:
    """Largest value of the colours of maps about zero, but for outliers; 1 for maps of zeros."""
    found = [float(np.nanpercentile(np.abs(one), 100 - OUTLIERS)) for one in maps if np.isfinite(one).any()]
    return max(found, default=0.0) or 1.0


def magnified(values: FloatArray, limit: float) -> int:
    """The power of ten by which a map is to be multiplied so that three times its rms shows on colours up to limit."""
    known = values[np.isfinite(values)]
    own = 3 * float(np.sqrt(np.mean(known**2))) if known.size else 0.0
    return int(10 ** max(0, math.floor(math.log10(limit / own)))) if own > 0 else 1


def with_prefix(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit by which a flux in W up to the largest reads as a number from 1 to 1000; others as they are."""
    if unit != "W" or not 0 < largest < 1:
        return 1.0, unit
    size, prefix = next((one for one in PREFIXES if largest >= one[0]), PREFIXES[-1])
    return 1 / size, f"{prefix}{unit}"


def add_pixels(axes: Axes, frame: MapFrame) -> None:
    """Detector columns and rows along the top and the right side of a map whose own axes are the mirror's."""
    if "mm" not in frame.x_label:
        return
    left, right, bottom, top = frame.extent
    rows, columns = frame.cut
    for axis, low, high, cut, side, label in (
        ("x", left, right, columns, "top", "detector column"),
        ("y", bottom, top, rows, "right", "detector row"),
    ):
        scale = (cut.stop - cut.start) / (high - low)
        to = _line(scale, cut.start - 0.5 - low * scale)
        back = _line(1 / scale, low - (cut.start - 0.5) / scale)
        add: Any = axes.secondary_xaxis if axis == "x" else axes.secondary_yaxis
        other = add(side, functions=(to, back))
        _small(other, axis, label)


def add_millimetres(axes: Axes, frame: MapFrame | None) -> None:
    """The mirror's x and y along the top and the right side of an image on the detector's columns and rows."""
    if frame is None or "mm" not in frame.x_label:
        return
    left, right, bottom, top = frame.extent
    rows, columns = frame.cut
    for axis, low, high, cut, side in (("x", left, right, columns, "top"), ("y", bottom, top, rows, "right")):
        scale = (high - low) / (cut.stop - cut.start)
        to = _line(scale, low - (cut.start - 0.5) * scale)
        back = _line(1 / scale, cut.start - 0.5 - low / scale)
        add: Any = axes.secondary_xaxis if axis == "x" else axes.secondary_yaxis
        _small(add(side, functions=(to, back)), axis, f"mirror {axis} [mm]")


def _line(factor: float, start: float) -> Any:
    return lambda place: factor * np.asarray(place) + start


def _small(other: Any, axis: str, label: str) -> None:
    """A second axis in small letters, so that the first is read first."""
    (other.set_xlabel if axis == "x" else other.set_ylabel)(label, fontsize=7, labelpad=2)
    other.tick_params(labelsize=7, pad=1, length=2)
