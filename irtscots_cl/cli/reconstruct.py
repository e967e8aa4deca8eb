"""The command `irtscots reconstruct`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from irtscots_cl.cli.common import (
    LAB_MEASURE,
    add_measure,
    add_usable_samples,
    command,
    print_json,
    print_tables,
    warn,
    warn_of,
)
from irtscots_cl.scene.presets import load_scene

if TYPE_CHECKING:
    from irtscots_cl.report.types import MeasuredFacts


def add(commands) -> None:
    parser = command(
        commands,
        "reconstruct",
        _execute,
        "measure a mirror from images of line scans or fringes",
        "Writes result.h5 and figures into the output folder.",
    )
    parser.add_argument(
        "images",
        type=Path,
        nargs="+",
        metavar="IMAGES",
        help="of line scans: HDF5 file with /images/x, /images/y [lines, rows, columns] and /lines/x_mm, /lines/y_mm, "
        "as `irtscots run` writes it. Of fringes: the manifest that `irtscots patterns` writes, a folder with one, or "
        "image files or their folder with --manifest (TIFF, PNG, FITS, SER, NPZ); or a SOFAST measurement",
    )
    parser.add_argument(
        "--manifest",
        type=Path,
        metavar="FILE",
        help="manifest.toml of `irtscots patterns`, where IMAGES are images alone, in its frames' order",
    )
    parser.add_argument(
        "--scene",
        required=True,
        metavar="SCENE",
        help="preset name or path of a TOML file; only its design is used, no deviation. With a SOFAST measurement "
        "also the folder of the laboratory's calibration files: camera, display, spatial orientation, facet",
    )
    parser.add_argument(
        "--display",
        type=Path,
        metavar="FILE",
        help="with a folder as --scene: the display file to use; default: the folder's most complete one",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder; default irtscots-out/NAME-measured")
    _add_image_choices(parser)
    parser.add_argument("--strict", action="store_true", help="refuse doubtful images too, with exit code 2")
    add_measure(parser, default=f"{LAB_MEASURE}, for images with noise and background")


def _add_image_choices(parser: argparse.ArgumentParser) -> None:
    """Which samples of the images count."""
    parser.add_argument(
        "--threshold",
        type=float,
        default=0.0,
        metavar="T",
        help="paper and fine: least part of a light curve's peak that counts for its centroid, 0 to below 1; "
        "default 0. It cuts off light too, which moves the centroids",
    )
    add_usable_samples(parser)


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.formats.images import SUFFIXES
    from irtscots_cl.formats.sofast import is_sofast_measurement
    from irtscots_cl.imaging.fringe_images import is_fringe_input

    if not 0 <= options.threshold < 1:
        raise ValueError(f"--threshold = {options.threshold}: must be at least 0 and below 1")
    if options.manifest is not None or is_fringe_input(options.images, SUFFIXES):
        return _fringes(options)
    (options.images,) = options.images
    if is_sofast_measurement(options.images):
        return _sofast(options)
    _no_calibration_files(options)
    return _line_scans(options)


def _no_calibration_files(options: argparse.Namespace) -> None:
    is_lab = bool(options.scene) and any(Path(options.scene).glob("*.h5"))  # another folder is no scene at all
    for option, given in (("--scene", is_lab), ("--display", options.display is not None)):
        if given:
            raise ValueError(
                f"{option}: a folder of calibration files goes with a SOFAST measurement, which IMAGES is not"
            )


def _no_line_scans(options: argparse.Namespace) -> None:
    for option, given in (("--measure", options.measure), ("--threshold", options.threshold)):
        if given:
            raise ValueError(f"{option}: is of line scans; IMAGES is a measurement with fringes")


def _fringes(options: argparse.Namespace) -> int:
    """Images of fringes with a manifest."""
    from irtscots_cl.imaging.fringe_images import own_manifest

    if options.manifest is None:
        own_manifest(options.images)  # a folder without one is named before options that do not go with it
    _no_line_scans(options)
    _no_calibration_files(options)
    scene = load_scene(options.scene)
    from irtscots_cl.measurement.coefficients import check_kind
    from irtscots_cl.pipeline.measure_fringes import measure_fringes
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder

    check_kind(options.zernike)
    folder = options.out if options.out is not None else Path("irtscots-out") / f"{scene.name}-measured"
    check_output_folder(folder, ("result.h5", "report.json", "report.html", "scene.toml"), ("figures",))
    saturation = options.saturation if math.isfinite(options.saturation) else None
    with made_folder(folder):
        facts = measure_fringes(
            options.images, scene, folder, manifest=options.manifest, strict=options.strict, zernike=options.zernike,
            saturation=saturation, mask=options.mask
        )  # fmt: skip
    return _tell(options, facts, folder)


def _sofast(options: argparse.Namespace) -> int:
    """A SOFAST measurement, with a scene or a folder of calibration files."""
    _no_line_scans(options)
    from irtscots_cl.measurement.coefficients import check_kind
    from irtscots_cl.pipeline.measure_sofast import SofastSetup, measure_sofast
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder

    check_kind(options.zernike)
    path = Path(options.scene)
    if path.is_dir():
        setup = SofastSetup.of_folder(path, options.display)
    elif options.display is not None:
        raise ValueError("--display: goes with a folder of calibration files as --scene")
    else:
        setup = SofastSetup(scene=load_scene(options.scene))
    folder = options.out if options.out is not None else Path("irtscots-out") / f"{options.images.stem}-measured"
    check_output_folder(folder, ("result.h5", "report.json", "report.html", "scene.toml"), ("figures",))
    if (folder / "result.h5").resolve() == options.images.resolve():
        raise ValueError(f"--out = {str(folder)!r}: its result.h5 is the file of images; must be another folder")
    saturation = options.saturation if math.isfinite(options.saturation) else None
    with made_folder(folder):
        facts = measure_sofast(
            options.images, setup, folder, strict=options.strict, zernike=options.zernike, saturation=saturation,
            mask=options.mask
        )  # fmt: skip
    return _tell(options, facts, folder)


def _line_scans(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene)
    from irtscots_cl.imaging.image_files import read_images
    from irtscots_cl.measurement.coefficients import check_kind
    from irtscots_cl.measurement.methods import check_measure
    from irtscots_cl.pipeline.measure import measure
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder

    folder = options.out if options.out is not None else Path("irtscots-out") / f"{scene.name}-measured"
    check_output_folder(folder, ("result.h5", "report.json"), ("figures",))
    how = options.measure or LAB_MEASURE
    check_measure(how, options.threshold)
    check_kind(options.zernike)
    if (folder / "result.h5").resolve() == options.images.resolve():
        raise ValueError(f"--out = {str(folder)!r}: its result.h5 is the file of images; must be another folder")
    images = read_images(options.images, scene).saturating_at(options.saturation)
    use = None
    if options.mask is not None:
        from irtscots_cl.imaging.mask_files import read_mask

        columns, rows = scene.camera.detector.pixels
        use = read_mask(options.mask, (rows, columns), scene.camera.detector.orientation)
    with made_folder(folder):
        facts = measure(
            images, scene.nominal(), folder, options.threshold, how, strict=options.strict,
            source=str(options.images), zernike=options.zernike, use=use
        )  # fmt: skip
    return _tell(options, facts, folder)


def _tell(options: argparse.Namespace, facts: MeasuredFacts, folder: Path) -> int:
    from irtscots_cl.report.fringe_tables import fringe_tables
    from irtscots_cl.report.tables import cautions, measured_tables
    from irtscots_cl.system.atomic_files import plain

    warn_of(facts["checks"])
    for line in cautions(facts):
        warn(line)
    if options.json:
        print_json(plain(facts))
    else:
        print_tables(measured_tables(facts) + fringe_tables(facts))
        print(f"results in {folder}")
    return 0
