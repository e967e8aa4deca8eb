"""What measurements by places on the screen share that are no fringes: exclusions, checks, and the files written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from irtscots_cl.imaging.camera_files import CameraFiles
from irtscots_cl.imaging.fringe_images import FringeImages, open_fringe_images
from irtscots_cl.imaging.mask_files import DESIGN
from irtscots_cl.imaging.orientation import stored, upright
from irtscots_cl.maths.arrays import BoolArray, FloatArray
from irtscots_cl.measurement.error_bars import ErrorBars
from irtscots_cl.measurement.fringe_quality import Exclusions, Reason
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.optics.setup import Setup
from irtscots_cl.pipeline.fringes import screen_points
from irtscots_cl.pipeline.lab_camera import RecordedImages
from irtscots_cl.pipeline.output import draw_figures, open_output_folder, version_attributes
from irtscots_cl.pipeline.picture import HALF, MaskChoice
from irtscots_cl.report.along_axes import AlongAxes
from irtscots_cl.report.fringe_file import REASON_UNIT, Rows, screen_rows, surface_rows, write_rows
from irtscots_cl.report.types import MeasuredFacts
from irtscots_cl.scene.model import Scene
from irtscots_cl.system.atomic_files import replacing, write_json, write_text


def excluded(lit: BoolArray, failing: Mapping[Reason, BoolArray], use: BoolArray | None) -> Exclusions:
    """The reason for every pixel. failing: who fails which. use: pixels that may be used; None: all. All alike."""
    reason = np.where(lit, Reason.USED, Reason.DARK)
    for kind, wrong in failing.items():
        reason[(reason == Reason.USED) & wrong] = kind
    if use is not None:
        reason[~use] = Reason.MASKED
    return Exclusions(reason.astype(np.int64))


def open_places(
    paths: Sequence[Path],
    scene: Scene,
    manifest: Path | None,
    camera: CameraFiles | None,
    mask: Path | None,
    fiducials: Path | None,
) -> tuple[FringeImages, Setup, BoolArray | None]:
    """The images, the design's setup and the pixels to use; arguments and errors as of measure_fringes."""
    nominal = scene.nominal()
    images = open_fringe_images(paths, nominal, manifest, camera)
    setup = Setup(nominal)
    return images, setup, pixels_to_use(mask, fiducials, setup)


def pixels_to_use(mask: Path | None, fiducials: Path | None, setup: Setup) -> BoolArray | None:
    """Upright pixels [rows, columns] that may be used, by --mask; None: all. Raises ValueError for fiducials."""
    if fiducials is not None:
        raise ValueError("--fiducials: goes with fringes and line scans; must be left out of Gray codes and dots")
    choice = MaskChoice.of(mask, None, setup.scene, setup.scene.camera.detector.orientation)
    return setup.chief_rays.footprint.coverage >= HALF if choice.how == DESIGN else choice.use


def without_bad(why: Exclusions, recorded: RecordedImages, setup: Setup) -> Exclusions:
    """The reasons, with the camera's bad pixels among them."""
    if recorded.bad is None:
        return why
    bad = upright(recorded.bad, setup.scene.camera.detector.orientation)
    return Exclusions(np.where(bad, Reason.BAD, why.reason).astype(np.int64))


def median_errors(result: Reconstruction) -> AlongAxes:
    """Median standard errors of the used places in mm."""
    errors = result.place_errors_mm or (np.full(result.mask.shape, np.nan),) * 2
    x, y = (float(np.median(one[result.mask])) if result.mask.any() else float("nan") for one in errors)
    return {"x": x, "y": y}


def write_places(
    folder: Path,
    result: Reconstruction,
    why: Exclusions,
    own: Rows,
    facts: MeasuredFacts,
    bars: ErrorBars,
    draw: bool = True,
) -> None:
    """Write result.h5, figures, scene.toml, report.html and report.json.

    why, own: of upright maps; files hold them as stored. draw: false for no figures.
    """
    from irtscots_cl.report.page.page import write_measured_page

    nominal = result.nominal
    orientation = nominal.camera.detector.orientation
    rows: Rows = [("excluded", why.reason.astype(np.uint8), REASON_UNIT), *own]
    rows += [*screen_rows(screen_points(result), result), *surface_rows(result, bars)]
    in_file = [
        (name, stored(values, orientation) if _is_map(values, result) else values, unit) for name, values, unit in rows
    ]
    attributes = {
        "scene": nominal.to_toml(),
        "measure": facts["measure"],
        "orientation": orientation,
        "rows and columns": "those of the images in their file",
    }
    with open_output_folder(folder):
        write_rows(folder / "result.h5", in_file, attributes | version_attributes())
        draw_figures(folder, draw, partial(_draw, result))
        write_text(folder / "scene.toml", nominal.to_toml())
        write_measured_page(folder / "report.html", facts, result, bars)
        write_json(folder / "report.json", dict(facts))


def _draw(result: Reconstruction, folder: Path) -> None:
    from irtscots_cl.report.figures import height_figure, slope_figure  # Matplotlib: only where figures are made

    for name, figure in (("slopes.png", slope_figure(result)), ("height.png", height_figure(result, None))):
        with replacing(folder / name) as temporary:
            figure.savefig(temporary, dpi=120)


def _is_map(values: FloatArray, result: Reconstruction) -> bool:
    return values.shape[-2:] == result.mask.shape
