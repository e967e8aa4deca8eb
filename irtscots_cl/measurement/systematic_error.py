"""The systematic error of a measurement, predicted from its own result: a parametric bootstrap.

The measured surface is taken as if it were the truth. Its light curves without noise are computed on the scan's lines
and measured by the same method; what comes out differs from the known surface by the errors of all steps: sampling by
lines, averaging over pixels, pixels at the edge, integration, coupling of the height, what refinement leaves. The true
surface, which differs little from the measured one, has nearly the same error map. Neither is the truth needed, nor
noise.

Source: B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap (1993), sections 6.5 and 10.2 (bias).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.measurement.line_edges import line_edges, on_lines
from irtscots_cl.measurement.reconstruction import MIN_PIXELS, Reconstruction, reconstruct
from irtscots_cl.measurement.refinement import Fit, modelled, refine, zernike_fit
from irtscots_cl.optics.pixel.light import PixelLight
from irtscots_cl.optics.surface import Surface
from irtscots_cl.optics.surface_map import MappedChiefRays, PixelMap
from irtscots_cl.scene.model import Scene

PASSES = 3  # at most, of taking a large error off the surface
FINE_ORDER, FINE_PIXELS = 28, 3  # Zernike terms for a surface with fine structure: radial order, pixels for each
NOISE_MAPS, NOISE_ROOM = 2, 2.0  # sharper slopes have more fine noise than the maps: twice the squares
FINE = 0.3  # of the error and the noise together: smaller fine structure cannot change them by more than 5 %
LARGE = 0.1  # of the deviation: a larger error is worth a second pass, with the error taken off the surface
KNOWN_AGAIN = 0.9  # of the pixels: a measurement of fewer does not replace the result
SETTLED = 0.15  # relative change of the error's rms between passes


@dataclass(frozen=True)
class SystematicError:
    """A predicted error map, without noise. slope: rms (x, y) in rad. height_mm: rms, piston and tilt removed.

    error_mm: [rows, columns] the heights' error, NaN for pixels outside the result's height_mask and for those that the
    model lacks. settled: whether a further pass would change the rms little; if not, height_mm is the larger of the
    last two. lost: pixels of height_mask that the model lacks.
    """

    slope: tuple[float, float]
    height_mm: float
    error_mm: FloatArray = field(repr=False)
    settled: bool
    lost: int


def systematic_error(
    result: Reconstruction, stack: ImageStack, noise_mm: FloatArray | None = None
) -> SystematicError | None:
    """Predict the systematic error of a reconstruction of the stack; None if the model has too few pixels.

    Of the pixels of height_mask alone: no island without a known piston is in it. noise_mm: [draws, rows, columns]
    height maps of the size of the ray noise, which tell what part of the fine structure is noise; None without noise.
    """
    result = _joined_part(result)
    fit, best = zernike_fit(result), result.deviation_mm
    noise = 0.0 if noise_mm is None else float(np.sqrt(np.mean([rms(draw, result.mask) ** 2 for draw in noise_mm])))
    found = _measured_again(result, stack, _zernike_surface(result, fit, best), None)
    if found is None:
        return None
    finer, limit = result, FINE * float(np.hypot(found.height_mm, noise))
    # a plain centroid's own errors look like fine structure of the mirror
    if _large(result, found, noise) or _fine_structure(result, fit, best, noise_mm, limit) is not None:
        finer = _finer(result, stack)
        if finer is not result:
            best = np.where(finer.mask, finer.deviation_mm, result.deviation_mm)
            found = _measured_again(result, stack, _zernike_surface(result, fit, best), None) or found
            limit = FINE * float(np.hypot(found.height_mm, noise))
        if _fine_structure(result, fit, best, noise_mm, limit) is not None:
            fit = zernike_fit(result, FINE_ORDER, FINE_PIXELS)
            return _of_fine_structure(result, finer, stack, fit, noise_mm, limit)
    for _ in range(PASSES if finer is result else 0):
        if not _large(result, found, noise):
            break
        nearer = best - np.nan_to_num(found.error_mm)
        again = _measured_again(result, stack, _zernike_surface(result, fit, nearer), None)
        if again is None:
            break
        found = _settled(found, again, noise)
        if found.settled:
            break
    return found


def _settled(first: SystematicError, second: SystematicError, noise_mm: float) -> SystematicError:
    """The second of two predictions if they hardly differ beside the noise; else the larger one, as not settled."""
    if abs(second.height_mm - first.height_mm) <= SETTLED * np.hypot(second.height_mm, noise_mm):
        return second
    return dataclasses.replace(max(first, second, key=lambda error: error.height_mm), settled=False)


def _of_fine_structure(
    result: Reconstruction,
    finer: Reconstruction,
    stack: ImageStack,
    fit: Fit,
    noise_mm: FloatArray | None,
    limit_mm: float,
) -> SystematicError | None:
    """The error on a mirror with structure near the limit of the pixels.

    The measured surface shows such structure too weak, so the error comes out too small; taking the finer measurement's
    own error off brings it back, but overdoes it at the edge. Both are tried.
    """
    noise = 0.0 if noise_mm is None else float(np.sqrt(np.mean([rms(draw, result.mask) ** 2 for draw in noise_mm])))
    best = np.where(finer.mask, finer.deviation_mm, result.deviation_mm)

    def measured(how: Reconstruction, target: FloatArray) -> SystematicError | None:
        left = _fine_structure(result, fit, target, noise_mm, limit_mm)
        return _measured_again(how, stack, _zernike_surface(result, fit, target), left)

    first = measured(result, best)
    off = first if finer is result else measured(finer, best)
    if first is None or off is None:
        return None
    second = measured(result, best - np.nan_to_num(off.error_mm))
    return first if second is None else _settled(first, second, noise)


def _finer(result: Reconstruction, stack: ImageStack) -> Reconstruction:
    """The measurement that comes nearest to the truth: the result, or for plain centroids one with more exact steps."""
    if result.light_curve != "centroid" or result.updates_nm:
        return result
    try:
        # its error bars are not asked for, and each replicate costs as much as the mean
        finer = reconstruct(_of_means(stack), result.setup, light_curve="chord", method="cubic", pixel_average=False)
    except ValueError:  # of cubic: neighbours at one place
        return result
    known = finer.height_mask & result.mask
    if known.sum() < max(MIN_PIXELS, KNOWN_AGAIN * result.pixels_used):  # it joins other islands
        return result
    return dataclasses.replace(finer, mask=known, islands=None)


def _of_means(stack: ImageStack) -> ImageStack:
    """The stack with the means over its replicates alone."""
    x, y = (dataclasses.replace(s, flux_w=s.mean_w()[None], weights=np.ones(1)) for s in (stack.x, stack.y))
    return dataclasses.replace(stack, x=x, y=y)


def _joined_part(result: Reconstruction) -> Reconstruction:
    """The result on the pixels of height_mask alone."""
    if result.islands is None or result.islands.groups == 1:
        return result
    return dataclasses.replace(result, mask=result.height_mask, islands=None)


def _large(result: Reconstruction, found: SystematicError, noise_mm: float) -> bool:
    """Whether an error is so large that the measured surface with it may have another error than the true one."""
    left = remove_terms(result.x_mm, result.y_mm, result.deviation_mm, result.mask, "piston_tilt")
    return found.height_mm > max(LARGE * rms(left, result.mask), FINE * noise_mm)


def _zernike_surface(result: Reconstruction, fit: Fit, target_mm: FloatArray) -> Scene:
    """The design with the Zernike terms of a deviation [rows, columns], without piston over the mirror.

    A measured deviation has mean zero over the pixels. A mirror whose vertex is where the design has it has none over
    its disk; the difference, which no slope tells, looks like power.
    """
    scene = modelled(dataclasses.replace(result, deviation_mm=target_mm), fit)
    terms = scene.mirror.zernike[0]
    without = {noll: value for noll, value in terms.coefficients_um.items() if noll != 1}
    terms = dataclasses.replace(terms, coefficients_um=without)
    return dataclasses.replace(scene, mirror=dataclasses.replace(scene.mirror, zernike=(terms,)))


def _fine_structure(
    result: Reconstruction,
    fit: Fit,
    target_mm: FloatArray,
    noise_mm: FloatArray | None,
    limit_mm: float,
) -> FloatArray | None:
    """What the Zernike terms lack of a deviation, freed of noise, [rows, columns] in mm; None if below limit_mm rms."""
    known = _zernike_surface(result, fit, target_mm)
    fine = target_mm - Surface.of(known.mirror).deviation_at(result.x_mm, result.y_mm)[0]
    fine = fine - np.mean(fine[result.mask])
    total, noise = rms(fine, result.mask) ** 2, 0.0
    if total <= limit_mm**2:
        return None
    draws = [] if noise_mm is None else list(noise_mm[:NOISE_MAPS])
    for draw in draws:
        own = Surface.of(_zernike_surface(result, fit, draw).mirror).deviation_at(result.x_mm, result.y_mm)[0]
        noise += float(np.var((draw - own)[result.mask])) / len(draws)
    signal = total - NOISE_ROOM * noise
    if signal <= limit_mm**2:
        return None
    scaled: FloatArray = fine * (signal / total)  # Wiener's factor
    return scaled


def _measured_again(
    result: Reconstruction, stack: ImageStack, known: Scene, fine: FloatArray | None
) -> SystematicError | None:
    """The error of the same measurement on a known surface: a scene's, plus a map [rows, columns] in mm."""
    design, mask, x, y = result.setup.chief_rays, result.mask, result.x_mm, result.y_mm
    extra = None if fine is None else PixelMap.of(design, np.where(mask, fine, np.nan))
    chief = MappedChiefRays(known, extra)
    try:
        again = same_measurement(result, noise_free_stack(PixelLight.of(chief, np.flatnonzero(mask)), stack))
    except ValueError:  # too few pixels have light in the model
        return None
    both = mask & again.height_mask
    if both.sum() < MIN_PIXELS:
        return None
    truth = chief.surface.deviation_at(x, y)[0] + (0.0 if fine is None else fine)
    slopes = chief.surface.gradient(np.where(both, x, 0.0), np.where(both, y, 0.0))
    error = remove_terms(x, y, again.deviation_mm - truth, both, "piston_tilt")
    found = (again.slope_x - slopes[0], again.slope_y - slopes[1])
    return SystematicError(
        (rms(found[0], both), rms(found[1], both)), rms(error, both), error, True, int(np.sum(mask & ~both))
    )


