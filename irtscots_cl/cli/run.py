"""The command `irtscots run`."""

from __future__ import annotations

import argparse
import math
import time
import warnings
from contextlib import nullcontext
from functools import partial
from pathlib import Path

from irtscots_cl.cli.common import (
    DASK_HELP,
    DEFAULTS,
    DEVICES_HELP,
    LAB_MEASURE,
    PATH_CHOICES,
    add_measure,
    add_no_figures,
    add_noise,
    add_overfill,
    add_path_choices,
    add_scene,
    add_trace_choices,
    choices,
    command,
    print_json,
    print_tables,
    site_arguments,
    visible_setup,
    warn,
    warn_of,
    warn_of_scene,
)
from irtscots_cl.cli.exporting import add_export, export, export_targets, print_exported
from irtscots_cl.cli.job_file import FILE, MAP_FILE, JobFile, told_in
from irtscots_cl.cli.keeping import add_resume, keeping
from irtscots_cl.cli.progress import Progress, add_quiet
from irtscots_cl.cli.terminal import next_step, results_page
from irtscots_cl.tracing.defaults import RAYS_PER_PIXEL

# Defaults of the options that a target sets itself.
OF_RAYS = ("rays_per_pixel", "replicates", "sampler", "precision", "device", "dask", "max_seconds")
RAYS = {"rays_per_pixel": RAYS_PER_PIXEL, "replicates": 8, "aim": "mirror", "overfill": 1.0}


