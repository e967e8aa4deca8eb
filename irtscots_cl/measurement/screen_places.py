"""From places on the screen, however they were found, to the mirror's surface: what line scans do with centroids."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.light_curves import Flag
from irtscots_cl.measurement.reconstruction import MIN_PIXELS, Reconstruction, design_points, reconstruction_of
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene

PLACES = "places"  # in the place of a light_curve


@dataclass(frozen=True)
class ScreenPlaces:
    """Places (u, v) on the screen's grid in mm, with standard errors: upright maps [rows, columns], NaN if unknown."""

    u_mm: FloatArray = field(repr=False)
    v_mm: FloatArray = field(repr=False)
    u_error_mm: FloatArray = field(repr=False)
    v_error_mm: FloatArray = field(repr=False)

    @property
    def known(self) -> BoolArray:
        """Pixels whose place is known, with a standard error above 0."""
        errors = np.minimum(self.u_error_mm, self.v_error_mm)
        found: BoolArray = np.isfinite(self.u_mm + self.v_mm + self.u_error_mm + self.v_error_mm) & (errors > 0)
        return found

    def without(self, pixels: BoolArray) -> ScreenPlaces:
        """The places of the other pixels than these [rows, columns]."""
        if not pixels.any():
            return self
        maps = (self.u_mm, self.v_mm, self.u_error_mm, self.v_error_mm)
        return ScreenPlaces(*(np.where(pixels, np.nan, values) for values in maps))


def surface_from_places(
    places: ScreenPlaces,
    nominal: Scene | Setup,
    *,
    method: str = "southwell",
    pixel_average: bool = True,
    min_coverage: float = 0.5,
    aperture: bool = True,
    mirror: BoolArray | None = None,
) -> Reconstruction:
    """Measure the surface from the places on the screen that the pixels see, and the design scene only.

    nominal, method, pixel_average, min_coverage: as of reconstruct. aperture: whether a pixel's place is the mean over
    the camera's aperture and the pixel; false: that of the centre's chief ray, for an aperture that is unknown.
    mirror: pixels [rows, columns] that see the mirror, for one that is no full disk. Raises ValueError if the maps do
    not have the detector's pixels or fewer than MIN_PIXELS of them can be used.
    """
    setup = Setup.of(nominal)
    check_pixels(places, setup)
    points, on_mirror = _design(setup, aperture, min_coverage)
    on_mirror = on_mirror if mirror is None else on_mirror & mirror
    mask = on_mirror & places.known
    if mask.sum() < MIN_PIXELS:
        raise ValueError(
            f"scene {setup.scene.name}: {mask.sum()} of the {on_mirror.sum()} detector pixels on the mirror see a "
            f"known place of the screen; must be at least {MIN_PIXELS}"
        )
    found = {
        "light_curve": PLACES,
        "flags": np.where(mask, Flag.GOOD, Flag.EMPTY),
        "place_errors_mm": (places.u_error_mm, places.v_error_mm),
    }
    centroid = tuple(np.where(mask, place, np.nan)[None] for place in (places.u_mm, places.v_mm))
    return reconstruction_of(setup, points, on_mirror, mask, (centroid[0], centroid[1]), method, pixel_average, **found)


def check_pixels(places: ScreenPlaces, setup: Setup) -> None:
    """Raise ValueError if the maps do not have the detector's pixels."""
    wanted, found = setup.chief_rays.shape, places.u_mm.shape
    if found != wanted:
        raise ValueError(
            f"scene {setup.scene.name}: camera.detector.pixels = {list(wanted[::-1])}: the images have "
            f"{list(found[::-1])} (columns, rows)"
        )


def _design(setup: Setup, aperture: bool, min_coverage: float) -> tuple[list[FloatArray], BoolArray]:
    """Mirror point x, y and screen place u, v [rows, columns] of each pixel, were the mirror the design; and the pixels
    that see enough of the mirror."""
    chief = setup.chief_rays
    if aperture:
        return design_points(setup), chief.footprint.coverage >= min_coverage
    rows, columns = chief.shape
    points, u_mm, v_mm = chief.reverse(*np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    x_mm, y_mm = points[..., 0], points[..., 1]
    with np.errstate(invalid="ignore"):
        return [x_mm, y_mm, u_mm, v_mm], chief.surface.contains(x_mm, y_mm)
