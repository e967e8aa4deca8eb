"""The map of a measured surface on an even grid, to be written as a file of any format."""

from __future__ import annotations

from irtscots_cl.formats.height_map import HeightMap, MapOptions
from irtscots_cl.formats.result_map import DEVIATION, HEIGHT, map_of_pixels
from irtscots_cl.measurement.error_bars import ErrorBars
from irtscots_cl.measurement.reconstruction import Reconstruction


def height_map(result: Reconstruction, quantity: str = DEVIATION, bars: ErrorBars | None = None) -> HeightMap:
    """The deviation of a measured surface from the design as a map of square pixels, which `write_map` writes.

    quantity: "deviation" (along z, positive towards the camera), "height" (design and deviation) or "standard-error"
    (of the height: of bars, or else the scatter of the replicates). The values are interpolated from the pixels' mirror
    points to a grid of their median distance; the map's warnings tell by how much that may change them. NaN where no
    pixel of the largest group of joined islands is near. The same map is that of `irtscots convert result.h5`.

    Raises ValueError for another quantity, and for too few pixels with a value.
    """
    options = MapOptions(quantity=quantity)
    if quantity == DEVIATION:
        values = result.deviation_mm
    elif quantity == HEIGHT:
        values = result.height_mm
    else:
        values = bars.height_mm if bars else result.height_standard_error_mm()
    groups = result.height_mask.astype(float)
    groups[~result.height_mask] = 2
    return map_of_pixels("result", result.x_mm, result.y_mm, values, groups, options)
