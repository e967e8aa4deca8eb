"""Results and images as xarray's Dataset, where xarray is installed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.measurement.reconstruction import Reconstruction

if TYPE_CHECKING:
    import xarray


def to_xarray(shown: Reconstruction | ImageStack) -> xarray.Dataset:
    """A result's maps over row and column, with the mirror's x and y [mm] as coordinates without NaN; or both scans'
    images, [line, row, column] over the lines' places in mm.

    Names and units are those of result.h5; each variable has the attribute "units". Whole images take lines x rows x
    columns x 8 bytes. Raises ImportError without xarray, TypeError for other objects.
    """
    try:
        import xarray
    except ImportError:
        raise ImportError("to_xarray needs xarray: pip install 'irtscots-cl[notebook]'") from None
    if isinstance(shown, Reconstruction):
        return xarray.Dataset(_maps(shown), _points(shown), {"scene": shown.nominal.to_toml()})
    if isinstance(shown, ImageStack):
        return xarray.Dataset(
            {f"images_{scan.axis}": ((f"line_{scan.axis}_mm", "row", "column"),
                                     np.stack([scan.image(k) for k in range(len(scan.positions_mm))]),
                                     {"units": scan.unit}) for scan in (shown.x, shown.y)},
            {f"line_{scan.axis}_mm": (f"line_{scan.axis}_mm", scan.positions_mm, {"units": "mm"})
             for scan in (shown.x, shown.y)},
        )  # fmt: skip
    raise TypeError(f"{type(shown).__name__}: must be a result of reconstruct, or an image stack")


def _points(result: Reconstruction) -> dict[str, Any]:
    x, y = result.grid_mm()
    return {name: (("row", "column"), values, {"units": "mm"}) for name, values in (("x_mm", x), ("y_mm", y))}


def _maps(result: Reconstruction) -> dict[str, Any]:
    maps = {
        "height_mm": (result.height_mm, "mm"),
        "deviation_nm": (result.deviation_mm * 1e6, "nm"),
        "height_standard_error_nm": (result.height_standard_error_mm() * 1e6, "nm"),
        "slope_x_rad": (result.slope_x, "rad"),
        "slope_y_rad": (result.slope_y, "rad"),
        "centroid_x_mm": (result.centroid_x_mm, "mm"),
        "centroid_y_mm": (result.centroid_y_mm, "mm"),
        "mask": (result.mask, "1"),
        "flags": (result.flags, "1"),
    }
    return {name: (("row", "column"), values, {"units": unit}) for name, (values, unit) in maps.items()}
