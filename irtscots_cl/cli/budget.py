"""The command `irtscots budget`."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from irtscots_cl.cli.common import (
    DEVICE_HELP,
    add_no_figures,
    add_scene,
    command,
    figures,
    print_json,
    print_tables,
    warn,
    workers_argument,
)
from irtscots_cl.cli.progress import Progress, add_quiet
from irtscots_cl.cli.terminal import next_step, quoted
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.defaults import RAYS_PER_PIXEL

if TYPE_CHECKING:
    from irtscots_cl.budget.assess import ErrorBudget
    from irtscots_cl.pipeline.simulated_trial import SimulatedTrial
    from irtscots_cl.scene.model import Scene

FIGURES = ("tornado.png", "cumulative.png", "maps.png")


def add(commands) -> None:
    parser = command(
        commands,
        "budget",
        _execute,
        "say what each error source costs in nanometres, before there is any hardware",
        "Prints what each source of the scene's table [budget] costs, alone and together in many trials, and the "
        "ledger of one trial: signed height maps that add up to its whole error. Without that table it prints what "
        "every known source costs at a usual value. Only the scene's design is used, and no device. Ghosts and "
        "scattered light are of a file that `irtscots paths SCENE --out DIR` writes.",
        example="sphere-deviated",
    )
    add_scene(parser)
    parser.add_argument("--trials", type=int, metavar="N", help="number of trials; default: the scene's, or 512")
    parser.add_argument("--trial", type=int, metavar="K", help="the trial whose ledger is made; default 0")
    parser.add_argument(
        "--allow-nm",
        type=float,
        metavar="NM",
        help="rms height error, piston and tilt removed, that 95 %% of tests may have: prints the largest size of each "
        "source, and what to calibrate first; default: the scene's",
    )
    add_quiet(parser)
    parser.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="address of a Dask scheduler, such as tcp://host:8786, whose workers work on the trials instead; they "
        "need no device and no calibration report (needs irtscots-cl[dask])",
    )
    parser.add_argument(
        "--images",
        action="store_true",
        help="trace and measure the trial as a test, too, and print its error beside the trial's; needs a device",
    )
    rays = f"with --images: rays per detector pixel; default {RAYS_PER_PIXEL}"
    parser.add_argument("--rays-per-pixel", type=int, metavar="N", help=rays)
    parser.add_argument("--device", metavar="D", help=f"with --images: {DEVICE_HELP}")
    parser.add_argument(
        "--result",
        type=Path,
        metavar="FILE",
        help="judge a measured map instead: result.h5 or any that `irtscots map` reads; prints Zernike terms and rms "
        "values with 95 %% intervals by the scene's error sources",
    )
    parser.add_argument(
        "--require",
        metavar="TEXT",
        help='with --result: limits as of ISO 10110-5 in fringes, such as "3/2(0.5/0.2) RMSi<0.05": which are met',
    )
    parser.add_argument(
        "--wavelength-nm", type=float, metavar="W", help="with --require: a fringe is half of it; default 546.07"
    )
    add_no_figures(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="write budget.json, budget.csv, budget.h5, report.html and figures there; with --images, the trial's "
        "scene, images and maps, too",
    )


def _execute(options: argparse.Namespace) -> int:
    _check(options)
    scene = load_scene(options.scene)
    if options.result is not None:
        return _judge(options, scene)
    from dataclasses import replace

    from irtscots_cl.budget.assess import assess_budget
    from irtscots_cl.report.budget import budget_facts, budget_tables, simulated_table, stray_warnings
    from irtscots_cl.scene.error_sources import Budget
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder, plain

    if options.out is not None:
        check_output_folder(options.out, ("budget.json", "budget.csv", "budget.h5", "report.html"), ("figures",))
    budget = scene.budget or Budget()
    if not (budget.sources or budget.calibrated):
        _refuse(
            options,
            ("trials", "trial", "allow_nm", "dask", "images"),
            "must have a scene with error sources: give them in [budget.sources]",
        )
    if options.trials is not None:
        if not 2 <= options.trials <= 2**20:
            raise ValueError(f"--trials = {options.trials}: must be from 2 to {2**20}")
        budget = replace(budget, trials=options.trials)
    if options.allow_nm is not None:
        if not 0 < options.allow_nm <= 1e9:
            raise ValueError(f"--allow-nm = {options.allow_nm}: must be a number above 0 and at most 1e9")
        budget = replace(budget, allow_nm=options.allow_nm)
    with workers_argument(options.dask) as where, Progress("trials", options.quiet, "trials") as progress:
        found = assess_budget(scene, budget, options.trial or 0, lambda count: progress(count, budget.trials), **where)
    for text in stray_warnings(found.ray_noise):
        warn(text)
    facts = budget_facts(found)
    tables = budget_tables(found)
    own = len(tables)
    if options.images:
        simulated = _simulated(options, found)
        from irtscots_cl.pipeline.simulated_trial import simulated_facts, write_simulated

        facts["simulated"] = simulated_facts(simulated)
        tables.append(simulated_table(facts["simulated"]))
    if options.out is not None:
        from irtscots_cl.report.page.budget import write_budget_page

        with made_folder(options.out):
            _write(options, found, facts, options.out)
            write_budget_page(options.out / "report.html", found, tables[own:])
            if options.images:
                write_simulated(simulated, options.out / f"trial-{found.trial}")
    if options.json:
        print_json(plain(facts))
        return 0
    print_tables(tables)
    if options.out is not None:
        print(f"results in {options.out}")
    next_step(options, _next(options, bool(budget.sources or budget.calibrated), budget.allow_nm))
    return 0


def _next(options: argparse.Namespace, has_sources: bool, allow_nm: float | None) -> str:
    """What to do after a budget."""
    scene = quoted(options.scene)
    if not has_sources:
        return f"sizes of your own sources in [budget.sources] (docs/budget.md), then: irtscots budget {scene}"
    if allow_nm is None:
        return f"irtscots budget {scene} --allow-nm E says how large each source may be, and what to calibrate first"
    if options.out is None:
        return f"irtscots budget {scene} --out DIR writes the maps of the trial and figures"
    return f"look at {quoted(options.out / 'figures')}; irtscots identify {scene} says what images cannot calibrate"


def _check(options: argparse.Namespace) -> None:
    """Raises ValueError for options that do not go together."""
    pairs = (("require", "result"), ("wavelength_nm", "require"), ("rays_per_pixel", "images"), ("device", "images"))
    for name, needs in pairs:
        if getattr(options, name) is not None and not getattr(options, needs):
            raise ValueError(f"--{name.replace('_', '-')}: must be given with --{needs}")
    if options.wavelength_nm is not None and not 1 <= options.wavelength_nm <= 1e6:
        raise ValueError(f"--wavelength-nm = {options.wavelength_nm}: must be from 1 to 1e6")
    if options.result is not None:
        _refuse(options, ("trials", "trial", "allow_nm", "dask", "images", "out"), "must be left out with --result")


def _refuse(options: argparse.Namespace, names: tuple[str, ...], why: str) -> None:
    """Raises ValueError for the first of some options that is given."""
    for name in names:
        given = getattr(options, name)
        if given is not None and given is not False:  # 0 is a number
            raise ValueError(f"--{name.replace('_', '-')}: {why}")


def _simulated(options: argparse.Namespace, found: ErrorBudget) -> SimulatedTrial:
    """The trial as a test."""
    from irtscots_cl.opencl.device import select_devices
    from irtscots_cl.pipeline.simulated_trial import simulate_trial

    rays = RAYS_PER_PIXEL if options.rays_per_pixel is None else options.rays_per_pixel
    return simulate_trial(
        found.trials, found.trial, rays_per_pixel=rays, device=select_devices(options.device)
    )  # fmt: skip


def _judge(options: argparse.Namespace, scene: Scene) -> int:
    """The verdict on a measured map."""
    from irtscots_cl.budget.assess import rays_of_stray_light
    from irtscots_cl.budget.verdict import WAVELENGTH_NM
    from irtscots_cl.pipeline.verdict import judge_map
    from irtscots_cl.report.budget import stray_warnings
    from irtscots_cl.report.verdict import verdict_facts, verdict_tables
    from irtscots_cl.scene.error_sources import Budget
    from irtscots_cl.system.atomic_files import plain

    require = options.require if options.require is not None else ""
    if options.require is not None and not require.split():
        raise ValueError("--require: must have at least one limit")
    budget = scene.budget or Budget()
    found = judge_map(scene, budget, options.result, require, options.wavelength_nm or WAVELENGTH_NM)
    for text in found.warnings:
        warn(f"{options.result}: {text}")
    for text in stray_warnings(rays_of_stray_light(found.trials)):
        warn(text)
    if options.json:
        print_json(plain(verdict_facts(found)))
    else:
        print_tables(verdict_tables(found))
    return 0


def _draw(found: ErrorBudget, folder: Path) -> None:
    from irtscots_cl.report.budget_figures import write_budget_figures

    write_budget_figures(found, folder)


def _write(options: argparse.Namespace, found: ErrorBudget, facts: dict[str, Any], folder: Path) -> None:
    import csv

    from irtscots_cl.report.budget import budget_rows
    from irtscots_cl.system.atomic_files import replacing, write_json

    write_json(folder / "budget.json", facts)
    with replacing(folder / "budget.csv") as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(budget_rows(found))
    if found.linear is not None:
        from irtscots_cl.pipeline.output import version_attributes
        from irtscots_cl.report.budget_file import write_budget_file

        about = {"scene": found.trials.design.setup.scene.to_toml(), "seed": str(found.trials.budget.seed)}
        write_budget_file(found, folder / "budget.h5", about | version_attributes())
        figures(options, folder / "figures", FIGURES, partial(_draw, found))
