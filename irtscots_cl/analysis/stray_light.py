"""The effect of ghosts and scattered light on a measurement: the same rays are measured with and without them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.maths.statistics import Estimate, jackknife_error
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.optics.setup import Setup
from irtscots_cl.tracing.results.paths import KINDS, PathLight


@dataclass(frozen=True)
class StrayLight:
    """Light of one kind of path: its share of the direct light, and the height error that it adds.

    height_nm: rms over the pixels that are usable both with and without this light, without piston and tilt; its
    standard error comes from the jackknife. height_mm: the map [rows, columns], NaN for other pixels; height_error_mm:
    its standard error. lost: [rows, columns] pixels whose light curves become unusable because of it.
    """

    kind: str
    of_direct: float
    height_nm: Estimate
    height_mm: np.ndarray = field(repr=False)
    height_error_mm: np.ndarray = field(repr=False)
    lost: np.ndarray = field(repr=False)

    @property
    def lost_pixels(self) -> int:
        return int(np.sum(self.lost))


def stray_light(light: PathLight, measure: str = "paper") -> tuple[StrayLight, ...]:
    """The effect of every kind of path, except the direct one, that brings light to the detector.

    Both measurements use the same rays, so their noise nearly cancels. measure: a name in methods.MEASURES. Raises the
    errors of measure_by.
    """
    pattern, nominal = LineScan(light.scene), Setup(light.scene.nominal())
    flux = {kind: sum(path.flux_w for path in light.paths if path.kind == kind) for kind in KINDS}
    alone, found = measure_by(measure, light.only("direct").images(pattern), nominal), []
    for kind in KINDS[1:]:
        if flux[kind] > 0:
            both = measure_by(measure, light.only("direct", kind).images(pattern), nominal)
            mask = alone.height_mask & both.height_mask
            added = np.where(mask, both.estimates("deviation_mm") - alone.estimates("deviation_mm"), np.nan)
            added = [remove_terms(alone.x_mm, alone.y_mm, height, mask, "piston_tilt") for height in added]
            values = np.array([1e6 * rms(height, mask) for height in added])
            height = Estimate(values[0], float(jackknife_error(values)))
            error, lost = jackknife_error(np.stack(added)), alone.mask & ~both.mask
            found.append(StrayLight(kind, flux[kind] / flux["direct"], height, added[0], error, lost))
    return tuple(found)
