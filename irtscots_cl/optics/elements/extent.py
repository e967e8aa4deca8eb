"""Where a component's surface can lie: bounds that hold for all of its points, in float64. World frame, mm."""

from __future__ import annotations

import numpy as np

from irtscots_cl.optics.elements.components import Component

RINGS, SPOKES = 8, 32  # of points that find a curved component's extremes
BETWEEN = 0.05  # of the range of heights at these points: room for the points between


def heights(component: Component) -> tuple[float, float]:
    """Least and largest z of a component's points in its frame; infinite if its surface does not reach its rim."""
    if component.shape == "plane":
        return 0.0, 0.0
    radius = component.rim_mm * np.arange(RINGS + 1) / RINGS
    angle = np.arange(SPOKES) * (2 * np.pi / SPOKES)
    z = component.quadric.meet(np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle)), 0.0, 0.0)
    if not np.all(np.isfinite(z)):
        return -np.inf, np.inf
    room = BETWEEN * float(z.max() - z.min())
    return float(z.min()) - room, float(z.max()) + room


def radius_about_vertex(component: Component) -> float:
    """Radius of a ball about the origin of a component's frame that contains it; infinite without a rim."""
    return float(np.hypot(component.rim_mm, np.abs(heights(component)).max()))


def depths(component: Component, origin: np.ndarray, normal: np.ndarray) -> tuple[float, float]:
    """Least and largest distance of a component's points from the plane through origin, along its unit normal."""
    cosine = float(component.frame.axes[2] @ normal)
    sine = float(np.linalg.norm(np.cross(component.frame.axes[2], normal)))
    across = component.rim_mm * sine if sine > 0 else 0.0
    ends = [z * cosine for z in heights(component)]
    vertex = float((component.frame.position_mm - origin) @ normal)
    return vertex + min(ends) - across, vertex + max(ends) + across
