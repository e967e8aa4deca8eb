"""The command `irtscots paths`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from irtscots_cl.cli.common import (
    DASK_HELP,
    DEVICES_HELP,
    PATH_CHOICES,
    add_overfill,
    add_path_choices,
    add_scene,
    choices,
    command,
    print_json,
    print_tables,
    site_arguments,
    visible_setup,
)
from irtscots_cl.cli.progress import Progress, add_quiet

if TYPE_CHECKING:
    from irtscots_cl.analysis.stray_light import StrayLight
    from irtscots_cl.report.types import PathReport
    from irtscots_cl.tracing.results.paths import PathLight


def add(commands) -> None:
    parser = command(
        commands,
        "paths",
        _execute,
        "list the paths that light takes from the screen to the detector",
        "Traces the scene with all its elements in any order: direct paths, ghosts, their flux, how sharp they are "
        "on the detector, and what they add to the measured height. (r) marks a reflection at an interface that should "
        "transmit. focus: from the detector to where the light of a mirror point meets again, negative before it; "
        "blur: diameter of its light on the detector.",
        example="sphere-singlet --rays-per-pixel 4096",
    )
    add_scene(parser)
    parser.add_argument(
        "--rays-per-pixel", type=int, default=2**16, metavar="N", help="rays per screen pixel; default 65536"
    )
    parser.add_argument(
        "--replicates", type=int, default=8, metavar="R", help="independent parts, for error bars; default 8"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the random numbers; default 1")
    parser.add_argument("--sampler", default="philox", metavar="S", help="philox, sobol or lattice; default philox")
    parser.add_argument("--precision", default="fp32", metavar="P", help="fp32 or fp64; default fp32")
    parser.add_argument(
        "--measure",
        default="paper",
        metavar="M",
        help="how images become heights: paper (plain centroids of all lines), fine, refined, windowed or likelihood; "
        "default paper. The places of --out are centroids of all lines with any of them",
    )
    add_overfill(parser)
    add_path_choices(parser)
    parser.add_argument("--device", metavar="D", help=DEVICES_HELP)
    parser.add_argument("--dask", metavar="ADDRESS", help=DASK_HELP)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="write stray-light.h5, maps of what ghosts and scattered light do to each pixel, for [budget] stray_light "
        "of `irtscots budget`, and paths.json there",
    )
    add_quiet(parser)


def _execute(options: argparse.Namespace) -> int:
    if options.out is not None:
        from irtscots_cl.imaging.stray_files import FILE
        from irtscots_cl.system.atomic_files import check_output_folder, made_folder

        check_output_folder(options.out, (FILE, "paths.json"))
    setup = visible_setup(options.scene)
    from irtscots_cl.analysis.stray_light import stray_light
    from irtscots_cl.measurement.methods import check_measure
    from irtscots_cl.report.facts import path_facts
    from irtscots_cl.report.tables import path_tables
    from irtscots_cl.tracing.trace import trace_paths

    check_measure(options.measure)
    with site_arguments(options) as where, Progress(quiet=options.quiet) as progress:
        light = trace_paths(
            setup,
            **where,
            sampler=options.sampler,
            precision=options.precision,
            rays_per_pixel=options.rays_per_pixel,
            replicates=options.replicates,
            seed=options.seed,
            **choices(options, ("overfill", *PATH_CHOICES)),
            progress=progress,
        )
    stray = stray_light(light, options.measure)
    facts = path_facts(light, stray, options.measure)
    if options.out is not None:
        with made_folder(options.out):
            _write(light, stray, facts, options.out)
    if options.json:
        from irtscots_cl.system.atomic_files import plain

        print_json(plain(facts))
    else:
        print_tables(path_tables(facts))
        if options.out is not None:
            print(f"results in {options.out}")
    return 0


def _write(light: PathLight, stray: tuple[StrayLight, ...], facts: PathReport, folder: Path) -> None:
    """Maps of stray light, and the facts, into a folder."""
    from irtscots_cl.analysis.stray_places import stray_maps
    from irtscots_cl.imaging.stray_files import FILE, write_stray_maps
    from irtscots_cl.system.atomic_files import write_json
    from irtscots_cl.system.versions import versions

    attributes = {
        **{key: facts[key] for key in ("rays_total", "seed", "replicates", "sampler", "precision", "measure")},
        **{key: facts["device"][of] for key, of in (("device", "name"), ("driver", "driver"))},
        **{f"version {name}": value for name, value in versions().items()},
    }
    write_stray_maps(folder / FILE, stray_maps(light, stray), light.scene, attributes)
    write_json(folder / "paths.json", facts)
