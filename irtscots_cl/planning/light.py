"""Where the mirror sends the camera's rays on the screen, and whether the screen is there and of use."""

from __future__ import annotations

import math

import numpy as np

from irtscots_cl.maths.frame import Frame
from irtscots_cl.planning.finding import Finding
from irtscots_cl.planning.sight import Sight

LANDING, FEW = 0.98, 0.6  # share of the light that lands: below, part is not measured; below, most
USED = 0.1  # of the screen's lines along an axis: fewer, and most frames of a line scan show nothing
MANY_LINES = 200  # a shorter scan is not worth a word
FEW_LINES = 3.0  # screen pixels across the light: fewer give no centroid
SLANT_DEG = 60.0  # between the screen's normal and its light
CONJUGATE = (0.7, 1.4)  # screen's distance over the one at which the light gathers


def check_light(sight: Sight) -> list[Finding]:
    """Findings about the light on the screen."""
    wide, high = sight.spot_px
    if math.isnan(wide):
        text = f"screen.position_mm = {list(sight.scene.screen.position_mm)}: no light from the mirror comes onto the "
        return [Finding("light-misses-screen", "error", f"{text}screen's front{_gathers(sight)}")]
    found = _coverage(sight) + _slanted(sight)
    columns, rows = sight.scene.screen.pixels
    if min(wide, high) < FEW_LINES:
        text = f"the light covers {wide:.1f} x {high:.1f} screen pixels: needs {FEW_LINES:.0f} or more each way for a "
        text += "centroid; a finer screen, a screen further from where the light gathers, or a wider aperture"
        found.append(Finding("light-too-small", "warning", text))
    elif max(columns, rows) > MANY_LINES and (wide < USED * columns or high < USED * rows) and not found:
        text = f"the light covers {wide:.0f} x {high:.0f} of {columns} x {rows} screen pixels: a line scan wastes the "
        text += (
            f"others; use [{_even(wide)}, {_even(high)}] with screen.centre_offset_mm = {_offset(sight)}, or fringes"
        )
        found.append(Finding("screen-too-large", "warning", text))
    return found


def _coverage(sight: Sight) -> list[Finding]:
    share = sight.landing
    if share >= LANDING:
        return []
    wide, high = sight.spot_px
    columns, rows = sight.scene.screen.pixels
    middle = _offset(sight)
    spot = f"the light is {wide:.0f} x {high:.0f} screen pixels about {middle} mm of the screen's x, y, the screen "
    spot += f"{columns} x {rows}"
    if share == 0:
        return [Finding("light-misses-screen", "error", f"no light lands on the screen: {spot}{_gathers(sight)}")]
    text = (
        f"{share:.0%} of the light lands on the screen, {sight.measured:.0%} of the mirror is fully measured: {spot}; "
    )
    text += f"needs screen.pixels = [{_even(wide)}, {_even(high)}] with centre_offset_mm = {middle}{_gathers(sight)}"
    return [Finding("screen-too-small", "error" if share < FEW else "warning", text)]


def _even(pixels: float) -> int:
    """Pixels that hold the light with a margin of a twentieth and two."""
    return 2 * math.ceil((1.05 * pixels + 2) / 2)


def _offset(sight: Sight) -> list[float]:
    """Where the light's middle is in the screen's x, y, in mm."""
    return [round(place, 2) for place in sight.scene.screen.places_mm(*sight.spot_centre_px)]


def _gathers(sight: Sight) -> str:
    """Where the light would gather, if the screen is far from there; else nothing."""
    mirror, screen, camera = sight.scene.mirror, sight.scene.screen, sight.scene.camera
    if mirror.is_flat or mirror.radius_mm < 0:
        return ""
    power = 2 / mirror.radius_mm - 1 / math.dist(camera.position_mm, (0.0, 0.0, 0.0))
    if power <= 0:
        return "; the camera is inside the mirror's focus and its rays never gather: move it to the centre of curvature"
    gathers, is_at = 1 / power, math.dist(screen.position_mm, (0.0, 0.0, 0.0))
    if CONJUGATE[0] <= is_at / gathers <= CONJUGATE[1]:
        return ""
    return f"; it gathers {gathers:.4g} mm from the mirror, the screen is {is_at:.4g} mm away"


def _slanted(sight: Sight) -> list[Finding]:
    screen = sight.scene.screen
    normal = Frame.looking(screen.position_mm, screen.look_at_mm).axes[2]
    to_mirror = -np.array(screen.position_mm) / np.linalg.norm(screen.position_mm)
    angle = math.degrees(math.acos(min(1.0, abs(float(normal @ to_mirror)))))
    if angle <= SLANT_DEG:
        return []
    text = f"screen.look_at_mm = {list(screen.look_at_mm)}: the screen is {angle:.0f} degrees from facing the mirror; "
    return [Finding("screen-slanted", "warning", text + "it should look at it, [0, 0, 0]")]
