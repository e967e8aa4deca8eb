"""Focus and blur of a path's light on the detector, to first order."""

from __future__ import annotations

import numpy as np

from irtscots_cl.maths.frame import Frame
from irtscots_cl.optics.elements.components import Component
from irtscots_cl.optics.elements.sequential_rays import SCATTER, trace_sequence, unit

FIRST_ORDER = 1e-3  # of the stop's radius: distance of the close rays from the stop's centre
NO_FOCUS = (float("nan"), float("nan"))


def path_focus(components: tuple[Component, ...], events) -> tuple[float, float]:
    """Focus and blur of a path's light on the detector, to first order: focus_mm and blur_mm.

    The object is a point of the path's last scatterer; else of the mirror where the path last meets it; else of the
    last element in front of the stop. The camera's line of sight, the normal through the stop's centre, leads back to
    this point. From there the chief ray goes through the stop's centre, with close rays near it, to the detector by the
    path's further events.

    focus_mm: distance along the chief ray from the detector to where the close rays cross; negative before the
    detector. If the two meridians cross at different points, their vergences (one over the distance) are averaged just
    behind the path's last element, or the stop if that comes later. blur_mm: diameter (of an ellipse, the longer one)
    of the spot that the object point lights on the detector through the whole stop. Both are NaN if there are no such
    rays, or for a scatterer behind the stop.
    """
    stop = next(component for component in components if component.name == "stop")
    first, entry = _object_and_entry(components, events, stop.frame)
    if not 0 <= first < entry:
        return NO_FOCUS
    fan = _fan(components, events[first:entry], stop)
    rest = events[first + 1 :]
    after = trace_sequence(components, rest, *fan)
    points, ways = (np.concatenate([start[None], then]) for start, then in zip(fan, after, strict=True))
    leg = entry - first - 1  # the leg on which the light goes through the stop
    at_stop = stop.frame.arrive(points[leg], ways[leg])
    at_detector = components[rest[-1][0]].frame.arrive(points[-1], ways[-2])
    with np.errstate(invalid="ignore", divide="ignore"):
        image = _ratio(_spread(at_detector), _spread(at_stop))
        leaves = stop.frame.to_world(*at_stop) if leg == len(rest) - 1 else points[-2]
        focus_mm = _meeting(leaves, ways[-2]) - float(np.linalg.norm(points[-1, 0] - leaves[0]))
    blur_mm = 2 * stop.inner_mm * float(np.linalg.norm(image, 2)) if np.isfinite(image).all() else NO_FOCUS[1]
    return focus_mm, blur_mm


def _object_and_entry(components: tuple[Component, ...], events, stop: Frame) -> tuple[int, int]:
    """The event of the object, or -1, and the first event after the light passes the stop for the last time."""
    depth = [(components[number].frame.position_mm - stop.position_mm) @ stop.axes[2] for number, _ in events]
    entry = 1 + max((k for k, z in enumerate(depth) if z < 0), default=-1)
    scatterers = [k for k, (_, event) in enumerate(events) if event == SCATTER]
    mirrors = [k for k, (number, _) in enumerate(events) if components[number].name == "mirror"]
    return max(scatterers or mirrors or [entry - 1]), entry


def _fan(components: tuple[Component, ...], events, stop: Component) -> tuple[np.ndarray, np.ndarray]:
    """Points and directions [5, 3] at the object for the first event: the chief ray and two rays on each side of it."""
    sight = -stop.frame.axes[2]
    start = stop.frame.position_mm
    points, ways = trace_sequence(components, events[::-1], start[None], sight[None])
    points, ways = np.concatenate([start[None], points[:, 0]]), np.concatenate([sight[None], ways[:, 0]])
    step = FIRST_ORDER * stop.inner_mm / np.linalg.norm(np.diff(points, axis=0), axis=-1).sum()
    chief = -ways[-2]
    beside = [chief + sign * step * side for side in _across(chief) for sign in (1, -1)]
    return np.tile(points[-1], (5, 1)), np.stack([chief, *beside])


def _across(direction) -> np.ndarray:
    """Two unit vectors [2, 3] at right angles to a direction and to each other."""
    side = unit(np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))]))
    return np.stack([side, np.cross(direction, side)])


def _spread(places) -> np.ndarray:
    """Derivatives [coordinate, angle] of two coordinates [5] of a fan by its two angles."""
    return np.stack([(place[1::2] - place[2::2]) / 2 for place in places])


def _ratio(change: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Matrix [2, 2] that maps one spread to another; not finite if there is none."""
    (a, b), (c, d) = of
    return change @ np.array([[d, -b], [-c, a]]) / (a * d - b * c)


def _meeting(points, directions) -> float:
    """Distance along a fan's first ray from its point to where the other rays cross it, by their mean vergence."""
    chief, across = directions[0], _across(directions[0])
    place = _spread(Frame(points[0], np.stack([*across, chief])).arrive(points, directions))
    slope = _spread(across @ directions.T / (directions @ chief))
    return float(-2 / np.trace(_ratio(slope, place)))
