"""The set-up of a page: what setup.js draws to scale, with chief and marginal rays traced through the design."""

from __future__ import annotations

from typing import Any

import numpy as np

from irtscots_cl.maths.arrays import FloatArray, IntArray
from irtscots_cl.optics.screen_model import ScreenModel
from irtscots_cl.planning.sight import Sight
from irtscots_cl.scene.model import Scene

RAYS = 7  # chief rays of a view
PLACES = 7  # of the screen's grid along each side, whose world points are told
PROFILE = 61  # points of the mirror's section


def setup_data(scene: Scene) -> dict[str, Any]:
    """The design of a scene as JSON for setup.js, in world mm.

    views: of x and of y beside z: the mirror's section, chief rays and the marginal rays of the outermost and the
    middle ones, each as three points: on the screen, on the mirror, in the camera's aperture. screen: u, v [PLACES] and
    world points [v][u], between which places are interpolated. landing: where chief rays of the mirror's points land.
    """
    sight = Sight.of(scene)
    screen = sight.scene.screen
    columns, rows = screen.pixels
    u, v = screen.places_mm(np.linspace(-0.5, columns - 0.5, PLACES), np.linspace(-0.5, rows - 0.5, PLACES))
    across, up = np.meshgrid(u, v)
    landing = np.stack(screen.places_mm(sight.screen_column, sight.screen_row), -1)
    return {
        "views": [_view(sight, k) for k in (0, 1)],
        "camera": _plain(np.array(sight.scene.camera.position_mm)),
        "screen": {"u": _plain(u), "v": _plain(v), "world": _plain(ScreenModel.of(screen).to_world(across, up))},
        "landing": _plain(landing[np.isfinite(landing).all(-1)]),
        "measured": sight.measured,
    }


def _view(sight: Sight, k: int) -> dict[str, Any]:
    """Along axis k (0: x, 1: y) and z."""
    radius, surface = sight.scene.mirror.diameter_mm / 2, sight.chief.surface
    along, flat = np.linspace(-radius, radius, PROFILE), np.zeros(PROFILE)
    x, y = (along, flat) if k == 0 else (flat, along)
    chosen = _spread(sight, k)
    aperture = sight.scene.camera.aperture_diameter_mm / 2
    outer = chosen[sorted({0, len(chosen) // 2, len(chosen) - 1})] if len(chosen) else chosen
    marginal = [_rays(sight, outer, *((a, 0.0) if k == 0 else (0.0, a))) for a in (-aperture, aperture)]
    return {
        "mirror": _plain(np.stack([x, y, surface.sag(x, y)], -1)),
        "chief": _plain(_rays(sight, chosen)),
        "marginal": _plain(np.concatenate(marginal)),
    }


def _spread(sight: Sight, k: int) -> IntArray:
    """Numbers of up to RAYS points near the section along axis k whose light reaches detector and screen, in order."""
    along, across = (sight.x_mm, sight.y_mm)[k], (sight.y_mm, sight.x_mm)[k]
    near = np.abs(across) < 0.35 * sight.scene.mirror.diameter_mm / 2
    chosen = np.flatnonzero(near & sight.detected & sight.lit)
    chosen = chosen[np.argsort(along[chosen])]
    return chosen[np.unique(np.linspace(0, max(len(chosen) - 1, 0), RAYS).astype(int))] if len(chosen) else chosen


def _rays(sight: Sight, chosen: IntArray, a_mm: float = 0.0, b_mm: float = 0.0) -> FloatArray:
    """Rays [n, 3, 3] through the aperture's point (a, b): points on screen, mirror and aperture."""
    chief = sight.chief
    mirror, u, v = chief.reverse(sight.row[chosen], sight.column[chosen], a_mm, b_mm)
    start = np.broadcast_to(chief.camera_frame.to_world(a_mm, b_mm), mirror.shape)
    rays = np.stack([ScreenModel.of(sight.scene.screen).to_world(u, v), mirror, start], 1)
    complete: FloatArray = rays[np.isfinite(rays).all((1, 2))]
    return complete


def _plain(values: FloatArray) -> Any:
    """Lists of numbers to a tenth of a micrometre."""
    return np.round(np.asarray(values, float), 4).tolist()
