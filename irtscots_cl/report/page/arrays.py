"""Arrays in a page: compressed bytes as text, which report.js unpacks."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np

LEVEL = 6


def packed(values: np.ndarray) -> dict[str, Any]:
    """An array as JSON: shape, type and its bytes, byte k of all numbers together (which compresses better), deflated.

    Real numbers become single precision, whole ones 32 bits with a sign.
    """
    kind = "float32" if np.issubdtype(values.dtype, np.floating) else "int32"
    raw = np.ascontiguousarray(values, "<f4" if kind == "float32" else "<i4")
    planes = raw.view(np.uint8).reshape(-1, 4).T
    data = base64.b64encode(zlib.compress(planes.tobytes(), LEVEL)).decode("ascii")
    return {"shape": list(values.shape), "type": kind, "data": data}
