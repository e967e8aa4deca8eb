"""Piston, tilt, power and astigmatism of height maps: removal of these terms, and rms over a mask."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irtscots_cl.system import interruption

TERMS = ("none", "piston", "piston_tilt", "piston_tilt_power", "piston_tilt_power_astigmatism")


def remove_terms(
    x_mm: ArrayLike, y_mm: ArrayLike, z: ArrayLike, mask: ArrayLike, terms: str, groups: ArrayLike | None = None
) -> NDArray[np.float64]:
    """``z`` without its least-squares fit of the named low-order terms, in the unit of ``z``.

    "none" removes nothing, "piston" 1, "piston_tilt" 1, x, y, "piston_tilt_power" 1, x, y, x^2 + y^2 and
    "piston_tilt_power_astigmatism" x^2 - y^2 and x y as well. All arrays are [rows, columns]. The fit runs over the
    samples inside the mask whose z is finite; the others are NaN in the result. groups: int [rows, columns], parts of
    the mask with a piston of their own; tilt, power and astigmatism are common to all.

    Raises ValueError for unknown terms, a shape that does not match, an empty or non-boolean mask, fewer
    samples than terms, or a position that is not finite where a sample is used.
    """
    if terms not in TERMS:
        raise ValueError(f"unknown terms {terms!r}; allowed: {', '.join(TERMS)}")
    interruption.check()
    z, used = _samples(z, mask)
    result = np.where(used, z, np.nan)
    count = (0, 1, 3, 4, 6)[TERMS.index(terms)]
    if np.count_nonzero(used) < count:
        raise ValueError(f"{count} terms cannot be fitted to {np.count_nonzero(used)} samples")
    x, y = _centred(x_mm, "x_mm", used), _centred(y_mm, "y_mm", used)
    if count:
        # x and y share their scale, so x^2 + y^2 differs from power only by tilt and piston, removed with it.
        scale = max(np.abs(x).max(), np.abs(y).max()) or 1.0
        x, y = x / scale, y / scale
        basis = np.stack([np.ones_like(x), x, y, x * x + y * y, x * x - y * y, x * y], axis=1)[:, :count]
        if groups is None:
            result[used] -= basis @ np.linalg.lstsq(basis, z[used])[0]
        else:
            group = np.unique(np.asarray(groups)[used], return_inverse=True)[1]
            basis, left = (v - _means(v, group) for v in (basis[:, 1:], z[used][:, None]))
            result[used] = (left - basis @ np.linalg.lstsq(basis, left)[0])[:, 0]
    return result


def rms(z: ArrayLike, mask: ArrayLike) -> float:
    """Root mean square of ``z`` over its finite samples inside ``mask``, both [rows, columns]; unit of ``z``.

    Nothing is removed first, not even the mean: see `remove_terms`. Raises ValueError if no sample is left,
    or for an empty or non-boolean mask.
    """
    z, used = _samples(z, mask)
    if not used.any():
        raise ValueError("no finite sample inside the mask")
    return float(np.sqrt(np.mean(z[used] ** 2)))


def _means(values: NDArray[np.float64], group: NDArray[np.intp]) -> NDArray[np.float64]:
    """Mean [samples, columns] of the values [samples, columns] of a sample's group."""
    sums = np.stack([np.bincount(group, column) for column in values.T], axis=-1) if values.size else values
    means: NDArray[np.float64] = (sums / np.bincount(group)[:, None])[group] if values.size else values
    return means


def checked_mask(mask: ArrayLike) -> NDArray[np.bool_]:
    mask = np.asarray(mask)
    if mask.ndim != 2 or mask.dtype != np.bool_:
        raise ValueError(f"mask must be boolean [rows, columns], got {mask.dtype} of shape {mask.shape}")
    if not mask.any():
        raise ValueError("mask is empty: no node to integrate over")
    return mask


def _samples(z: ArrayLike, mask: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    z, mask = np.asarray(z, dtype=np.float64), checked_mask(mask)
    if z.shape != mask.shape:
        raise ValueError(f"z has shape {z.shape}, expected {mask.shape} for this mask")
    return z, mask & np.isfinite(z)


def _centred(position: ArrayLike, name: str, used: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Used positions minus their mean: centred columns keep the fit well conditioned."""
    position = np.asarray(position, dtype=np.float64)
    if position.shape != used.shape:
        raise ValueError(f"{name} has shape {position.shape}, expected {used.shape} for this mask")
    position = position[used]
    bad = position.size - np.count_nonzero(np.isfinite(position))
    if bad:
        raise ValueError(f"{name} is not finite at {bad} of {position.size} points inside the mask")
    return position - position.mean() if position.size else position
