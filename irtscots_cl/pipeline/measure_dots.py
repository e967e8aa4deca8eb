"""A mirror from images of dots on the screen: places at the dots, and a coarse height map from what lies between."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.dots import dot_centres
from irtscots_cl.imaging.fringe_images import FringeImages
from irtscots_cl.imaging.lab_frames import is_saturated
from irtscots_cl.imaging.orientation import upright
from irtscots_cl.imaging.shown_frames import DARK, DOTS, WHITE
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.coefficients import check_kind
from irtscots_cl.measurement.dot_places import DotMap, DotPlaces, find_dots, interpolated
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.measurement.mirror_mask import mirror_mask
from irtscots_cl.measurement.quality import OK, WARNING, Check, orientation_check, outline_check
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.measurement.screen_places import ScreenPlaces, surface_from_places
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.lab_camera import RecordedImages, recorded_images
from irtscots_cl.pipeline.measure import measured_facts, named, refuse_bad
from irtscots_cl.pipeline.picture import HALF
from irtscots_cl.pipeline.places import excluded, median_errors, open_places, without_bad, write_places
from irtscots_cl.report.fringe_file import Rows
from irtscots_cl.report.types import MeasuredFacts
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption

DOT_MEASURE = "dots"
METHOD = "cubic"  # of integration


def measure_dots(
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
    """Measure a mirror from images of dots; arguments, files and errors as of measure_fringes. result.h5 holds the
    dots' places in /dots and how far each pixel is from the next one in /dots/distance_px."""
    check_kind(zernike)
    images, setup, use = open_places(paths, scene, manifest, camera, mask, fiducials)
    with named(images.manifest.path):
        return _measured(recorded_images(images), setup, folder, strict, use, zernike, draw)


def dots_of(
    images: FringeImages, setup: Setup, saturation: float, use: BoolArray | None = None
) -> tuple[DotPlaces, dict[str, int], BoolArray]:
    """The dots of all frames; how many were shown, seen and matched; and the lit pixels [rows, columns] upright.

    Raises ValueError without white frames, which tell the light of each pixel.
    """
    orientation, screen = setup.scene.camera.detector.orientation, setup.scene.screen
    white, dark = images.mean(WHITE), images.mean(DARK)
    if white is None:
        raise ValueError("frames: no white frame, which tells the light of each pixel; dots need one")
    black = np.zeros(white.shape) if dark is None else dark
    lit = mirror_mask(white - black, largest=False)
    on_mirror = upright(lit, orientation) & (setup.chief_rays.footprint.coverage >= 1 - 1e-6)
    on_mirror &= True if use is None else use
    design = design_points(setup)[2:]
    parts, shown, seen = [], 0, 0
    for number in images.manifest.numbers(DOTS):
        interruption.check()
        image = images.frames[number]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.where(is_saturated(image, saturation), np.nan, (image - black) / (white - black))
        centres = [
            (at - n / 2) * pitch + offset
            for at, n, pitch, offset in zip(
                dot_centres(images.manifest.frames[number], screen.pixels),
                screen.pixels,
                screen.pitch_xy_mm,
                screen.centre_offset_mm,
                strict=True,
            )
        ]
        known = (centres[0], centres[1]), (design[0], design[1])
        found, blobs = find_dots(upright(share, orientation), on_mirror, *known)
        parts.append(found)
        shown, seen = shown + len(centres[0]) * len(centres[1]), seen + blobs
    dots = DotPlaces.joined(parts)
    return dots, {"shown": shown, "seen": seen, "matched": len(dots)}, upright(lit, orientation)


def _measured(
    recorded: RecordedImages, setup: Setup, folder: Path, strict: bool, use: BoolArray | None, zernike: str, draw: bool
) -> MeasuredFacts:
    checks = list(recorded.checks)
    refuse_bad(checks, strict)
    dots, counts, lit = dots_of(recorded.images, setup, recorded.limit, use)
    design = design_points(setup)[2:]
    between = interpolated(dots, (design[0], design[1]))
    on_mirror = setup.chief_rays.footprint.coverage >= HALF
    inside = np.isfinite(between.u_mm + between.v_mm) & on_mirror & lit
    why = without_bad(excluded(inside, {}, use), recorded, setup)
    known = [np.where(why.used, place, np.nan) for place in (between.u_mm, between.v_mm)]
    checks.append(orientation_check(setup, known, list(setup.scene.screen.centre_offset_mm)))
    if checks[-1].level == OK:
        checks.append(outline_check(lit, setup))
    checks.append(_check_between(why.used & on_mirror, on_mirror, between, dots))
    refuse_bad(checks, strict)
    errors = [np.where(why.used, error, np.nan) for error in (between.u_error_mm, between.v_error_mm)]
    result = surface_from_places(
        ScreenPlaces(*known, *errors), setup, method=METHOD, pixel_average=False, min_coverage=HALF
    )
    bars = error_bars(result)
    assert bars is not None
    facts = measured_facts(result, DOT_MEASURE, bars, checks, zernike)
    refuse_bad(checks, strict)
    distance = between.distance_px[result.mask]
    facts["places"] = {
        "standard_error_mm": median_errors(result),
        "excluded": {reason: why.counts(on_mirror)[reason] for reason in ("used", "masked", "dark", "bad")},
        "dots": counts,
        "distance_px": {"median": float(np.median(distance)), "farthest": float(distance.max())},
    }
    recorded.add_facts(facts)
    write_places(folder, result, why, _rows(dots, between), facts, bars, draw)
    return facts


def _check_between(used: BoolArray, on_mirror: BoolArray, between: DotMap, dots: DotPlaces) -> Check:
    """What a height map of dots is, always as a warning."""
    share = float(used.sum() / max(on_mirror.sum(), 1))
    text = (
        f"{len(dots)} dots; {share:.0%} of the mirror's pixels lie between them, the farthest "
        f"{np.nanmax(np.where(used, between.distance_px, np.nan)):.3g} pixels from a dot's image; the height map is "
        "of these alone, and interpolated: its pixels err together, so that the height's error is larger than stated"
    )
    return Check("dots", WARNING, share, 1.0, 1e-6, text)


def _rows(dots: DotPlaces, between: DotMap) -> Rows:
    """Rows and columns of the dots are those of the upright grid."""
    lists: list[tuple[str, FloatArray, str]] = [
        ("dots/upright_row", dots.row, "pixels"),
        ("dots/upright_column", dots.column, "pixels"),
        ("dots/x_mm", dots.u_mm, "mm"),
        ("dots/y_mm", dots.v_mm, "mm"),
        ("dots/design_x_mm", dots.design_u_mm, "mm"),
        ("dots/design_y_mm", dots.design_v_mm, "mm"),
        ("dots/x_standard_error_mm", dots.u_error_mm, "mm"),
        ("dots/y_standard_error_mm", dots.v_error_mm, "mm"),
    ]
    return [*lists, ("dots/distance_px", between.distance_px, "pixels")]
