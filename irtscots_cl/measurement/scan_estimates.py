"""The light's centroids of both scans with their error bars, from images with noise, background and unequal frames.

The steps: find each pixel's light; tell the noise from the samples that no light reaches; fit the design's profile;
leave out frames that show another line; find the gains of the frames; fit again, with the samples weighed by their
noise. Nothing is cut at a threshold, and every step is linear in the samples near the solution: what noise does on
average is zero.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.measurement.frame_factors import FALSE_ALARM, frame_gains
from irtscots_cl.measurement.line_positions import check_fits
from irtscots_cl.measurement.one_scan import OneScan, ScanEstimate
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.setup import Setup

FRAME_ROUNDS = 5  # of leaving out wrong frames and fitting again
GAIN_ROUNDS = 6  # of finding gains and fitting again


def estimate_centroids(
    stack: ImageStack, setup: Setup, way: str, light: PixelLight | None = None
) -> tuple[ScanEstimate, ScanEstimate]:
    """Centroids of the light in both scans of a stack.

    setup: of the design. light: the pixels' light of a better model of the mirror; None: of the design. way:
    "likelihood" (the design's profile moved to the samples: least noise) or "windowed" (the signed samples' centroid
    in the window that the geometry allows; no profile). Pixels without a profile from the design get the windowed
    centroid in both. Raises ValueError if the stack does not match the scene.
    """
    check_fits(stack, setup.chief_rays)
    light = light or setup.pixel_light
    _ = setup.chief_rays.sees_mirror  # made once, before two threads ask for it
    with ThreadPoolExecutor(2) as pool:  # NumPy works on both scans at once
        sides = list(pool.map(lambda scan: _fitted(scan, setup, light), (stack.x, stack.y)))
        for k in range(GAIN_ROUNDS):
            gains = frame_gains(*(side.for_gains() for side in sides))
            # the fits that a first correction starts from know nothing of gains: a second one completes it
            if gains.chance > FALSE_ALARM and k != 1:
                break
            for side, change in zip(sides, (gains.x, gains.y), strict=True):
                side.gain *= change
            list(pool.map(OneScan.fit, sides))
        x, y = pool.map(lambda side: side.result(way), sides)
    return x, y


def _fitted(scan: Scan, setup: Setup, light: PixelLight) -> OneScan:
    """A scan with its fits, without the frames that show another line."""
    side = OneScan(scan, setup, light)
    side.fit()
    for _ in range(FRAME_ROUNDS):
        if not side.leave_out_wrong_frames():
            break
        side.fit()
    return side
