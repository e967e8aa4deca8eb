"""Light along a given sequence of elements, in float64 on the host. World frame, mm.

The device kernels have their own versions (kernels/elements/element.cl, kernels/elements/interact_*.cl)."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.quadric import Quadric
from irtscots_cl.optics.elements.components import Component

NOMINAL, GHOST, SCATTER = range(3)  # events: indices of paths.KINDS
BEHIND = 1e-9  # relative to the path length: an element so little behind a ray touches the one it stands on


def trace_sequence(components: tuple[Component, ...], events, points_mm, directions) -> tuple[np.ndarray, np.ndarray]:
    """Trace rays from points_mm along directions [n, 3] through events [(element number, event)]; see paths.events_of.

    Returns points and unit directions [events, n, 3] after each event. They are NaN from the event at which a ray
    misses a surface, is totally reflected instead of refracted, or has no defined direction: after a scatterer, an
    absorber or a mirror's back. Surfaces are those of the design, without limits by their apertures.
    """
    point, along = np.asarray(points_mm, float), np.asarray(directions, float)
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    points, ways, last = [], [], None
    with np.errstate(invalid="ignore", divide="ignore"):
        for number, event in events:
            component = components[number]
            axes = component.frame.axes
            at, local = (point - component.frame.position_mm) @ axes.T, along @ axes.T
            met = _meet(component, at, local, stands=number == last)
            goes = interact(component, event, met, local)
            point, along, last = met @ axes + component.frame.position_mm, goes @ axes, number
            points.append(point)
            ways.append(along)
    shape = (len(points), *point.shape)
    return np.reshape(points, shape), np.reshape(ways, shape)


def _meet(component: Component, at, along, stands: bool) -> np.ndarray:
    """Where rays meet the surface, in its frame: nearest the vertex, or the other root if they stand on it."""
    back = np.zeros(len(at)) if stands else -np.sum(at * along, -1)  # starting near the vertex keeps all numbers small
    base = at + back[:, None] * along
    a = quadric_form(component.quadric, along, along)
    b = quadric_form(component.quadric, base, along) - along[:, 2]
    c = np.zeros(len(at)) if stands else quadric_form(component.quadric, base, base) - 2 * base[:, 2]
    root = np.sqrt(b * b - a * c)
    larger = np.where(b < 0, root - b, -root - b)
    step = larger / a if stands else c / larger
    point = base + step[:, None] * along
    ahead = back + step > -BEHIND * (1 + np.abs(back))
    # only the side of a closed surface whose normal points to the front; never infinite or NaN
    front = component.quadric.q_zz * point[:, 2] + component.quadric.q_xz * point[:, 0] < 1
    return np.where((ahead & front)[:, None], point, np.nan)


def quadric_form(quadric: Quadric, a, b) -> np.ndarray:
    """The quadric's bilinear form of vectors [n, 3]."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    q = quadric
    return q.q_xx * ax * bx + q.q_yy * ay * by + q.q_zz * az * bz + q.q_xz * (ax * bz + az * bx)


def interact(component: Component, event: int, point, along) -> np.ndarray:
    """Directions [n, 3] after an event at points along directions [n, 3], all in the element's frame; NaN for none."""
    if component.kind == "detector":
        return along
    if component.kind == "lens" and event == NOMINAL:
        slopes = along[:, :2] / np.abs(along[:, 2:]) - point[:, :2] / component.focal_length_mm
        return unit(np.column_stack([slopes, np.sign(along[:, 2])]))
    normal = surface_normal(component, point)
    cosine = np.sum(along * normal, -1, keepdims=True)
    mirrored = along - 2 * cosine * normal
    if component.refracts and event == GHOST:
        return mirrored
    if component.refracts and event == NOMINAL:
        forth, back = component.index_front / component.index_back, component.index_back / component.index_front
        tangential = np.where(cosine < 0, forth, back) * (along - cosine * normal)
        behind = np.sqrt(1 - np.sum(tangential**2, -1, keepdims=True))
        return tangential + np.sign(cosine) * behind * normal
    reflects = component.kind == "mirror" and event == NOMINAL
    return np.where((cosine < 0) & reflects, mirrored, np.nan)


def surface_normal(component: Component, point) -> np.ndarray:
    """Unit normals [n, 3] towards the front at points [n, 3] of the surface, both in the element's frame."""
    q = component.quadric
    return unit(np.column_stack([-(q.q_xx * point[:, 0] + q.q_xz * point[:, 2]), -q.q_yy * point[:, 1],
                                 1 - q.q_zz * point[:, 2] - q.q_xz * point[:, 0]]))  # fmt: skip


def unit(vectors) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
