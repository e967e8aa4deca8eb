"""Power laws through measured points."""

from __future__ import annotations

import math

import numpy as np


def fit_exponent(sizes, values: np.ndarray) -> dict[str, float]:
    """Exponent of value ~ size^exponent, by least squares on logarithms, with its standard error.

    sizes: [n], at least two different ones. values: [n, rounds]. The exponent is fitted to the rounds' medians. Its
    standard error is the larger of two: from the residuals of the n medians, which needs n >= 3, and from the scatter
    of the single rounds' exponents, which needs two rounds. It is NaN if neither is possible.
    Raises ValueError for other shapes, or for values without a logarithm.
    """
    sizes, values = np.asarray(sizes, float), np.asarray(values, float)
    if len(set(sizes)) < 2 or values.shape[:1] != sizes.shape or values.ndim != 2:
        raise ValueError(f"values {values.shape} at sizes {sizes}: must be [n, rounds] at two sizes or more")
    if not (np.all(sizes > 0) and np.all(values > 0)):
        raise ValueError("sizes and values: must be above 0 to have a logarithm")
    x, y, errors = np.log(sizes), np.log(np.median(values, 1)), []
    if len(sizes) > 2:
        errors.append(math.sqrt(np.polyfit(x, y, 1, cov=True)[1][0, 0]))
    if values.shape[1] > 1:
        single = np.polyfit(x, np.log(values), 1)[0]
        errors.append(np.std(single, ddof=1) / math.sqrt(len(single)))
    return {"exponent": float(np.polyfit(x, y, 1)[0]), "standard_error": float(max(errors, default=math.nan))}
