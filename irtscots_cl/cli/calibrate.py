"""The command `irtscots calibrate`."""

from __future__ import annotations

import argparse
from pathlib import Path

from irtscots_cl.cli.common import add_usable_samples, command, print_json, print_tables, warn_of
from irtscots_cl.cli.terminal import next_step, path_of_scene, quoted
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene

FILES = ("scene.toml", "report.json", "calibration.h5")


def add(commands) -> None:
    parser = command(
        commands,
        "calibrate",
        _execute,
        "find the geometry of a set-up from its images",
        "Writes scene.toml with the fitted geometry, report.json and calibration.h5 (covariance, residuals, heights) "
        "into the output folder.",
        example="out/result.h5 --scene sphere-deviated --out calibrated",
    )
    parser.add_argument(
        "images",
        type=Path,
        nargs="+",
        metavar="IMAGES",
        help="HDF5 files of images as for `irtscots reconstruct`, or with /screen/x_mm, /screen/y_mm and their "
        "standard errors; or one TOML list of measurements",
    )
    parser.add_argument("--scene", required=True, metavar="SCENE", help="preset name or path of a TOML file")
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder; default irtscots-out/NAME-calibrated")
    parser.add_argument(
        "--fit",
        default="camera,screen",
        metavar="NAMES",
        help="unknowns, with commas between: names (camera.x_mm), groups (camera, screen, mirror: pose; intrinsics, "
        "distortion, shape), patterns (screen.tilt_*) or mirror terms (zernike.4-15); default camera,screen",
    )
    parser.add_argument("--hold", default="", metavar="NAMES", help="unknowns of these that are not fitted")
    parser.add_argument(
        "--mirror-order",
        default="auto",
        metavar="N",
        help="Zernike terms of the mirror up to this radial order are fitted beside the geometry, so that it does not "
        "absorb them; 0: none; auto: 4, and more where the residuals ask for it; default auto",
    )
    parser.add_argument(
        "--mirror-known", action="store_true", help="the scene's mirror, with its figure, is known: a reference mirror"
    )
    parser.add_argument(
        "--mirror-turn",
        metavar="DEG,...",
        help="angles by which the mirror was turned about its axis, from x towards y, one for each file",
    )
    parser.add_argument(
        "--no-default-priors",
        dest="default_priors",
        action="store_false",
        help="only what [calibration.known] says is known; without it an unknown has its usual size, such as 0.5 mm or "
        "0.1 degree",
    )
    add_usable_samples(parser)
    parser.add_argument("--strict", action="store_true", help="refuse a doubtful calibration, with exit code 2")


def _execute(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene)
    order, turns = _order(options.mirror_order), _turns(options.mirror_turn)
    from irtscots_cl.calibration.calibrate import Unknowns
    from irtscots_cl.calibration.known import named_unknowns
    from irtscots_cl.pipeline.calibrate import calibrate_files
    from irtscots_cl.pipeline.measurement_list import planned
    from irtscots_cl.report.calibration import calibration_tables
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder, plain

    folder = options.out if options.out is not None else Path("irtscots-out") / f"{scene.name}-calibrated"
    check_output_folder(folder, FILES)
    _check_no_overwriting(options, folder)
    try:
        unknowns, hold = (named_unknowns(text, scene) for text in (options.fit, options.hold))
    except ValueError as error:
        raise ValueError(f"--fit, --hold: {error}") from None
    plans = planned(options.images, scene, turns, known=options.mirror_known)
    for plan in plans:
        plan.kind.update(_reading(options, plan.scene))
    fitted = Unknowns(unknowns, order, hold, options.default_priors, options.scene)
    with made_folder(folder):
        facts = calibrate_files(plans, scene, folder, fitted, strict=options.strict)
    warn_of(facts["checks"])
    if options.json:
        print_json(plain(facts))
    else:
        print_tables(calibration_tables(facts))
        print(f"results in {folder}")
        scene = path_of_scene(folder / "scene.toml")
        next_step(options, f"irtscots reconstruct {quoted(options.images[0])} --scene {scene}")
    return 0


def _reading(options: argparse.Namespace, scene: Scene) -> dict[str, object]:
    """What of the images may be used."""
    if not options.saturation > 0:
        raise ValueError(f"--saturation = {options.saturation}: must be above 0")
    if options.mask is None:
        return {"saturation": options.saturation}
    from irtscots_cl.imaging.mask_files import read_mask

    columns, rows = scene.camera.detector.pixels
    mask = read_mask(options.mask, (rows, columns), scene.camera.detector.orientation)
    return {"saturation": options.saturation, "use": mask}


def _order(text: str) -> int | None:
    if text == "auto":
        return None
    if not (text.isdigit() and int(text) <= 20):
        raise ValueError(f"--mirror-order = {text!r}: must be auto, or a whole number from 0 to 20")
    return int(text)


def _turns(text: str | None) -> list[float]:
    if text is None:
        return []
    try:
        turns = [float(word) for word in text.split(",")]
    except ValueError:
        turns = [float("nan")]
    if not all(-360 <= turn <= 360 for turn in turns):
        raise ValueError(f"--mirror-turn = {text!r}: must be angles in degrees within 360, with commas between")
    return turns


def _check_no_overwriting(options: argparse.Namespace, folder: Path) -> None:
    written = {(folder / name).resolve() for name in FILES}
    for path in (*options.images, Path(options.scene)):
        if path.resolve() in written:
            raise ValueError(f"--out = {str(folder)!r}: {path} is there and would be replaced; must be another folder")
