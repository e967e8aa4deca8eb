"""Measure a mirror from images alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from irtscots_cl.analysis.comparison import HEIGHT_TERMS
from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.coefficients import check_kind, coefficients
from irtscots_cl.measurement.error_bars import ErrorBars, error_bars
from irtscots_cl.measurement.light_curves import Flag
from irtscots_cl.measurement.line_positions import check_fits, with_all_lines
from irtscots_cl.measurement.methods import BEST, MEASURES, measure_by
from irtscots_cl.measurement.one_scan import ScanEstimate
from irtscots_cl.measurement.quality import ERROR, OK, WARNING, Check, check_images, worst
from irtscots_cl.measurement.reconstruction import SIGNED, Reconstruction
from irtscots_cl.measurement.saturation import find_ceiling
from irtscots_cl.measurement.scan_estimates import estimate_centroids
from irtscots_cl.measurement.screen_places import PLACES
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.output import draw_figures, open_output_folder, version_attributes
from irtscots_cl.pipeline.picture import HALF, MaskChoice, MirrorPicture, add_facts, picture_of_scans
from irtscots_cl.report.along_axes import AlongAxes
from irtscots_cl.report.quality import check_facts, fit_facts, island_facts, misfit_facts, quality_checks
from irtscots_cl.report.result_file import write_result
from irtscots_cl.report.types import HeightErrors, MeasuredFacts, Refused
from irtscots_cl.scene.model import Scene
from irtscots_cl.system import interruption
from irtscots_cl.system.atomic_files import plain, write_json, write_text

if TYPE_CHECKING:
    from irtscots_cl.pipeline.lab_lines import CalibratedLines

DIFFERENCE = 3.0  # standard errors of the height: a measure that differs by more from the best one is named


class RefusedImagesError(ValueError):
    """The images cannot be of this scene, or cannot be measured. The message is one line."""


@contextmanager
def named(source: object) -> Iterator[None]:
    """Errors of what is done within are named by their source, a file; a refusal stays a refusal."""
    try:
        yield
    except ValueError as error:
        kind = RefusedImagesError if isinstance(error, RefusedImagesError) else ValueError
        raise kind(f"{source}: {error}") from None


def measure(
    stack: ImageStack,
    nominal: Scene,
    folder: Path,
    threshold: float = 0.0,
    how: str = BEST,
    *,
    strict: bool = False,
    source: str = "images",
    zernike: str = "circular",
    choice: MaskChoice | None = None,
    camera: CameraFiles | None = None,
    draw: bool = True,
) -> MeasuredFacts:
    """Measure a mirror from images alone, without a truth to compare with.

    how: a name of methods.MEASURES. strict: refuse doubtful images, too. source: the images' file, for messages.
    zernike: kind of the terms that are fitted, of coefficients.KINDS. choice: of the pixels that may be used, and of
    marks on the mirror. camera: what is known about the camera that the images come from. draw: false for no figures;
    an earlier measurement's are deleted. Writes result.h5, figures, scene.toml, report.html and report.json into the
    folder and returns the main facts, named as in report.json. Raises RefusedImagesError if a check says that the
    images are wrong, ValueError if they do not fit the scene or cannot be measured.
    """
    from irtscots_cl.report.page.page import write_measured_page

    check_kind(zernike)
    with named(source):
        choice = choice or MaskChoice()
        known = _calibrated(stack, nominal, camera)
        before = [] if known is None else known.checks
        refuse_bad(before, strict)
        if known is not None:
            stack, choice = known.stack, replace(choice, use=known.usable(choice.use))
        setup = Setup(nominal)
        stack = with_all_lines(stack, nominal)
        check_fits(stack, setup.chief_rays)
        stack = stack.saturating_at(min(find_ceiling(stack), stack.x.saturation_w, stack.y.saturation_w))
        result, bars, picture, checks = _measured(stack, setup, threshold, how, strict, choice)
        facts = measured_facts(result, how, bars, before + checks, zernike)
        if picture is not None:
            add_facts(facts, picture)
        if known is not None:
            facts["camera"] = known.facts
        refuse_bad(checks, strict)
    attributes = {"scene": nominal.to_toml(), "measure": how} | version_attributes()
    with open_output_folder(folder):
        write_result(folder / "result.h5", stack, result, attributes, bars)
        draw_figures(folder, draw, partial(_draw, stack, result))
        write_text(folder / "scene.toml", nominal.to_toml())
        write_measured_page(folder / "report.html", facts, result, bars, stack)
        write_json(folder / "report.json", plain(facts))
    return facts


def _draw(stack: ImageStack, result: Reconstruction, folder: Path) -> None:
    from irtscots_cl.report.figures import write_figures  # Matplotlib: only where figures are made

    write_figures(folder, stack, result, None)


def _calibrated(stack: ImageStack, nominal: Scene, camera: CameraFiles | None) -> CalibratedLines | None:
    """The images with what is known about their camera; None where that changes nothing."""
    if camera is None or not camera.changes_frames:
        return None
    from irtscots_cl.pipeline.lab_lines import calibrated_lines  # few images come with calibration frames

    return calibrated_lines(stack, camera, nominal.camera.detector.orientation)


def _measured(
    stack: ImageStack, setup: Setup, threshold: float, how: str, strict: bool, choice: MaskChoice
) -> tuple[Reconstruction, ErrorBars | None, MirrorPicture | None, list[Check]]:
    """The surface, error bars, what the picture of the mirror tells, and checks. stack: with its ceiling."""
    if choice.use is not None:
        stack = stack.masked(choice.use)
    picture = picture_of_scans(stack, setup.chief_rays, choice)
    if picture is not None:
        on_mirror = setup.chief_rays.footprint.coverage >= HALF
        if (picture.off_edge & on_mirror | picture.on_mark).any():
            stack = stack.masked(~(picture.off_edge | picture.on_mark))
    estimates = estimate_centroids(stack, setup, BEST)
    interruption.check()
    checks = check_images(stack, setup, estimates)
    refuse_bad(checks, strict)
    checks += [] if picture is None else picture.checks
    refuse_bad(checks, strict)
    try:
        result = measure_by(how, stack, setup, threshold, estimates)
        bars = error_bars(result)
        if MEASURES[how].light_curve not in SIGNED:
            best = measure_by(BEST, stack, setup, estimates=estimates)
            checks.append(_against_best(result, best, how, threshold))
    except ValueError as error:
        doubts = "".join(f"; {check.name}: {check.text}" for check in checks if check.level == WARNING)
        raise ValueError(f"{error}{doubts}") from None
    refuse_bad(checks, strict)
    return result, bars, picture, checks


def refuse_bad(checks: list[Check], strict: bool) -> None:
    """Raise RefusedImagesError for checks with errors; strict: for warnings, too."""
    level = worst(checks)
    if level == ERROR or (strict and level == WARNING):
        bad = "; ".join(f"{check.name}: {check.text}" for check in checks if check.level == level)
        raise RefusedImagesError(f"{bad}{' (--strict)' if level == WARNING else ''}")


def _against_best(result: Reconstruction, best: Reconstruction, how: str, threshold: float) -> Check:
    """How far the height by a measure that takes images for free of noise and background is from the best one."""
    bars = error_bars(best)
    both = result.height_mask & best.height_mask
    differ = remove_terms(best.x_mm, best.y_mm, result.deviation_mm - best.deviation_mm, both, "piston_tilt")
    value = rms(differ, both) * 1e6
    limit = DIFFERENCE * max(rms(bars.height_mm, both) * 1e6 if bars else 0.0, 1.0)
    name = f"--threshold {threshold:g}" if threshold else f"--measure {how}"
    text = (
        f"the height by {name} differs by {value:.3g} nm rms from that by {BEST}, "
        "which noise and background do not bias"
    )
    return Check("measure", WARNING if value > limit else OK, value, limit, 1e-3, text)


def measured_facts(
    result: Reconstruction, how: str, bars: ErrorBars | None, checks: list[Check], zernike: str
) -> MeasuredFacts:
    """The facts; adds what islands, misfit and Zernike fit show to the checks."""
    curves = result.light_curve != PLACES
    joined = result.height_mask
    left = {t: remove_terms(result.x_mm, result.y_mm, result.deviation_mm, joined, t) for t in HEIGHT_TERMS}
    deviation = {terms: rms(height, joined) * 1e6 for terms, height in left.items()}
    found = coefficients(result, kind=zernike, bars=bars)
    slope_noise = (bars.slope_x, bars.slope_y) if bars else None
    islands, misfit = island_facts(result, result.deviation_mm), misfit_facts(result.misfit(slope_noise))
    fit, hole = fit_facts(found), result.nominal.mirror.obscuration_mm > 0
    checks += quality_checks(islands, misfit, fit, hole)
    columns = zip(found.fit.nolls, found.um.tolist(), found.standard_error_um.tolist(), found.fit.inflation.tolist(),
                  strict=True)  # fmt: skip
    unknown = float("nan")
    slopes = {a: rms(getattr(bars, f"slope_{a}"), result.mask) * 1e6 if bars else unknown for a in ("x", "y")}
    bound = dict.fromkeys(("x", "y"), unknown)
    for estimate in result.estimates_of_scans or ():
        bound[estimate.scan.axis] = _of_bound(estimate)
    return {
        "scene": result.nominal.name,
        "measure": how,
        "refinement_updates_nm": list(result.updates_nm),
        "refinement_converged": result.converged,
        "pixels_used": result.pixels_used,
        "light_curves_refused": cast("Refused", result.refused()),
        "pixels_with_traced_light": int(result.light_traced().sum()) if curves else 0,
        "pixels_without_model": int(result.without_model().sum()) if curves else 0,
        "deviation_nm_rms": cast("HeightErrors", deviation),
        "deviation_nm_pv": float(np.nanmax(left["piston_tilt"]) - np.nanmin(left["piston_tilt"])) * 1e6,
        "slope_standard_error_urad": cast("AlongAxes", slopes),
        "height_standard_error_nm": rms(bars.height_mm, joined) * 1e6 if bars else unknown,
        "of_bound": cast("AlongAxes", bound),
        "zernike": [
            {"noll": noll, "output_um": um, "standard_error_um": error, "inflation": inflation}
            for noll, um, error, inflation in columns
        ],
        "zernike_fit": fit,
        "islands": islands,
        "integration_misfit": misfit,
        "checks": check_facts(checks),
    }


def _of_bound(estimate: ScanEstimate) -> float:
    """Standard error of the centroids over its Cramer-Rao bound, the median over the good curves."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = (estimate.error_mm / estimate.bound_mm)[estimate.flags == Flag.GOOD]
    ratio = ratio[np.isfinite(ratio)]
    return float(np.median(ratio)) if ratio.size else float("nan")
