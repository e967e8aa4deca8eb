"""The instrument transfer function of a scene, and a measured map's spectrum corrected by it."""

from __future__ import annotations

from pathlib import Path

from irtscots_cl.formats.height_map import MapOptions
from irtscots_cl.formats.maps import open_map
from irtscots_cl.formats.result_map import is_result, read_result_grid
from irtscots_cl.maths.low_order import TERMS
from irtscots_cl.measurement.transfer_spectrum import MeasuredMap, window_leak

UNEVEN = 0.05  # of the distances of pixels, beyond which a frequency of theirs is none of the mirror


def read_measured_map(path: Path, options: MapOptions) -> tuple[MeasuredMap, list[str]]:
    """A map whose spectrum is to be corrected, and warnings. result.h5 is taken on the grid of its pixels.

    Raises ValueError, with one line, for what cannot be read or has no lateral scale.
    """
    if is_result(path):
        grid = read_result_grid(path)
        warnings = []
        if grid.uneven > UNEVEN:
            warnings.append(
                f"{path}: a tenth of the pixels' distances differ by more than {100 * grid.uneven:.2g} % from the "
                "others: so do the frequencies"
            )
        found = MeasuredMap(grid.heights_mm, grid.column_mm, grid.row_mm, True, grid.height_error_mm, grid.slope_errors)
        return found, warnings
    one = open_map(path, options)
    if one.pitch_mm is None:
        raise ValueError(f"{path}: a spectrum needs the lateral scale, which the file does not tell: give --pitch-mm")
    one = one.as_kind("surface")
    warnings = [f"{path}: {text}" for text in one.warnings]
    warnings.append(f"{path}: taken as sampled by the camera's pixels: what a change of its grid did is not known")
    return MeasuredMap(one.heights_mm, (one.pitch_mm[0], 0.0), (0.0, one.pitch_mm[1])), warnings


def doubts_of_low_orders(path: Path, measured: MeasuredMap, removed: str) -> list[str]:
    """A warning where power and astigmatism, left in a map, leak into its spectrum. removed: of low_order.TERMS.

    Raises ValueError, with one line, for other terms.
    """
    if removed not in TERMS:
        raise ValueError(f"--remove = {removed}: must be one of {', '.join(TERMS)}")
    leak = window_leak(measured, removed)
    if leak.leaked == 0:
        return []
    return [
        f"{path}: low orders of {leak.low_mm * 1e6:.3g} nm rms leak through the window, which ends at the map's rim, "
        f"into {leak.leaked} of {leak.rings} frequencies: --remove {TERMS[-1]} takes power and astigmatism out"
    ]