def noise_free_stack(light: PixelLight, stack: ImageStack) -> ImageStack:
    """Images of modelled light, in arbitrary units, of the light's pixels on the stack's lines. Pixels whose light is
    not known are dark."""
    return ImageStack(_noise_free(light, stack.x), _noise_free(light, stack.y))


def _noise_free(light: PixelLight, scan: Scan) -> Scan:
    _, index, ours = np.intersect1d(scan.pixels, light.pixels, assume_unique=True, return_indices=True)
    screen = light.chief.scene.screen
    own = screen.pitch_xy_mm["xy".index(scan.axis)]
    pitch = np.diff(scan.positions_mm).mean() if len(scan.positions_mm) > 1 else own
    first, window = scan.first_line[index], scan.flux_w.shape[-1]
    edges = scan.positions_mm[0] + pitch * line_edges(first, window, scan.line_width)
    on_all = np.zeros((len(light.pixels), edges.shape[1]))
    on_all[ours] = edges
    flux = on_lines(light.light("uv"["xy".index(scan.axis)], on_all)[ours], scan.line_width)
    flux = np.where(light.valid()[ours][:, None], np.maximum(flux, 0.0), 0.0)
    return dataclasses.replace(
        scan,
        pixels=scan.pixels[index],
        first_line=first,
        flux_w=np.nan_to_num(flux)[None],
        weights=np.ones(1),
        hits=np.full(len(index), np.inf),
        saturation_w=np.inf,
    )


def same_measurement(result: Reconstruction, stack: ImageStack) -> Reconstruction:
    """Another stack of the same test, measured as the result was."""
    again = reconstruct(
        stack,
        result.setup,
        light_curve=result.light_curve,
        method=result.method,
        pixel_average=result.pixel_average,
    )
    return refine(again, stack, rounds=len(result.updates_nm)) if result.updates_nm else again
