"""The command `irtscots reconstruct`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from irtscots_cl.cli.common import LAB_MEASURE, add_measure, command, print_json, print_tables, warn, warn_of
from irtscots_cl.scene.presets import load_scene


def add(commands) -> None:
    parser = command(
        commands,
        "reconstruct",
        _execute,
        "measure a mirror from line-scan images",
        "Writes result.h5 and figures into the output folder.",
    )
    parser.add_argument(
        "images",
        type=Path,
        metavar="IMAGES",
        help="HDF5 file with /images/x, /images/y "
        "[lines, rows, columns] and /lines/x_mm, /lines/y_mm, as `irtscots run` writes it",
    )
    parser.add_argument(
        "--scene",
        required=True,
        metavar="SCENE",
        help="preset name or path of a TOML file; only its design is used, no deviation",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder; default irtscots-out/NAME-measured")
    parser.add_argument(
        "--threshold",
        type=float,
        default=0.0,
        metavar="T",
        help="paper and fine: least part of a light curve's peak that counts for its centroid, 0 to below 1; "
        "default 0. It cuts off light too, which moves the centroids",
    )
    parser.add_argument(
        "--saturation",
        type=float,
        default=math.inf,
        metavar="V",
        help="value from which on a sample of the images is saturated and not used; default: the images' own ceiling, "
        "where they show one",
    )
    parser.add_argument(
        "--mask",
        type=Path,
        metavar="FILE",
        help="picture (PNG, TIFF), NPY array or HDF5 file with a dataset `mask`, of the images' size and lying as they "
        "do: pixels where it is 0 are not used",
    )
    parser.add_argument("--strict", action="store_true", help="refuse doubtful images too, with exit code 2")
    add_measure(parser, default=f"{LAB_MEASURE}, for images with noise and background")


def _execute(options: argparse.Namespace) -> int:
    if not 0 <= options.threshold < 1:
        raise ValueError(f"--threshold = {options.threshold}: must be at least 0 and below 1")
    scene = load_scene(options.scene)
    from irtscots_cl.imaging.image_files import read_images
    from irtscots_cl.measurement.coefficients import check_kind
    from irtscots_cl.measurement.methods import check_measure
    from irtscots_cl.pipeline.measure import measure
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder, plain

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
    from irtscots_cl.report.tables import cautions, measured_tables

    warn_of(facts["checks"])
    for line in cautions(facts):
        warn(line)
    if options.json:
        print_json(plain(facts))
    else:
        print_tables(measured_tables(facts))
        print(f"results in {folder}")
    return 0
