"""Checks of the media between elements."""

from __future__ import annotations

import numpy as np

from irtscots_cl.optics.elements.components import COPLANAR, Component
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError

SAME_INDEX = 1e-9


def check_media(scene: Scene, components: tuple[Component, ...]) -> None:
    """Raise SceneError if refractive indices do not match: each element is compared with the next along its axis.

    There must be one medium between two interfaces that face each other, and air outside the outermost ones.
    """
    refractors = [component for component in components if component.refracts]
    for component in refractors:
        for sign, side, index in ((1.0, "front", component.index_front), (-1.0, "back", component.index_back)):
            others = [other for other in refractors if other is not component]
            seen = [(step, other) for other in others if (step := _step_to(component, sign, other)) is not None]
            facing, name = 1.0, "nothing, so air"
            if seen:
                _, other = min(seen, key=lambda pair: pair[0])
                from_front = sign * (component.frame.axes[2] @ other.frame.axes[2]) < 0
                facing, name = (other.index_front if from_front else other.index_back), other.name
            if abs(index - facing) > SAME_INDEX:
                number = next(k for k, element in enumerate(scene.element) if element.name == component.name)
                raise SceneError(
                    f"scene {scene.name}: element[{number}].index_{side} = {index!r}: "
                    f"{component.name} faces {name} there; "
                    f"must be {facing!r}, or media overlap"
                )


def _step_to(component: Component, sign: float, other: Component) -> float | None:
    """Distance along a component's axis to another one, from its vertex to the front (1) or back (-1); None: no hit."""
    at = other.frame.axes @ (component.frame.position_mm - other.frame.position_mm)
    along = sign * (other.frame.axes @ component.frame.axes[2])
    if abs(along[2]) < COPLANAR:
        return None
    p, q = along[0] / along[2], along[1] / along[2]
    x0, y0 = at[0] - p * at[2], at[1] - q * at[2]
    z = float(other.quadric.meet(x0, y0, p, q))
    x, y, step = x0 + p * z, y0 + q * z, (z - at[2]) / along[2]
    inside = other.inner_mm <= np.hypot(x, y) <= other.outer_mm
    inside = inside and abs(x) <= other.half_mm[0] and abs(y) <= other.half_mm[1]
    return step if inside and step > 0 else None
