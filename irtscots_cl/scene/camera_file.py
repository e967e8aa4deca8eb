"""A camera's calibration from a file of another program: the key `file` of the table [camera.intrinsics].

Only scenes with that key import this module.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from irtscots_cl.formats.opencv_camera import OpenCvCamera, read_camera
from irtscots_cl.scene.camera_intrinsics import Intrinsics, picture_size
from irtscots_cl.scene.instrument import Camera
from irtscots_cl.scene.validation import SceneError, problem

KEY = "file"
OTHERS = ("roi_px", "binning")  # keys that no such file has: they stand beside `file`


def intrinsics_from(camera: OpenCvCamera, roi_px: Any = (0, 0), binning: Any = (1, 1)) -> Intrinsics:
    """The intrinsics of a calibrated camera, of which a region may be read out, pixels joined. Raises SceneError."""
    return Intrinsics(
        image_size_px=camera.image_size_px,
        principal_point_px=(camera.cx, camera.cy),
        fx=camera.fx,
        fy=camera.fy,
        distortion=camera.distortion,
        roi_px=roi_px,
        binning=binning,
    )


def opencv_camera(camera: Camera, name: str = "") -> OpenCvCamera:
    """The calibrated camera of a scene's: the inverse of intrinsics_from. Its picture is the full one, before region
    and binning."""
    given = camera.intrinsics or Intrinsics()
    columns, rows = picture_size(given, camera.detector.pixels)
    middle = given.principal_point_px or ((columns - 1) / 2, (rows - 1) / 2)
    own = camera.image_distance_mm / camera.detector.pitch_mm
    fx, fy = (f or own * b for f, b in zip((given.fx, given.fy), given.binning, strict=True))
    return OpenCvCamera(
        fx, fy, middle[0], middle[1], given.distortion if given.is_distorted else (), (columns, rows), name
    )


def with_camera_file(table: dict[str, Any], source: str, steps: tuple[str, ...], pixels: Any) -> dict[str, Any]:
    """A table [camera.intrinsics] with what its `file` holds in the place of that key.

    The path is relative to the folder of the file `source`. pixels: the detector's, as the scene gives them. Raises
    SceneError, also for a picture of another size than the detector's if nothing says which part of it is read out.
    """
    given = table[KEY]
    if not isinstance(given, str) or not 0 < len(given) <= 4096:
        raise problem(source, (*steps, KEY), "must be the path of a camera calibration", given)
    twice = [key for key in table if key not in (KEY, *OTHERS) and key in Intrinsics.__dataclass_fields__]
    if twice:
        raise problem(source, (*steps, twice[0]), f"the file {given[:80]} gives it; must stand in one of the two")
    try:
        camera = read_camera(Path(os.path.join(os.path.dirname(source), given)))
    except ValueError as error:
        raise SceneError(f"{source}: {'.'.join((*steps, KEY))}: {error}") from None
    binning = table.get("binning", [1, 1])
    if camera.image_size_px and not set(OTHERS[:1]) & set(table) and _pair(pixels) and _pair(binning):
        whole = [n * b for n, b in zip(pixels, binning, strict=True)]
        if whole != list(camera.image_size_px):
            must = (
                f"be given: the picture of {given[:80]} has {list(camera.image_size_px)} pixels, the detector {whole}"
            )
            raise problem(source, (*steps, "roi_px"), f"must {must}")
    found = intrinsics_from(camera)
    keys = ("image_size_px", "principal_point_px", "fx", "fy", "distortion")
    return {**{k: v for k, v in table.items() if k != KEY}, **{k: getattr(found, k) for k in keys}}


def _pair(value: Any) -> bool:
    """Whether a value of a scene file can be two numbers of pixels; others are refused where they are checked."""
    return isinstance(value, list) and len(value) == 2 and all(type(n) is int for n in value)
