"""A mirror from a laboratory's images of fringes, their manifest and the design of its test."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from irtscots_cl.imaging.fringe_images import FringeImages, open_fringe_images
from irtscots_cl.imaging.fringes import FringeSet, FringeStack
from irtscots_cl.imaging.mask_files import read_mask
from irtscots_cl.imaging.orientation import stored, upright
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.coefficients import check_kind
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.measurement.frame_survey import survey_frames
from irtscots_cl.measurement.fringe_frames import frames_shown
from irtscots_cl.measurement.fringe_light import place_mm, places_of_light
from irtscots_cl.measurement.fringe_quality import (
    Exclusions,
    check_frame_values,
    check_frames,
    check_geometry,
    check_light,
    check_notes,
    check_pixels,
    check_saturation,
    exclusions,
)
from irtscots_cl.measurement.quality import WARNING, Check
from irtscots_cl.measurement.reconstruction import design_points
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates, ScreenCoordinates, find_mask, screen_coordinates
from irtscots_cl.measurement.screen_places import ScreenPlaces, surface_from_places
from irtscots_cl.measurement.unwrapping import MARGIN
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.fringes import FRINGES, FringeResult, fringe_facts, write_fringes
from irtscots_cl.pipeline.measure import RefusedImagesError, measured_facts, refuse_bad
from irtscots_cl.report.types import MeasuredFacts
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption

METHOD = "cubic"  # of integration
PRIOR_PERIODS = 0.1  # of the lowest series: how well the design is taken to tell a place, where no series does
COVERAGE = 0.5  # least share of a pixel's footprint that lies on the mirror


def measure_fringes(
    paths: Sequence[Path],
    scene: Scene,
    folder: Path,
    *,
    manifest: Path | None = None,
    strict: bool = False,
    zernike: str = "circular",
    saturation: float | None = None,
    mask: Path | None = None,
) -> MeasuredFacts:
    """Measure a mirror from images of fringes. Writes result.h5, report.json, scene.toml and figures into the folder
    and returns the main facts, named as in report.json.

    paths, manifest: see open_fringe_images. scene: only its design is used. strict: refuse doubtful images, too.
    zernike: kind of the terms that are fitted. saturation: of the camera's pixels. mask: file of the pixels that may be
    used, lying as the images do. Raises RefusedImagesError if a check says that the images are wrong, ValueError if
    they do not fit the scene or its manifest.
    """
    check_kind(zernike)
    nominal = scene.nominal()
    images = open_fringe_images(paths, nominal, manifest, saturation)
    detector = nominal.camera.detector
    columns, rows = detector.pixels
    use = None if mask is None else stored(read_mask(mask, (rows, columns), detector.orientation), detector.orientation)
    try:
        found, checks = fringe_surface(images, Setup(nominal), strict, use, saturation)
        bars = error_bars(found.result)
        assert bars is not None and found.reason is not None
        facts = measured_facts(found.result, FRINGES, bars, checks, zernike)
        refuse_bad(checks, strict)
    except ValueError as error:
        kind = RefusedImagesError if isinstance(error, RefusedImagesError) else ValueError
        raise kind(f"{images.manifest.path}: {error}") from None
    told = fringe_facts(found)
    told["excluded"] = Exclusions(found.reason).counts(found.stored(found.result.on_mirror))
    facts["fringes"] = told
    screen = "from 0 at the screen's -x (-y) edge to 1 at its +x (+y) edge"
    write_fringes(folder, found, facts, bars, {"screen fractions": screen})
    return facts


def fringe_surface(
    images: FringeImages,
    setup: Setup,
    strict: bool = False,
    use: BoolArray | None = None,
    saturation: float | None = None,
) -> tuple[FringeResult, list[Check]]:
    """The surface, and the checks of its images.

    use: pixels [rows, columns] of the images as stored that may be used; None: all. saturation: None for the least of
    what the files say and what the images show. Raises RefusedImagesError, ValueError.
    """
    survey = survey_frames(images.frames)
    checks = check_frame_values(survey, images.name)
    refuse_bad(checks, strict)
    ceiling = min(images.frames.saturation, survey.ceiling) if saturation is None else saturation
    stack = images.stack(ceiling)
    orientation = setup.scene.camera.detector.orientation
    on_mirror = setup.chief_rays.footprint.coverage >= COVERAGE
    lit = find_mask(stack, largest=False)
    mask = lit if use is None else lit & use
    design = _design_fractions(setup, stack)
    found = screen_coordinates(stack, mask=mask, prior=_prior(stack, design))
    interruption.check()
    shown = frames_shown(stack, found, design)
    frames = images.manifest.frames
    checks.append(
        check_frames(shown, lambda k: images.name(images.of_stack(k)), lambda k: frames[images.of_stack(k)].text)
    )
    refuse_bad(checks, strict)
    checks += check_notes(found) + _prior_note(found)
    why = exclusions(found, lit, use)
    checks.append(check_saturation(found, stored(on_mirror, orientation), ceiling))
    checks += check_geometry(found, setup, upright(lit, orientation), upright(why.used, orientation))
    refuse_bad(checks, strict)
    found, phases = places_of_light(found, setup, images.manifest.levels)
    why = exclusions(found, lit, use)
    used = upright(why.used, orientation)
    checks += check_light(found, phases, setup, used & on_mirror)
    checks.append(check_pixels(why.counts(stored(on_mirror, orientation))))
    refuse_bad(checks, strict)
    result = surface_from_places(
        _places(found, setup, used), setup, method=METHOD, pixel_average=False, min_coverage=COVERAGE
    )
    return FringeResult(result, found, reason=why.reason), checks


def _design_fractions(setup: Setup, stack: FringeStack) -> dict[str, FloatArray]:
    """Fractions [rows, columns] that the pixels of the images as stored would see, were the mirror the design."""
    screen, orientation = setup.scene.screen, setup.scene.camera.detector.orientation
    points = dict(zip("xy", design_points(setup)[2:], strict=True))

    def fraction(one: FringeSet) -> FloatArray:
        k = "xy".index(one.axis)
        return one.fraction(points[one.axis], screen.pixels[k], screen.pitch_xy_mm[k], screen.centre_offset_mm[k])

    return {one.axis: stored(fraction(one), orientation) for one in stack.sets}


def _needs_prior(one: FringeSet) -> bool:
    """Whether no series tells the place alone."""
    return min(one.periods) * (1 + 2 * MARGIN) > 1


def _prior(stack: FringeStack, design: dict[str, FloatArray]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """The design's places as priors for axes whose series leave the place open."""
    return {
        one.axis: (design[one.axis], np.full(stack.shape, PRIOR_PERIODS / min(one.periods)))
        for one in stack.sets
        if _needs_prior(one)
    }


