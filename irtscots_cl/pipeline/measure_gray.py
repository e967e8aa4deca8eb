"""A mirror from images of a Gray code: alone, or with one number of fringes whose orders it tells."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.fringe_images import FringeImages
from irtscots_cl.imaging.gray_code import gray_sets
from irtscots_cl.imaging.lab_frames import is_saturated
from irtscots_cl.imaging.orientation import upright
from irtscots_cl.imaging.shown_frames import DARK, WHITE
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.coefficients import check_kind
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.measurement.fringe_quality import WRONG_ORDER, Reason, check_pixels
from irtscots_cl.measurement.gray_code import GrayImages, GrayShares, gray_shares, noise_of_gaps
from irtscots_cl.measurement.gray_places import GrayPlaces, gray_frames_shown, gray_places, on_grid
from irtscots_cl.measurement.mirror_mask import mirror_mask
from irtscots_cl.measurement.quality import ERROR, OK, WARNING, Check, orientation_check, outline_check
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.measurement.screen_places import ScreenPlaces, surface_from_places
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.lab_camera import RecordedImages, recorded_images
from irtscots_cl.pipeline.measure import measured_facts, named, refuse_bad
from irtscots_cl.pipeline.picture import HALF
from irtscots_cl.pipeline.places import excluded, median_errors, open_places, without_bad, write_places
from irtscots_cl.report.types import MeasuredFacts
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption

GRAY_MEASURE = "gray"
METHOD = "cubic"  # of integration
MODEL_LIMIT = 0.05  # of a share that noise does not explain, from which on it is named


def images_of_code(images: FringeImages, setup: Setup, saturation: float) -> dict[str, GrayImages]:
    """By axis the samples of the pixels of setup.pixel_light; saturated ones are missing."""
    orientation, pixels = setup.scene.camera.detector.orientation, setup.pixel_light.pixels

    def flat(image: np.ndarray | None) -> FloatArray | None:
        return None if image is None else np.asarray(upright(image, orientation).ravel()[pixels], float)

    def sample(number: int) -> FloatArray:
        interruption.check()
        image = images.frames[number]
        values = flat(image)
        assert values is not None
        return np.where(upright(is_saturated(image, saturation), orientation).ravel()[pixels], np.nan, values)

    dark, white = flat(images.mean(DARK)), flat(images.mean(WHITE))
    if white is not None:
        white = np.where(white >= saturation, np.nan, white)
    counts = [max(len(images.manifest.numbers(shows)), 1) for shows in (DARK, WHITE)]
    found = {}
    for axis, (code, numbers) in gray_sets(images.manifest.frames).items():
        planes, inverted = (
            np.stack([sample(numbers[bit, kind]) for bit in range(code.planes)]) if not kind or code.inverted else None
            for kind in (False, True)
        )
        assert planes is not None
        found[axis] = GrayImages(code, planes, inverted, dark, white, *counts)
    return found


def check_gray_frames(
    images: FringeImages,
    shares: dict[str, GrayShares],
    places: list[dict[str, FloatArray]],
    setup: Setup,
    used: BoolArray,
) -> Check:
    """Whether every plane shows itself. used: [n] pixels of setup.pixel_light."""
    shown = gray_frames_shown(shares, places, setup, used)
    planes = [(axis, bit) for axis, one in shares.items() for bit in range(one.code.planes)]
    numbers = {axis: numbers for axis, (_, numbers) in gray_sets(images.manifest.frames).items()}
    if not shown.wrong.size:
        return Check("gray frames", OK, 0.0, 0.0, 1e-9, "every plane of the Gray code shows itself")

    def told(k: int) -> str:
        axis, bit = planes[k]
        return images.manifest.frames[numbers[axis][bit, False]].text

    said = "; ".join(
        f"{images.name(numbers[planes[k][0]][planes[k][1], False])} shows {told(int(shown.shows[k]))}, not {told(k)}"
        for k in map(int, shown.wrong[:6])
    )
    return Check("gray frames", ERROR, float(len(shown.wrong)), 0.0, 1e-9, said)


def measure_gray(
    paths: Sequence[Path],
    scene: Scene,
    folder: Path,
    *,
    manifest: Path | None = None,
    strict: bool = False,
    zernike: str = "circular",
    camera: CameraFiles | None = None,
    mask: Path | None = None,
    fiducials: Path | None = None,
    draw: bool = True,
) -> MeasuredFacts:
    """Measure a mirror from images of a Gray code alone; arguments, files and errors as of measure_fringes."""
    check_kind(zernike)
    images, setup, use = open_places(paths, scene, manifest, camera, mask, fiducials)
    with named(images.manifest.path):
        return _measured(recorded_images(images), setup, folder, strict, use, zernike, draw)


def _measured(
    recorded: RecordedImages, setup: Setup, folder: Path, strict: bool, use: BoolArray | None, zernike: str, draw: bool
) -> MeasuredFacts:
    images, checks = recorded.images, list(recorded.checks)
    refuse_bad(checks, strict)
    samples = images_of_code(images, setup, recorded.limit)
    shares, found = _places(samples, setup)
    lit = mirror_mask(on_grid(_signal(samples), setup), largest=False)
    pixels = setup.pixel_light.pixels
    design = dict(zip("xy", (points.ravel()[pixels] for points in design_points(setup)[2:]), strict=True))
    places = [design, {axis: one.place_mm for axis, one in found.items()}]
    checks.append(check_gray_frames(images, shares, places, setup, lit.ravel()[pixels]))
    refuse_bad(checks, strict)
    x, y = (on_grid(found[axis].place_mm, setup) for axis in "xy")
    wrong = on_grid(np.fmax(found["x"].wrong, found["y"].wrong), setup)
    why = excluded(lit, {Reason.SATURATED: ~np.isfinite(x + y), Reason.ORDER: ~(wrong <= WRONG_ORDER)}, use)
    why = without_bad(why, recorded, setup)
    known = [np.where(why.used, place, np.nan) for place in (x, y)]
    checks.append(orientation_check(setup, known, list(setup.scene.screen.centre_offset_mm)))
    if checks[-1].level == OK:
        checks.append(outline_check(lit, setup))
    on_mirror = setup.chief_rays.footprint.coverage >= HALF
    checks += [_check_model(max(one.floor for one in found.values())), check_pixels(why.counts(on_mirror))]
    refuse_bad(checks, strict)
    errors = [np.where(why.used, on_grid(found[axis].error_mm, setup), np.nan) for axis in "xy"]
    result = surface_from_places(
        ScreenPlaces(*known, *errors), setup, method=METHOD, pixel_average=False, min_coverage=HALF
    )
    bars = error_bars(result)
    assert bars is not None
    facts = measured_facts(result, GRAY_MEASURE, bars, checks, zernike)
    refuse_bad(checks, strict)
    facts["places"] = {
        "standard_error_mm": median_errors(result),
        "excluded": why.counts(on_mirror),
        "pixels_with_wrong_cell": float(np.nansum(wrong[result.mask])),
        "share_floor": {"x": found["x"].floor, "y": found["y"].floor},
    }
    recorded.add_facts(facts)
    write_places(folder, result, why, [("gray/wrong_cell_probability", wrong, "1")], facts, bars, draw)
    return facts


def _places(samples: dict[str, GrayImages], setup: Setup) -> tuple[dict[str, GrayShares], dict[str, GrayPlaces]]:
    """Shares and places by axis."""
    shares = {axis: gray_shares(one) for axis, one in samples.items()}
    found = {axis: gray_places(one, setup) for axis, one in shares.items()}
    interruption.check()
    if not samples["x"].code.inverted:  # nothing but the fit tells their noise well
        noise = {axis: noise_of_gaps(samples[axis], one.gap) for axis, one in found.items()}
        shares = {axis: gray_shares(one, noise[axis]) for axis, one in samples.items()}
        found = {axis: gray_places(one, setup) for axis, one in shares.items()}
    return shares, found


def _signal(samples: dict[str, GrayImages]) -> FloatArray:
    """How bright white is over black, [n]."""
    one = samples["x"]
    if one.white is not None:
        white = np.where(np.isfinite(one.white), one.white, np.nanmax(one.white, initial=0.0))  # saturated: lit
        return white - (0.0 if one.dark is None else one.dark)
    assert one.inverted is not None
    spread: FloatArray = np.nanmax(np.abs(one.planes - one.inverted), axis=0)
    return spread


def _check_model(floor: float) -> Check:
    if floor <= MODEL_LIMIT:
        text = "the planes' edges are as blurred as the design's light has it"
        return Check("gray model", OK, floor, MODEL_LIMIT, 1e-6, text)
    text = (
        f"shares of the Gray code's planes depart by {floor:.2f} from what the design's light makes of them, beyond "
        "their noise: the aperture's diameter, the focus, the screen's gamma or stray light"
    )
    return Check("gray model", WARNING, floor, MODEL_LIMIT, 1e-6, text)
