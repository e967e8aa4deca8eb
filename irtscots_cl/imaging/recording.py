"""From the light of a scene to what its screen shows and its camera records.

A scene without the tables [camera.detector.noise] and [screen.response] never needs this module.
"""

from __future__ import annotations

from irtscots_cl.imaging.detector import check_exposures, check_recording_memory, expose, pixel_properties
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.imaging.screen_response import brightness_map, shown
from irtscots_cl.scene.model import Scene


def has_noise(scene: Scene) -> bool:
    """Whether the scene's camera or screen changes anything about the light."""
    noise, response = scene.camera.detector.noise, scene.screen.response
    return (noise is not None and not noise.is_off) or (
        response is not None and (response.needs_map or response.changes_frames)
    )


def line_scan(scene: Scene) -> LineScan:
    """The line scan of the scene's own screen, with its brightness map if it has one.

    Raises ValueError for a map that cannot be used.
    """
    response = scene.screen.response
    uneven = response is not None and response.needs_map
    return LineScan(scene, brightness_map(response, scene.screen.pixels) if uneven else None)


def check_recording(scene: Scene, replicates: int) -> None:
    """Read the scene's maps and see that the images fit the memory and the exposures the replicates, before rays are
    traced. Raises ValueError."""
    line_scan(scene)
    noise, (columns, rows) = scene.camera.detector.noise, scene.camera.detector.pixels
    if noise is not None and not noise.is_off:
        lines = sum(len(LineScan(scene).positions_mm(axis)) for axis in "xy")
        check_recording_memory(noise, lines, (rows, columns))
        check_exposures(noise, replicates)
        pixel_properties(noise, (rows, columns))


def record(stack: ImageStack, scene: Scene) -> ImageStack:
    """The images of a stack in W, of `line_scan(scene)`, as the scene's screen shows and its camera records them.

    In DN where the scene's detector noise is not off, else in W; the stack itself where nothing changes it. Same seeds,
    same noise. Raises ValueError as imaging.detector.expose does.
    """
    noise, response = scene.camera.detector.noise, scene.screen.response
    if noise is not None and not noise.is_off:
        return expose(stack, noise, response)
    if response is not None and response.changes_frames:
        return shown(stack, response)
    return stack
