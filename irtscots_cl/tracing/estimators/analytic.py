"""The analytic estimator: every pixel's light curves in closed form (optics/pixel/response.py), without rays' noise.

Light that the screen's other edge cuts off has no closed form. Pixels with such light get no light curve, like pixels
whose map is not quadratic enough; the ledger counts both.
"""

from __future__ import annotations

import time

import numpy as np

from irtscots_cl.opencl.structs import Fate
from irtscots_cl.optics.chief_rays import check_visible
from irtscots_cl.optics.pixel.light import whole_flux_w
from irtscots_cl.optics.pixel.ray_map import RAYS
from irtscots_cl.optics.pixel.response import PixelResponse
from irtscots_cl.optics.screen_windows import Windows
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.option_error import OptionError
from irtscots_cl.tracing.options import ANALYTIC, TraceOptions
from irtscots_cl.tracing.results.transport import LineLight, ledger_from

MARGIN = 1  # screen pixels by which the windows are wider than the chief rays require
HOST = {
    "index": "-", "name": "host", "platform": "NumPy", "driver": np.__version__, "kind": "host", "compute_units": 1,
}  # fmt: skip


def trace_analytic(setup: Setup) -> LineLight:
    """The light curves of a scene's line scans, in float64 on the host.

    The ledger counts the rays that the pixels' maps are fitted to, by what becomes of their pixel's light: detected,
    missed_mirror, off_screen (some of it misses the screen), failed (the map is not quadratic enough).
    Raises SceneError if no pixel sees the screen, ValueError if no pixel's light has a closed form.
    """
    started = time.perf_counter()
    scene = setup.scene
    check_visible(setup.chief_rays, f"scene {scene.name}")
    windows, pixels = setup.windows(MARGIN), setup.pixel_response
    fate = _fates(pixels, windows)
    _check_closed_form(scene.name, pixels, fate)
    flux_w = whole_flux_w(setup.chief_rays)
    flux = {}
    for k, output in enumerate("uv"):
        share = pixels.light(output, window_edges_mm(scene, windows, k))
        share = np.where((fate == Fate.DETECTED)[:, None], np.maximum(share, 0.0), 0.0)  # rounding left of no light
        flux["xy"[k]] = share[None] * flux_w
    count = np.bincount(fate, minlength=len(Fate)) * RAYS
    seconds = {"build": 0.0, "trace": time.perf_counter() - started, "kernels": 0.0}
    options = TraceOptions(ANALYTIC, precision="fp64")
    return LineLight(
        scene, options, HOST, windows, flux, np.array([RAYS]), ledger_from(count, int(count.sum())), seconds
    )


def window_edges_mm(scene: Scene, windows: Windows, k: int) -> np.ndarray:
    """Edges [n, window + 1] of the screen pixels in the windows, in the screen's own x (k = 0) or y (k = 1)."""
    number = windows.origins[:, k, None] + np.arange((windows.columns, windows.rows)[k] + 1)
    return (number - scene.screen.pixels[k] / 2) * scene.screen.pitch_xy_mm[k] + scene.screen.centre_offset_mm[k]


def _check_closed_form(name: str, pixels: PixelResponse, fate: np.ndarray) -> None:
    """Raise ValueError, with the limit that excludes most pixels, if there is light but no closed form of any."""
    failed = fate == Fate.FAILED
    if failed.any() and not (fate == Fate.DETECTED).any():
        excluded = {words: int((failed & ~within).sum()) for words, within in pixels.limits().items()}
        raise OptionError(
            f"scene {name}: the light of none of the {len(fate)} detector pixels on the mirror has a closed form, "
            "which --estimator analytic, --target-nm and --parts need: its limit is "
            f"{max(excluded, key=lambda words: excluded[words])}; trace rays instead: --estimator adjoint"
        )


def _fates(pixels: PixelResponse, windows: Windows) -> np.ndarray:
    """What becomes of each pixel's light: a Fate [n]."""
    screen, on_screen = pixels.chief.scene.screen, np.ones(len(pixels.pixels), bool)
    for k, output in enumerate("uv"):
        centre, reach = pixels.extent(output)
        half = screen.pixels[k] / 2 * screen.pitch_xy_mm[k]
        on_screen &= np.abs(centre - screen.centre_offset_mm[k]) + reach <= half
    fate = np.where(on_screen, Fate.DETECTED, Fate.OFF_SCREEN)
    fate = np.where(pixels.valid(), fate, Fate.FAILED)
    return np.where(pixels.coverage() > 0, fate, Fate.MISSED_MIRROR)
