"""Line positions of a scan against the lines of the scene's screen: what cannot be measured is refused before.

Positions that are not the screen's give heights that are wrong without a sign of it, or a light-curve model of
thousands of lines (positions in metres).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.imaging.orientation import TRANSPOSED
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.optics.chief_rays import ChiefRays
from irtscots_cl.scene.instrument import ORIENTATIONS, Camera
from irtscots_cl.scene.model import Scene

MAX_OFFSET = 0.5  # of the screen's pitch: from there on a line is another of the screen's lines
# Of the screen's pitch, where lines are missing: more may be lines of another width, their centres between pixels.
MAX_SUBSET_OFFSET = 0.25
UNITS = {"metres": 1e3, "centimetres": 10.0, "inches": 25.4, "micrometres": 1e-3}


def check_line_positions(scan: Scan, scene: Scene) -> None:
    """Raise ValueError if a scan's lines are not those of the scene's screen, within MAX_OFFSET of a pitch.

    The message names the dataset, both sets of lines and the likely cause. The number of lines must be the screen's.
    """
    problem = line_position_problem(scan, scene)
    if problem:
        raise ValueError(problem)


def line_position_problem(scan: Scan, scene: Scene) -> str:
    """What is wrong with a scan's line positions, in one line; "" if they are the screen's."""
    found, lines = scan.positions_mm, LineScan(scene).positions_mm(scan.axis)
    pitch = LineScan(scene).spacing_mm(scan.axis)
    if _fits(found, lines, pitch):
        return ""
    cause = next((name for name, corrected in _corrections(found, lines) if _fits(corrected, lines, pitch)), "")
    likely = f"; the positions seem to {cause}" if cause else ""
    return (
        f"/lines/{scan.axis}_mm: {_words(found)}; the screen of scene {scene.name} has {_words(lines)}; must agree "
        f"within half a pitch{likely}"
    )


def _fits(found: FloatArray, lines: FloatArray, pitch: float) -> bool:
    return bool(np.abs(found - lines).max() < MAX_OFFSET * pitch)


def _corrections(found: FloatArray, lines: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Common mistakes, in words that follow "the positions seem to", and the positions without each."""
    for name, factor in UNITS.items():
        yield f"be in {name}", found * factor
    if found[0] == 0:
        yield "be counted from the first line, not from the screen's centre", found + lines[0]
        for name, factor in UNITS.items():
            yield f"be in {name} and counted from the first line", found * factor + lines[0]
    yield "have the opposite sign: the scan is reversed", -found[::-1]
    yield f"be moved by {np.mean(found - lines):.6g} mm", found - np.mean(found - lines)
    if len(lines) > 1:
        pitch = np.diff(found).mean()
        name = "be numbers of lines" if pitch == 1 else "have another pitch"
        yield name, (found - found[0]) * ((lines[1] - lines[0]) / pitch) + lines[0]


def _words(positions: FloatArray) -> str:
    pitch = f", {np.diff(positions).mean():.6g} mm apart" if len(positions) > 1 else ""
    return f"{len(positions)} lines from {positions[0]:.6g} to {positions[-1]:.6g} mm{pitch}"


def with_all_lines(stack: ImageStack, scene: Scene) -> ImageStack:
    """The images with every line of the scene's screen: one that was not recorded has missing samples (NaN).

    Scans whose positions are not some of the screen's lines stay as they are; check_fits refuses them.
    """
    return replace(stack, x=_with_all_lines(stack.x, scene), y=_with_all_lines(stack.y, scene))


def _with_all_lines(scan: Scan, scene: Scene) -> Scan:
    found, lines = scan.positions_mm, LineScan(scene).positions_mm(scan.axis)
    if not 3 <= len(found) < len(lines) or scan.flux_w.shape[-1] != len(found):
        return scan
    at = np.abs(found[:, None] - lines).argmin(1)
    if (np.diff(at) < 1).any() or np.abs(found - lines[at]).max() > MAX_SUBSET_OFFSET * LineScan(scene).spacing_mm(
        scan.axis
    ):
        return scan
    positions, flux = lines.copy(), np.full((*scan.flux_w.shape[:-1], len(lines)), np.nan)
    positions[at], flux[..., at] = found, scan.flux_w
    return replace(scan, positions_mm=positions, flux_w=flux)


def check_fits(stack: ImageStack, chief: ChiefRays) -> None:
    """Raise ValueError if the images do not match the scene's detector and the lines of its screen."""
    nominal = chief.scene
    pattern = LineScan(nominal)
    if stack.x.shape != chief.shape or stack.y.shape != chief.shape:
        hint = _remedy(stack.x.shape, nominal.camera) if stack.x.shape == stack.y.shape else ""
        raise ValueError(
            f"scene {nominal.name}: images of {stack.x.shape} and {stack.y.shape} (rows, columns) do not fit; "
            f"must be of the scene's detector, {chief.shape}{hint}"
        )
    for scan in (stack.x, stack.y):
        lines = len(pattern.positions_mm(scan.axis))
        if len(scan.positions_mm) != lines:
            of_table = " by [screen.lines]" if nominal.screen.lines is not None else ""
            raise ValueError(
                f"{len(scan.positions_mm)} images in the {scan.axis} scan, but the scene's screen has {lines} "
                f"lines{of_table}"
            )
        check_line_positions(scan, nominal)
        if abs(scan.line_width - pattern.line_width) > 1e-9 * pattern.line_width:
            raise ValueError(
                f"lines of the {scan.axis} scan are {scan.line_width:g} times as wide as far apart, those of scene "
                f"{nominal.name} {pattern.line_width:g} times; must be as [screen.lines] says, width_px over step_px"
            )


def _remedy(found: tuple[int, int], camera: Camera) -> str:
    """What may make images of (rows, columns) fit, as the end of a message; "" if nothing is likely."""
    columns, rows = camera.detector.pixels
    if found == (columns, rows):
        same = camera.detector.orientation in TRANSPOSED
        words = ORIENTATIONS[: -len(TRANSPOSED)] if same else TRANSPOSED
        now = camera.detector.orientation
        return (
            f'; rows and columns are exchanged: camera.detector.orientation (now "{now}") is one of {", ".join(words)}'
        )
    if camera.intrinsics is None:
        return "; a region of interest or binning goes into roi_px and binning of [camera.intrinsics]"
    from irtscots_cl.scene.camera_intrinsics import picture_size  # imported late: few scenes have the table

    size, binning = picture_size(camera.intrinsics, camera.detector.pixels), camera.intrinsics.binning
    whole = (size[1] // binning[1], size[0] // binning[0])
    named = f"camera.detector.pixels = [{columns}, {rows}], roi_px = {list(camera.intrinsics.roi_px)}"
    named += f" and binning = {list(binning)} of [camera.intrinsics]"
    if found == (size[1], size[0]):
        what = "the whole picture that was calibrated"
    elif found == whole:
        what = "the whole picture, binned"
    elif found == (rows * binning[1], columns * binning[0]):
        what = "the region of interest without binning"
    else:
        return f"; {named} must say what of the picture was read out"
    return f"; the images are {what}, but the scene has {named}: cut or bin the images, or change these keys"
