"""The command `irtscots reconstruct`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from irtscots_cl.cli.camera_options import add_camera_files, camera_of, given_options
from irtscots_cl.cli.common import (
    LAB_MEASURE,
    add_measure,
    add_no_figures,
    add_usable_samples,
    command,
    print_json,
    print_tables,
    warn,
    warn_of,
)
from irtscots_cl.cli.exporting import add_export, export, export_targets, print_exported
from irtscots_cl.cli.terminal import next_step, results_page
from irtscots_cl.scene.presets import load_scene

if TYPE_CHECKING:
    from irtscots_cl.report.types import MeasuredFacts


def add(commands) -> None:
    parser = command(
        commands,
        "reconstruct",
        _execute,
        "measure a mirror from images of line scans, fringes, Gray codes or dots",
        "Writes report.html, report.json, result.h5, scene.toml and figures into the output folder.",
        example="out/result.h5 --scene sphere-deviated --out measured",
    )
    parser.add_argument(
        "images",
        type=Path,
        nargs="+",
        metavar="IMAGES",
        help="of line scans: HDF5 file with /images/x, /images/y [lines, rows, columns] and /lines/x_mm, /lines/y_mm, "
        "as `irtscots run` writes it. Of all patterns of `irtscots patterns`: its manifest, a folder with one, or "
        "image files or their folder with --manifest (TIFF, PNG, FITS, SER, NPZ, NPY, HDF5: a file may hold many "
        "frames); or a SOFAST measurement",
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
    add_no_figures(parser)
    add_export(parser)
    _add_image_choices(parser)
    parser.add_argument("--strict", action="store_true", help="refuse doubtful images too, with exit code 2")
    add_camera_files(parser)
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
    add_usable_samples(parser, choices=True)
    parser.add_argument(
        "--fiducials",
        type=Path,
        metavar="FILE",
        help="TOML or CSV table of marks on the mirror (name, x_mm, y_mm, size_mm, kind: dot or cross): they are "
        "looked for in the picture of the mirror, tell the mapping error, and their pixels are not used",
    )


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.formats.images import SUFFIXES
    from irtscots_cl.formats.sofast import is_sofast_measurement
    from irtscots_cl.imaging.fringe_images import is_fringe_input

    export_targets(options)
    if not 0 <= options.threshold < 1:
        raise ValueError(f"--threshold = {options.threshold}: must be at least 0 and below 1")
    if options.manifest is not None or is_fringe_input(options.images, SUFFIXES):
        return _by_manifest(options)
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
            raise ValueError(f"{option}: is of line scans; IMAGES is no line scan")


def _by_manifest(options: argparse.Namespace) -> int:
    """Images of patterns with a manifest, which tells what they are measured by."""
    from irtscots_cl.imaging.fringe_images import own_manifest
    from irtscots_cl.imaging.fringe_manifest import DOTS, GRAY, LINE, PICTURE, read_manifest

    path = own_manifest(options.images)[0] if options.manifest is None else options.manifest
    content = read_manifest(path).content
    if content == {PICTURE}:
        raise ValueError(f"{path}: frames: show pictures, which tell no places; nothing can be measured by them")
    _no_calibration_files(options)
    more = {}
    if content == {LINE}:
        more = {"threshold": options.threshold, "how": options.measure or LAB_MEASURE}
    else:
        _no_line_scans(options)
    scene = load_scene(options.scene)
    from irtscots_cl.measurement.coefficients import check_kind
    from irtscots_cl.measurement.methods import check_measure
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder

    if content == {LINE}:
        from irtscots_cl.pipeline.measure_lines import measure_lines as measure

        check_measure(more["how"], more["threshold"])
    elif content == {GRAY}:
        from irtscots_cl.pipeline.measure_gray import measure_gray as measure
    elif content == {DOTS}:
        from irtscots_cl.pipeline.measure_dots import measure_dots as measure
    else:
        from irtscots_cl.pipeline.measure_fringes import measure_fringes as measure
    check_kind(options.zernike)
    folder = options.out if options.out is not None else Path("irtscots-out") / f"{scene.name}-measured"
    check_output_folder(folder, ("result.h5", "report.json", "report.html", "scene.toml"), ("figures",))
    with made_folder(folder):
        facts = measure(
            options.images, scene, folder, manifest=options.manifest, strict=options.strict, draw=options.figures,
            zernike=options.zernike, camera=camera_of(options), mask=options.mask, fiducials=options.fiducials, **more
        )  # fmt: skip
    return _tell(options, facts, folder)


def _sofast(options: argparse.Namespace) -> int:
    """A SOFAST measurement, with a scene or a folder of calibration files."""
    _no_line_scans(options)
    for option in given_options(options):
        raise ValueError(f"{option}: must be left out of a SOFAST measurement, whose file has all its images")
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
            options.images, setup, folder, strict=options.strict, draw=options.figures, zernike=options.zernike,
            saturation=saturation, mask=options.mask, fiducials=options.fiducials
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
    check_output_folder(folder, ("result.h5", "report.json", "report.html", "scene.toml"), ("figures",))
    how = options.measure or LAB_MEASURE
    check_measure(how, options.threshold)
    check_kind(options.zernike)
    if (folder / "result.h5").resolve() == options.images.resolve():
        raise ValueError(f"--out = {str(folder)!r}: its result.h5 is the file of images; must be another folder")
    images = read_images(options.images, scene).saturating_at(options.saturation)
    from irtscots_cl.pipeline.picture import MaskChoice

    choice = MaskChoice.of(options.mask, options.fiducials, scene, scene.camera.detector.orientation)
    with made_folder(folder):
        facts = measure(
            images, scene.nominal(), folder, options.threshold, how, strict=options.strict, draw=options.figures,
            source=str(options.images), zernike=options.zernike, choice=choice, camera=camera_of(options),
        )  # fmt: skip
    return _tell(options, facts, folder)


def _tell(options: argparse.Namespace, facts: MeasuredFacts, folder: Path) -> int:
    from irtscots_cl.report.measurement_tables import measurement_tables
    from irtscots_cl.report.tables import cautions
    from irtscots_cl.system.atomic_files import plain

    warn_of(facts["checks"])
    for line in cautions(facts):
        warn(line)
    exported = export(folder, export_targets(options))
    if options.json:
        print_json(plain({**facts, **exported}))
    else:
        print_tables(measurement_tables(facts))
        print(f"results in {folder}")
        print_exported(exported)
        next_step(options, results_page(folder))
    return 0
