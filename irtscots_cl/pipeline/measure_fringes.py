"""A mirror from a laboratory's images of fringes, their manifest and the design of its test."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.fringe_images import open_fringe_images
from irtscots_cl.imaging.fringes import FringeSet, FringeStack
from irtscots_cl.imaging.orientation import stored, upright
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.coefficients import check_kind
from irtscots_cl.measurement.error_bars import error_bars
from irtscots_cl.measurement.fringe_costs import fraction_error, height_cost_nm
from irtscots_cl.measurement.fringe_factors import LIGHT, FrameFactors
from irtscots_cl.measurement.fringe_light import LightPhases, place_mm, places_of_light, places_with_harmonics
from irtscots_cl.measurement.fringe_quality import (
    Exclusions,
    check_geometry,
    check_light,
    check_notes,
    check_pixels,
    check_saturation,
    exclusions,
)
from irtscots_cl.measurement.harmonic_bias import HarmonicBias, harmonic_bias
from irtscots_cl.measurement.harmonic_map import second_harmonic_maps
from irtscots_cl.measurement.mirror_mask import mirror_mask
from irtscots_cl.measurement.quality import WARNING, Check
from irtscots_cl.measurement.reconstruction import Reconstruction, design_points
from irtscots_cl.measurement.screen_coordinates import AxisCoordinates, ScreenCoordinates, mirror_signal
from irtscots_cl.measurement.screen_places import ScreenPlaces, surface_from_places
from irtscots_cl.measurement.unwrapping import MARGIN
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.fringe_frames import check_light_and_dark, places_by_frames
from irtscots_cl.pipeline.fringes import FRINGES, FringeResult, add_picture_facts, fringe_facts, write_fringes
from irtscots_cl.pipeline.lab_camera import RecordedImages, recorded_images
from irtscots_cl.pipeline.measure import measured_facts, named, refuse_bad
from irtscots_cl.pipeline.picture import HALF, MaskChoice, MirrorPicture, look_at_mirror
from irtscots_cl.report.types import MeasuredFacts
from irtscots_cl.scene.model import Scene

METHOD = "cubic"  # of integration
PRIOR_PERIODS = 0.1  # of the lowest series: how well the design is taken to tell a place, where no series does


def measure_fringes(
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
    """Measure a mirror from images of fringes. Writes result.h5, report.json, scene.toml and figures into the folder
    and returns the main facts, named as in report.json.

    paths, manifest: see open_fringe_images. scene: only its design is used. strict: refuse doubtful images, too.
    zernike: kind of the terms that are fitted. camera: what is known about the camera, in place of what the manifest
    says. mask: "auto" (None), "design", or the file of the pixels that may be used, lying as the images do. fiducials:
    table of marks on the mirror. draw: false for no figures; an earlier measurement's are deleted.
    Raises RefusedImagesError if a check says that the images are wrong, ValueError if they do not fit the scene, its
    manifest, or the tables.
    """
    check_kind(zernike)
    nominal = scene.nominal()
    images = open_fringe_images(paths, nominal, manifest, camera)
    choice = MaskChoice.of(mask, fiducials, nominal, nominal.camera.detector.orientation)
    with named(images.manifest.path):
        recorded = recorded_images(images)
        found, checks = fringe_surface(recorded, Setup(nominal), strict, choice)
        bars = error_bars(found.result)
        assert bars is not None and found.reason is not None
        facts = measured_facts(found.result, FRINGES, bars, checks, zernike)
        refuse_bad(checks, strict)
    told = fringe_facts(found)
    told["excluded"] = Exclusions(found.reason).counts(found.stored(found.result.on_mirror))
    facts["fringes"] = told
    recorded.add_facts(facts)
    add_picture_facts(facts, found)
    screen = "from 0 at the screen's -x (-y) edge to 1 at its +x (+y) edge"
    write_fringes(folder, found, facts, bars, {"screen fractions": screen}, draw)
    return facts


def fringe_surface(
    recorded: RecordedImages,
    setup: Setup,
    strict: bool = False,
    choice: MaskChoice | None = None,
) -> tuple[FringeResult, list[Check]]:
    """The surface, and the checks of its images.

    choice: of the pixels that may be used. Raises RefusedImagesError, ValueError.
    """
    images, checks = recorded.images, list(recorded.checks)
    refuse_bad(checks, strict)
    stack = images.stack(recorded.ceiling)
    checks += check_light_and_dark(images, stack)
    refuse_bad(checks, strict)
    orientation = setup.scene.camera.detector.orientation
    on_mirror = setup.chief_rays.footprint.coverage >= HALF
    picture, lit = _picture_of(stack, setup, on_mirror, choice or MaskChoice())
    checks += picture.checks
    refuse_bad(checks, False)  # marks that are mirrored; warnings wait for the other checks
    masks = picture.masks(lit, on_mirror, orientation)
    design = _design_fractions(setup, stack)
    prior = _prior(stack, design)
    frames = places_by_frames(recorded, stack, design, prior, masks, setup, strict)
    found = frames.found
    checks += frames.checks + check_notes(found) + ([] if frames.coded else _prior_note(found))
    why = exclusions(found, **masks, bad=recorded.bad)
    clipping = on_mirror if recorded.bad is None else on_mirror & ~upright(recorded.bad, orientation)
    checks.append(
        check_saturation(found, stored(clipping, orientation), recorded.ceiling, frames.shown, images.name_in_stack)
    )
    checks += check_geometry(found, setup, lit, upright(why.used, orientation))
    refuse_bad(checks, strict)
    raw, keep = found, frames.coded
    found, phases = places_of_light(raw, setup, images.manifest.levels, keep_orders=keep)
    why = exclusions(found, **masks, bad=recorded.bad)
    used = upright(why.used, orientation)
    checks += check_light(found, phases, setup, used & on_mirror)
    checks.append(check_pixels(why.counts(stored(on_mirror, orientation))))
    refuse_bad(checks, strict)

    def surface(places: ScreenCoordinates) -> Reconstruction:
        return surface_from_places(
            places_in_mm(places, setup, used), setup, method=METHOD, pixel_average=False, min_coverage=HALF
        )

    result = surface(found)
    checks = _with_costs(
        checks, frames.factors, found, lambda errors: height_cost_nm(result, surface(_less(found, errors)))
    )
    left_in = _harmonics_left_in(
        result, raw, phases, lambda: surface(places_with_harmonics(raw, phases, orientation, keep))
    )
    second, transfer = second_harmonic_maps(frames.stack, found), frames.factors.transfer
    return FringeResult(
        result, found, reason=why.reason, picture=picture, transfer=transfer, second_harmonic=second, harmonics=left_in
    ), checks


def _picture_of(
    stack: FringeStack, setup: Setup, on_mirror: BoolArray, choice: MaskChoice
) -> tuple[MirrorPicture, BoolArray]:
    """What the picture of the mirror tells, and the pixels [rows, columns] upright that have light."""
    orientation = setup.scene.camera.detector.orientation
    signal = mirror_signal(stack)
    lit = upright(mirror_mask(signal, largest=False), orientation)
    return look_at_mirror(upright(signal, orientation), lit, setup.chief_rays, on_mirror, choice), lit


def _harmonics_left_in(
    result: Reconstruction,
    raw: ScreenCoordinates,
    phases: dict[str, LightPhases],
    other: Callable[[], Reconstruction],
) -> dict[str, HarmonicBias]:
    """What was taken out of the phases, by axis, with what it would cost in height. other: the surface without that."""
    bias = harmonic_bias(raw, phases, result.mask)
    if not bias:
        return {}
    nm = height_cost_nm(result, other())
    return {axis: replace(one, height_nm=nm) for axis, one in bias.items()}


def _less(found: ScreenCoordinates, errors: dict[str, FloatArray]) -> ScreenCoordinates:
    """The places less errors of their fractions."""
    axes = {a: replace(one, fraction=one.fraction - np.nan_to_num(errors[a])) for a, one in found.axes.items()}
    return replace(found, axes=axes)


def _rounded(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.1g}"


def _with_costs(
    checks: list[Check],
    factors: FrameFactors,
    found: ScreenCoordinates,
    cost_nm: Callable[[dict[str, FloatArray]], float],
) -> list[Check]:
    """The checks with what added light costs, those with the highest costs first."""
    added = next((one.added for one in factors.changes if one.added is not None), None)
    if added is None:
        return checks
    counts = [one.fringes.count for one in found.axes.values()]
    parts = np.split(added, np.cumsum(counts)[:-1])
    errors = {axis: fraction_error(one, part) for (axis, one), part in zip(found.axes.items(), parts, strict=True)}
    cost = cost_nm(errors)
    told = [
        replace(check, cost_nm=cost, text=f"{check.text}; it costs about {_rounded(cost)} nm of height")
        if check.name == LIGHT
        else check
        for check in checks
    ]
    return sorted(told, key=lambda check: -check.cost_nm if math.isfinite(check.cost_nm) else 0.0)


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


def places_in_mm(found: ScreenCoordinates, setup: Setup, used: BoolArray) -> ScreenPlaces:
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