def add(commands) -> None:
    parser = command(
        commands,
        "run",
        _execute,
        "simulate a test of a mirror and measure it",
        "Writes report.json, report.html, result.h5 and figures into the output folder.",
        example="sphere-deviated --target-nm 1 --out out",
    )
    add_scene(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder; default irtscots-out/NAME")
    add_no_figures(parser)
    add_export(parser)
    add_trace_choices(parser, DEVICES_HELP)
    parser.add_argument("--dask", metavar="ADDRESS", help=DASK_HELP)
    add_measure(parser, default=f"paper, and {LAB_MEASURE} with camera noise")
    parser.add_argument(
        "--rays-per-pixel",
        type=int,
        metavar="N",
        help=f"rays per detector pixel (adjoint) or per screen pixel (forward); default {RAYS_PER_PIXEL}, and 64 where "
        "rays are smoothed for a large detector's sake",
    )
    parser.add_argument(
        "--parts",
        action="store_true",
        help="also separate the height error into ray noise, line sampling, integration, ...: some seconds more",
    )
    parser.add_argument(
        "--replicates",
        type=int,
        metavar="R",
        help="independent parts of the rays, for error bars; default 8",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the random numbers; default 1")
    parser.add_argument(
        "--target-nm",
        type=float,
        metavar="E",
        help="height error to reach, piston and tilt removed: small pilot runs choose the cheapest rays, precision and "
        "measure that get there, except what is given here too",
    )
    add_noise(parser)
    add_resume(parser)
    add_quiet(parser)
    parser.add_argument(
        "--max-seconds",
        type=float,
        metavar="S",
        help="stop after so many seconds of tracing, with exit code 4; --resume continues",
    )
    parser.add_argument(
        "--aim",
        metavar="A",
        help="forward: mirror (rays leave towards the whole mirror, as in the paper; default) or camera (only towards "
        "the part of it from which light reaches the camera: fewer rays for the same noise)",
    )
    add_overfill(parser)
    add_path_choices(parser)


def _execute(options: argparse.Namespace) -> int:
    from irtscots_cl.system.atomic_files import check_output_folder

    given = choices(options, DEFAULTS) | choices(options, RAYS)
    given |= choices(options, PATH_CHOICES)
    targets = export_targets(options)
    _check(options, DEFAULTS | RAYS | given)
    setup = visible_setup(options.scene, options.noise)
    scene = setup.scene
    _check_scene(scene, options, given)
    if scene.has_noise_tables:
        given = {"measure": LAB_MEASURE} | given
    folder = options.out if options.out is not None else Path("irtscots-out") / scene.name
    check_output_folder(folder, ("result.h5", "report.json", "report.html", ".lock", FILE, MAP_FILE), ("figures",))
    from irtscots_cl.pipeline.output import write_run
    from irtscots_cl.system.process_time import seconds_of_process

    warn_of_scene(scene)
    seconds = math.inf if options.max_seconds is None else options.max_seconds
    with (
        keeping(folder, "checkpoint", options.resume, max_seconds=seconds) as keeper,
        told_in(folder, options.arguments) as job,
    ):
        if options.target_nm is None:
            run = _simulate(setup, options, given, keeper, job)
        else:
            run = _reach(setup, options, given, job)
        started = seconds_of_process() - (time.perf_counter() - run.began)
        with Progress("storing", options.quiet, "light curves", job=job) as progress:
            write_run(run, folder, started, progress, draw=options.figures)
        keeper.remove()
    exported = export(folder, targets)
    from irtscots_cl.report.tables import cautions, summary_tables

    for line in run.report["warnings"]:
        warn(line)
    warn_of(run.report.get("checks", ()))
    for line in cautions(run.report):
        warn(line)
    if options.json:
        from irtscots_cl.system.atomic_files import plain

        print_json(plain(run.report | exported))
    else:
        print_tables(summary_tables(run.report))
        print(f"results in {folder}")
        print_exported(exported)
        next_step(options, results_page(folder))
    return 0


def _check(options: argparse.Namespace, wanted: dict) -> None:
    """Raise ValueError for options that are out of range or do not fit together."""
    from irtscots_cl.execution.launch_plan import share_rays
    from irtscots_cl.measurement.coefficients import check_kind
    from irtscots_cl.measurement.methods import check_measure
    from irtscots_cl.tracing.options import ANALYTIC, TraceOptions

    names = ("estimator", "sampler", "precision", "aim", "overfill", "smoothing", *PATH_CHOICES)
    TraceOptions(**{name: wanted[name] for name in names if name in wanted}, seed=options.seed)
    check_measure(wanted["measure"])
    check_kind(options.zernike)
    share_rays(wanted["rays_per_pixel"], wanted["replicates"])
    if options.max_seconds is not None and not 0 < options.max_seconds < math.inf:
        raise ValueError(f"--max-seconds = {options.max_seconds}: must be above 0 and finite")
    if wanted["estimator"] == ANALYTIC and options.target_nm is None:
        for name in choices(options, OF_RAYS):
            raise ValueError(f"--{name.replace('_', '-')}: must be left out with --estimator analytic: it has no rays")
    if options.target_nm is not None:
        for name in ("resume", "max-seconds"):
            if getattr(options, name.replace("-", "_")):
                raise ValueError(f"--{name}: must be left out with --target-nm, which chooses the rays anew each time")
        for name in choices(options, RAYS):
            raise ValueError(f"--{name.replace('_', '-')}: --target-nm chooses it; must not be given too")
        if options.device is not None and (options.device.strip().lower() == "all" or "," in options.device):
            raise ValueError(f"--target-nm: must be left out with --device = {options.device!r}: it wants one device")
        if options.dask is not None:
            raise ValueError("--dask: must be left out with --target-nm, whose pilot runs are timed on one device")
        from irtscots_cl.pipeline.target import check_target

        check_target(options.target_nm, wanted["estimator"])


def _check_scene(scene, options: argparse.Namespace, given: dict) -> None:
    """Raise ValueError if the estimator cannot trace the scene, or record its noise, before any slow step."""
    if scene.has_noise_tables:
        from irtscots_cl.pipeline.noise import check_noise
        from irtscots_cl.pipeline.target import check_without_noise

        if options.target_nm is not None:
            check_without_noise(scene)
        check_noise(scene, options.parts, **(DEFAULTS | RAYS | given))
    if scene.is_sequential:
        return
    from irtscots_cl.tracing.options import NONSEQUENTIAL, check_sequential

    estimator = (DEFAULTS | given)["estimator"]
    if estimator != NONSEQUENTIAL:
        check_sequential(scene, estimator)
    if options.parts:
        raise ValueError(f"--parts: must be left out: scene {scene.name} is more than a mirror and a paraxial camera")


def _simulate(setup, options: argparse.Namespace, given: dict, keeper, job: JobFile):
    """Run the simulation with the given options."""
    from irtscots_cl.pipeline.simulate import outlook, simulate
    from irtscots_cl.tracing.checks.precision import RoundingWarning, check_precision_of_scene, check_precision_on
    from irtscots_cl.tracing.large_detectors import fit_memory
    from irtscots_cl.tracing.options import ANALYTIC
    from irtscots_cl.tracing.samplers import INDEPENDENT

    wanted = DEFAULTS | RAYS | given
    changes, line = fit_memory(setup, wanted, given)
    if changes:
        warn(f"scene {setup.scene.name}: {line}")
        wanted |= changes
    if wanted["estimator"] == ANALYTIC and keeper.files():
        raise ValueError(f"{keeper.path}: of a run that traces rays; must be deleted first")
    with nullcontext({}) if wanted["estimator"] == ANALYTIC else site_arguments(options) as where:
        independent = wanted["sampler"] in INDEPENDENT and not wanted["smoothing"]
        noise = (wanted["rays_per_pixel"], independent)
        for device in where.get("device", ()):
            check_precision_of_scene(setup, device, wanted["precision"], options.scene, *noise)
        if "client" in where:
            where["client"].call(check_precision_on, setup.scene.to_toml(), wanted["precision"], options.scene, *noise)
        so_far = partial(outlook, measure=wanted["measure"], nominal=setup.nominal)

        def tell(traced) -> str:
            words, result = so_far(traced)
            if result is not None:
                from irtscots_cl.report.page.job import map_so_far

                job.show(map_so_far(result))
            return words

        with Progress(quiet=options.quiet, estimate=tell, job=job) as progress, warnings.catch_warnings():
            warnings.simplefilter("ignore", RoundingWarning)  # the report tells of it, beside the other errors
            return simulate(setup, progress=progress, stage=progress.stage, finished=progress.finished,
                            seed=options.seed, parts=options.parts, zernike=options.zernike, keeper=keeper,
                            **where, **wanted)  # fmt: skip


def _reach(setup, options: argparse.Namespace, given: dict, job: JobFile):
    """Run until the target is reached."""
    from irtscots_cl.opencl.device import select_device
    from irtscots_cl.pipeline.target import run_to_target

    device = select_device(options.device)
    with Progress(quiet=options.quiet, job=job) as progress:
        return run_to_target(setup, options.target_nm, device=device, seed=options.seed, parts=options.parts,
                     zernike=options.zernike, progress=progress, **given)  # fmt: skip
