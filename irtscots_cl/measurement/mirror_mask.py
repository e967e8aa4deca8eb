"""The pixels that see the mirror, from how bright the fringes are in them."""

from __future__ import annotations

import numpy as np
from skimage.filters import threshold_minimum, threshold_otsu
from skimage.measure import label

from irtscots_cl.maths.arrays import BoolArray, FloatArray

EVEN = 0.5  # mean below the threshold over that above it, from which on there is no dark surrounding
MIN_PIXELS = 16
BINS = 256


def mirror_mask(signal: FloatArray, largest: bool = True) -> BoolArray:
    """The largest bright region [rows, columns] of a signal [rows, columns], such as the fringes' amplitude.

    largest: false for all bright regions, where the design tells which of them are the mirror.

    The threshold lies in the valley of the histogram, or, where that has no two peaks, where it parts the values best
    (Otsu). Holes stay holes. All pixels with a signal where there is no dark surrounding. Raises ValueError for a
    signal without any bright region.
    """
    known = np.isfinite(signal)
    values = signal[known]
    if values.size < MIN_PIXELS or not values.max() > 0:
        raise ValueError("mask: no pixel sees fringes: the images do not change from frame to frame")
    # a few extreme values would leave the histogram with empty bins only
    low, high = np.percentile(values, [0.5, 99.5])
    clipped = np.clip(values, low, high)
    if high > low:
        threshold = _valley(clipped)
        below, above = clipped[clipped <= threshold], clipped[clipped > threshold]
        if below.size and above.size and below.mean() < EVEN * above.mean():
            return _chosen(known & (np.nan_to_num(signal) > threshold), largest)
    return _chosen(known & (np.nan_to_num(signal) > 0), largest)


def _chosen(bright: BoolArray, largest: bool) -> BoolArray:
    region = largest_region(bright)  # raises ValueError where there is none
    return region if largest else bright


def _valley(values: FloatArray) -> float:
    try:
        return float(threshold_minimum(values, nbins=BINS))
    except RuntimeError:  # no two peaks
        return float(threshold_otsu(values, nbins=BINS))


def largest_region(mask: BoolArray) -> BoolArray:
    """The largest connected region of a mask, over edges. Raises ValueError for fewer than MIN_PIXELS pixels."""
    numbers = label(mask, connectivity=1)
    sizes = np.bincount(numbers.ravel())
    sizes[0] = 0
    largest = int(sizes.argmax())
    if sizes[largest] < MIN_PIXELS:
        raise ValueError(f"mask: the largest bright region has {sizes[largest]} pixels; must have {MIN_PIXELS} or more")
    region: BoolArray = numbers == largest
    return region
