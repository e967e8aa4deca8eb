"""The page of `irtscots watch`: a running job in words, and its map so far."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.report.page.layers import Layer, grid_data
from irtscots_cl.report.page.rendering import rendered

RENEW_SECONDS = 5


def map_so_far(result: Reconstruction) -> dict[str, Any]:
    """The deviation [rows, columns] of a result as JSON for the page."""
    deviation = Layer("deviation from the design", "nm", result.deviation_mm * 1e6, True, True)
    return grid_data(result.x_mm, result.y_mm, result.height_mask, [deviation])


def job_page(name: str, rows: Sequence[tuple[str, str]], maps: dict[str, Any] | None) -> str:
    """The page's text, which a browser renews every RENEW_SECONDS. maps: of map_so_far, or None."""
    words = {"title": f"{name}: at work", "rows": rows, "has_map": maps is not None, "renew": RENEW_SECONDS}
    return rendered("watch", words, {"map": maps})
