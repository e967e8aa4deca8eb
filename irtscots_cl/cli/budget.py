"""The command `irtscots budget`."""

from __future__ import annotations

import argparse
from pathlib import Path

from irtscots_cl.cli.common import add_scene, command, print_json, print_tables
from irtscots_cl.scene.presets import load_scene


def add(commands) -> None:
    parser = command(
        commands,
        "budget",
        _execute,
        "say what each error source costs in nanometres, before there is any hardware",
        "Prints what each source of the scene's table [budget] costs, alone and together in many trials, and the "
        "ledger of one trial: signed height maps that add up to its whole error. Without that table it prints what "
        "every known source costs at a usual value. Only the scene's design is used, and no device.",
    )
    add_scene(parser)
    parser.add_argument("--trials", type=int, metavar="N", help="number of trials; default: the scene's, or 512")
    parser.add_argument("--trial", type=int, default=0, metavar="K", help="the trial whose ledger is made; default 0")
    parser.add_argument("--out", type=Path, metavar="DIR", help="write budget.json there")


def _execute(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene)
    from dataclasses import replace

    from irtscots_cl.budget.assess import assess
    from irtscots_cl.report.budget import budget_facts, budget_tables
    from irtscots_cl.scene.error_sources import Budget
    from irtscots_cl.system.atomic_files import check_output_folder, made_folder, plain, write_json

    if options.out is not None:
        check_output_folder(options.out, ("budget.json",), ())
    budget = scene.budget or Budget()
    if options.trials is not None:
        if not 2 <= options.trials <= 2**20:
            raise ValueError(f"--trials = {options.trials}: must be from 2 to {2**20}")
        budget = replace(budget, trials=options.trials)
    found = assess(scene, budget, options.trial)
    facts = budget_facts(found)
    if options.out is not None:
        with made_folder(options.out):
            write_json(options.out / "budget.json", facts)
    if options.json:
        print_json(plain(facts))
        return 0
    print_tables(budget_tables(found))
    if options.out is not None:
        print(f"results in {options.out}")
    return 0
