"""Fringes with a Gray code: its planes read, checked, and the orders that planes and phases make most likely."""

from __future__ import annotations

import numpy as np

from irtscots_cl.imaging.orientation import upright
from irtscots_cl.measurement.fringe_light import place_mm
from irtscots_cl.measurement.gray_code import gray_shares
from irtscots_cl.measurement.gray_places import with_gray_orders
from irtscots_cl.measurement.quality import Check
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.measurement.screen_coordinates import ScreenCoordinates
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.lab_camera import RecordedImages
from irtscots_cl.pipeline.measure_gray import check_gray_frames, images_of_code


def gray_orders(
    recorded: RecordedImages, found: ScreenCoordinates, setup: Setup
) -> tuple[ScreenCoordinates, list[Check]]:
    """The coordinates in the orders of the Gray code, and the check of its planes. found: of images as stored.

    Noise is that of the planes where they are shown inverted too, else that of the fringes.
    """
    images = recorded.images
    samples = images_of_code(images, setup, recorded.limit)
    shares = {
        axis: gray_shares(one, None if one.code.inverted else found.axes[axis].survey.noise)
        for axis, one in samples.items()
    }
    coded = with_gray_orders(found, shares, setup)
    pixels, orientation = setup.pixel_light.pixels, setup.scene.camera.detector.orientation
    design = dict(zip("xy", (points.ravel()[pixels] for points in design_points(setup)[2:]), strict=True))
    own = {axis: place_mm(one, setup).ravel()[pixels] for axis, one in coded.axes.items()}
    used = np.asarray(upright(found.mask, orientation).ravel()[pixels])
    return coded, [check_gray_frames(images, shares, [design, own], setup, used)]
