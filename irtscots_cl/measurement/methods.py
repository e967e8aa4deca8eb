"""Named measurement methods, from the paper's to the most exact one."""

from __future__ import annotations

from dataclasses import dataclass

from irtscots_cl.imaging.image_stack import ImageStack
from irtscots_cl.measurement.one_scan import ScanEstimate
from irtscots_cl.measurement.reconstruction import Reconstruction, reconstruct
from irtscots_cl.measurement.refinement import refine
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.option_error import OptionError


@dataclass(frozen=True)
class Measure:
    """light_curve, method, pixel_average: arguments of `reconstruct`. rounds: largest number of refinement rounds;
    tolerance_nm: change of a round that ends them."""

    light_curve: str = "centroid"
    method: str = "southwell"
    pixel_average: bool = True
    rounds: int = 0
    tolerance_nm: float = 1e-3


MEASURES = {
    "paper": Measure(),  # plain centroids and Southwell's integration, as in the paper
    "fine": Measure("chord", "cubic", pixel_average=False),
    "refined": Measure("chord", "cubic", pixel_average=False, rounds=4),
    # of signed samples, with the background and the noise of the images: for a laboratory's images
    "windowed": Measure("windowed", "cubic", pixel_average=False, rounds=3, tolerance_nm=0.5),
    "likelihood": Measure("likelihood", "cubic", pixel_average=False, rounds=3, tolerance_nm=0.5),
}

NOISE_FREE = ("paper", "fine", "refined")  # for images without background and camera noise
BEST = "likelihood"  # of a laboratory's images: unbiased, with least noise


def check_measure(name: str, threshold: float = 0.0) -> Measure:
    """The method `name` of MEASURES. Raises ValueError for an unknown name, or if it cannot use a threshold."""
    if name not in MEASURES:
        raise OptionError(f"--measure = {name!r}: must be one of {', '.join(MEASURES)}")
    how = MEASURES[name]
    if how.rounds and threshold > 0:
        raise OptionError(
            f"--threshold = {threshold}: --measure {name} needs whole light curves; must be 0, or with --measure paper "
            "or fine"
        )
    return how


def measure_by(
    name: str,
    stack: ImageStack,
    nominal: Scene | Setup,
    threshold: float = 0.0,
    estimates: tuple[ScanEstimate, ScanEstimate] | None = None,
) -> Reconstruction:
    """Measure the surface by the method `name` of MEASURES. estimates: see `reconstruct`.

    Raises ValueError for an unknown name, and the errors of `reconstruct`.
    """
    how = check_measure(name, threshold)
    result = reconstruct(
        stack,
        nominal,
        light_curve=how.light_curve,
        method=how.method,
        pixel_average=how.pixel_average,
        threshold=threshold,
        estimates=estimates if how.light_curve == BEST else None,
    )
    return refine(result, stack, rounds=how.rounds, tolerance_nm=how.tolerance_nm) if how.rounds else result