def _prior_note(found: ScreenCoordinates) -> list[Check]:
    """What the design has to tell, by axis: nothing where the series tell it all the same."""
    return [_order_check(one) for one in found.axes.values() if one.islands or _needs_prior(one.fringes)]


def _order_check(one: AxisCoordinates) -> Check:
    axis, lowest = one.fringes.axis, min(one.fringes.periods)
    what = f"no {axis} fringes below one period: which fringe "
    if one.islands:
        gap = max((abs(island.gap_turns) for island in one.islands), key=lambda turns: np.nan_to_num(turns, nan=1.0))
        what += (
            f"{len(one.islands)} islands of pixels see is told by the design, {gap:.2g} of a period away; the worst is "
            f"wrong with probability {max(island.wrong for island in one.islands):.1g}"
        )
    else:
        what += (
            "a pixel sees is told by the design, right where the mirror sends light to less than "
            f"{1 / (2 * lowest):.2g} of the screen from the design's place"
        )
    return Check(f"order {axis}", WARNING, lowest, 1 / (1 + 2 * MARGIN), 0.0, what)


def _places(found: ScreenCoordinates, setup: Setup, used: BoolArray) -> ScreenPlaces:
    """Places in mm of the used pixels, upright."""
    screen, orientation = setup.scene.screen, setup.scene.camera.detector.orientation
    maps: list[FloatArray] = [place_mm(found.axes[axis], setup) for axis in "xy"]
    for k, axis in enumerate("xy"):
        one = found.axes[axis]
        scale = one.fringes.edge_fraction(np.ones(1), screen.pixels[k]) - one.fringes.edge_fraction(
            np.zeros(1), screen.pixels[k]
        )
        width = float(scale[0]) * screen.pixels[k] * screen.pitch_xy_mm[k]
        maps.append(upright(one.standard_error, orientation) * width)
    return ScreenPlaces(*(np.where(used, values, np.nan) for values in maps))
