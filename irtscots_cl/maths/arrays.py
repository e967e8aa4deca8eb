"""Short names for the types of arrays. Their shapes stand in the docstrings."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.integer[Any]]  # of any width
BoolArray = NDArray[np.bool_]
