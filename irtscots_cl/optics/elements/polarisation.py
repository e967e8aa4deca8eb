"""Whether the polarisation of the light between interfaces matters to a scene's direct light.

At each interface by itself unpolarised light loses the mean of both polarisations' reflectances. But what has passed
one interface at an angle is polarised, and passes the next one better: the mean of the products counts, not the product
of the means.
"""

from __future__ import annotations

import numpy as np

from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.optics.elements.components import Component
from irtscots_cl.optics.elements.direct_light import chief_walks, crosses_screen, mirror_points
from irtscots_cl.optics.elements.walk import Visit, walk

LEAST_CHANGE = 1e-4  # relative, of the direct light's flux: what smaller tilts do is not worth carrying
MAX_STEPS = 64


def polarisation_change(chief: ChiefRays, components: tuple[Component, ...]) -> float:
    """Largest relative change of a direct ray's flux by carrying its polarisation from interface to interface.

    An estimate: it takes all planes of incidence as one.
    """
    if not any(component.refracts for component in components):
        return 0.0
    back, forth = chief_walks(chief, components)
    both = [_transmitted(visits, parts, len(mirror_points(chief))) for visits, parts in (back, forth)]
    from_camera = _change(both[0] * both[1])
    screen = chief.screen_frame
    points = mirror_points(chief)
    ways = points - screen.position_mm
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    visits = walk(components, np.broadcast_to(screen.position_mm, ways.shape), ways, MAX_STEPS,
                  passes=crosses_screen(screen))  # fmt: skip
    return max(from_camera, _change(_transmitted(visits, components, len(ways))))


def _change(transmitted: np.ndarray) -> float:
    s, p, alone = transmitted
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.nanmax(np.abs((s + p) / 2 / alone - 1), initial=0.0))


def _transmitted(visits, components: tuple[Component, ...], count: int) -> np.ndarray:
    """Transmittances [3, count] of all interfaces together: of s, of p, and as the product of the means."""
    products = np.ones((3, count))
    for visit in visits:
        for number in np.unique(visit.numbers):
            if components[number].refracts:
                here = visit.numbers == number
                s, p = reflectances(components[number], *_cosines(visit, here))
                products[:, visit.rays[here]] *= 1 - np.stack([s, p, (s + p) / 2])
    return products


def _cosines(visit: Visit, here: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosines [n] to the normal towards the front, before and after, of the rays that an interface passes on."""
    return tuple(np.sum(ways[here] * visit.normals[here], -1) for ways in (visit.along, visit.goes))


def reflectances(component: Component, before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reflectances of an interface for s and p [n] each; NaN where light is totally reflected.

    before, after: cosines of the rays to the normal towards the front. M. Born, E. Wolf, Principles of Optics, sections
    1.5.2 and 1.6.4.
    """
    if not np.isnan(component.reflectance):
        given = np.full(before.shape, component.reflectance)
        return given, given
    enters = before < 0
    first = np.where(enters, component.index_front, component.index_back)
    last = np.where(enters, component.index_back, component.index_front)
    cosine, beyond = np.abs(before), np.where(before * after > 0, np.abs(after), np.nan)
    if component.kind != "coated":
        s, p = _amplitudes(first, last, cosine, beyond)
        return s * s, p * p
    layer = component.coating_index
    inside = np.sqrt(1 - (first / layer) ** 2 * (1 - cosine * cosine))
    phase = np.exp(1j * np.pi * inside)
    pairs = zip(_amplitudes(first, layer, cosine, inside), _amplitudes(layer, last, inside, beyond), strict=True)
    s, p = (np.abs((one + two * phase) / (1 + one * two * phase)) ** 2 for one, two in pairs)
    return s, p


def _amplitudes(first, last, cosine, beyond) -> tuple[np.ndarray, np.ndarray]:
    """Fresnel's reflection amplitudes of s and p."""
    return ((first * cosine - last * beyond) / (first * cosine + last * beyond),
            (last * cosine - first * beyond) / (last * cosine + first * beyond))  # fmt: skip
