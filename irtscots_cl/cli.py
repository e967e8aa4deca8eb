"""The command line: `irtscots COMMAND`. Exit codes: 0 done, 2 bad input, 3 no usable device, 1 a bug."""

from __future__ import annotations

import argparse
import json
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from irtscots_cl.presets import load_scene, preset_names, preset_text
from irtscots_cl.scene import Scene, SceneError

DEVICE_HELP = (
    "part of a device's name, its index such as 0:0, cpu or gpu; "
    "default: environment variable IRTSCOTS_DEVICE, or the best found"
)
EXIT_BAD_INPUT = 2
EXIT_NO_DEVICE = 3
EXIT_INTERRUPTED = 130  # as a shell reports Ctrl-C


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit code. Every expected failure is one line on stderr."""
    options = _parser().parse_args(arguments)
    try:
        with warnings.catch_warnings():
            # drivers comment on kernels that they did build: nothing that a user could act on
            warnings.filterwarnings("ignore", "Non-empty compiler output|.*non-empty logs")
            code = options.command(options)
            sys.stdout.flush()
            return code
    except BrokenPipeError:  # whoever read the output has seen enough, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (SceneError, ValueError, OSError) as error:
        return _fail(error, EXIT_BAD_INPUT)
    except KeyboardInterrupt:
        return _fail("interrupted; nothing was written", EXIT_INTERRUPTED)
    except RuntimeError as error:
        if type(error).__name__ != "DeviceError":  # its class lives behind the slow import of pyopencl
            raise
        return _fail(error, EXIT_NO_DEVICE)


def _fail(message: object, code: int) -> int:
    print(f"irtscots: {message}", file=sys.stderr)
    return code


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line, as every other refusal: no usage above it."""
        self.exit(EXIT_BAD_INPUT, f"irtscots: {message}; see {self.prog} --help\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="irtscots",
        description="Simulate a SCOTS deflectometry test of a mirror and measure the mirror from the simulated images.",
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for add in (_add_run, _add_scenes, _add_devices, _add_kernel, _add_reconstruct, _add_bench):
        add(commands)
    return parser


def _command(commands, name: str, function: Callable, text: str, more: str = "") -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}. {more}")
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    parser.set_defaults(command=function)
    return parser


def _add_scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="preset name (see `irtscots scenes`) or path of a TOML file")


def _visible_scene(name_or_path: str) -> Scene:
    """A scene that can be traced; refused under the name that the user gave it."""
    scene = load_scene(name_or_path)
    from irtscots_cl.calibration import calibrate, check_visible

    check_visible(calibrate(scene), name_or_path)
    return scene


def _add_trace_choices(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--estimator",
        default="adjoint",
        metavar="E",
        help="forward (rays leave the screen, as in the paper) or adjoint (rays leave the detector: less noise); "
        "default adjoint",
    )
    parser.add_argument(
        "--sampler",
        default="philox",
        metavar="S",
        help="philox (independent random numbers; default), sobol (Owen-scrambled Sobol points) or lattice (rank-1 "
        "lattice, shifted at random)",
    )
    parser.add_argument(
        "--precision", default="fp32", metavar="P", help="fp32 or fp64 arithmetic on the device; default fp32"
    )
    parser.add_argument(
        "--device",
        metavar="D",
        help=DEVICE_HELP,
    )


def _add_run(commands) -> None:
    parser = _command(
        commands,
        "run",
        _run,
        "simulate a test of a mirror and measure it",
        "Writes report.json, report.html, result.h5 and figures into the output folder.",
    )
    _add_scene(parser)
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder; default irtscots-out/NAME")
    _add_trace_choices(parser)
    parser.add_argument(
        "--rays-per-pixel",
        type=int,
        default=16384,
        metavar="N",
        help="rays per detector pixel (adjoint) or per screen pixel (forward); default 16384",
    )
    parser.add_argument(
        "--replicates",
        type=int,
        default=8,
        metavar="R",
        help="independent parts of the rays, for error bars; default 8",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the random numbers; default 1")
    parser.add_argument(
        "--overfill",
        type=float,
        default=1.0,
        metavar="F",
        help="forward: solid angle of the emission over the least that covers the mirror; default 1",
    )


def _run(options: argparse.Namespace) -> int:
    from irtscots_cl.files import check_output_folder
    from irtscots_cl.tracer import TraceOptions, share_rays

    TraceOptions(options.estimator, options.sampler, options.precision, options.seed, options.overfill)
    share_rays(options.rays_per_pixel, options.replicates)
    scene = _visible_scene(options.scene)
    folder = options.out if options.out is not None else Path("irtscots-out") / scene.name
    check_output_folder(folder)
    from irtscots_cl.device import select_device
    from irtscots_cl.pipeline import simulate, write_run

    device = select_device(options.device)
    with _progress() as progress:
        run = simulate(
            scene,
            device=device,
            progress=progress,
            estimator=options.estimator,
            sampler=options.sampler,
            precision=options.precision,
            rays_per_pixel=options.rays_per_pixel,
            replicates=options.replicates,
            seed=options.seed,
            overfill=options.overfill,
        )
    write_run(run, folder)
    if options.json:
        from irtscots_cl.files import plain

        _print_json(plain(run.report))
    else:
        from irtscots_cl.report import summary_tables

        _print_tables(summary_tables(run.report))
        print(f"results in {folder}")
    return 0


class _progress:  # noqa: N801  used as a function: `with _progress() as report:`
    """A bar on stderr while rays are traced, where stderr is a terminal."""

    def __enter__(self) -> Callable[[int, int], None]:
        from rich.console import Console
        from rich.progress import Progress

        console = Console(stderr=True)
        self._bar = Progress(console=console, transient=True, disable=not console.is_terminal)
        self._bar.start()
        task = self._bar.add_task("tracing", total=None)
        return lambda done, total: self._bar.update(task, completed=done, total=total)

    def __exit__(self, *_) -> None:
        self._bar.stop()


def _print_tables(tables) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    # Not a terminal: no wrapping to its guess of 80 columns. No markup: it would take [nm] for a style.
    class Terminal(Console):
        def on_broken_pipe(self) -> None:  # the reader has seen enough: main ends the command well
            raise BrokenPipeError

    console = Terminal(width=None if sys.stdout.isatty() else 160, markup=False, emoji=False, highlight=False)
    for table in tables:
        shown = Table(title=table.title, title_justify="left", box=box.SIMPLE_HEAD, show_header=any(table.head))
        for k, head in enumerate(table.head):
            shown.add_column(head, justify="left" if k == 0 or len(table.head) == 2 else "right")
        for row in table.rows:
            shown.add_row(*row)
        console.print(shown)


def _print_json(data: object) -> None:
    print(json.dumps(data, indent=2))


def _add_scenes(commands) -> None:
    parser = _command(commands, "scenes", _scenes, "list the preset scenes, or print one as TOML")
    parser.add_argument("name", nargs="?", metavar="NAME", help="preset to print")


def _scenes(options: argparse.Namespace) -> int:
    if options.name is not None:
        text = preset_text(options.name)
        _print_json({"name": options.name, "toml": text}) if options.json else print(text, end="")
        return 0
    texts = {name: preset_text(name) for name in preset_names()}
    if options.json:
        _print_json([{"name": name, "toml": text} for name, text in texts.items()])
    for name, text in () if options.json else texts.items():
        print(f"{name:16} {text.splitlines()[0].removeprefix('# ')}")
    return 0


def _add_devices(commands) -> None:
    _command(commands, "devices", _devices, "list the OpenCL devices and what was probed on each")


def _devices(options: argparse.Namespace) -> int:
    from irtscots_cl.device import HINT, DeviceError, all_devices

    found = []
    for device in all_devices():
        facts: dict[str, object] = device.describe()
        try:
            facts |= device.probe()
        except DeviceError as error:
            facts["unusable"] = str(error)
        found.append(facts)
    if options.json:
        _print_json(found)
    for facts in [] if options.json else found:
        print(f"{facts['index']}  {facts['name']}  ({facts['platform']}, {facts['driver']})")
        for key, value in facts.items():
            if key not in ("index", "name", "platform", "driver"):
                print(f"     {key.replace('_', ' '):28} {value}")
    if not found:
        return _fail(f"no OpenCL device found; {HINT}", EXIT_NO_DEVICE)
    return 0


def _add_kernel(commands) -> None:
    parser = _command(commands, "kernel", _kernel, "print the OpenCL source and build options that a scene gets")
    _add_scene(parser)
    _add_trace_choices(parser)


def _kernel(options: argparse.Namespace) -> int:
    scene = _visible_scene(options.scene)
    from irtscots_cl.calibration import calibrate
    from irtscots_cl.device import select_device
    from irtscots_cl.tracer import TraceOptions, Tracer

    chosen = TraceOptions(options.estimator, options.sampler, options.precision)
    source = Tracer(calibrate(scene), select_device(options.device), chosen).source
    if options.json:
        _print_json({"options": source.options, "files": source.files, "source": source.text})
    else:
        print(f"// build options: {' '.join(source.options)}")
        print(source.text, end="")
    return 0


def _add_reconstruct(commands) -> None:
    parser = _command(
        commands,
        "reconstruct",
        _reconstruct,
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
        help="least part of a light curve's peak "
        "that counts for its centroid, 0 to below 1; default 0, for images without background",
    )


def _reconstruct(options: argparse.Namespace) -> int:
    if not 0 <= options.threshold < 1:
        raise ValueError(f"--threshold = {options.threshold}: must be at least 0 and below 1")
    scene = load_scene(options.scene)
    from irtscots_cl.files import check_output_folder, read_images
    from irtscots_cl.pipeline import measure

    folder = options.out if options.out is not None else Path("irtscots-out") / f"{scene.name}-measured"
    check_output_folder(folder)
    if (folder / "result.h5").resolve() == options.images.resolve():
        raise ValueError(f"--out = {str(folder)!r}: its result.h5 is the file of images; must be another folder")
    facts = measure(read_images(options.images), scene.nominal(), folder, options.threshold)
    if options.json:
        _print_json(facts)
    else:
        from irtscots_cl.report import measured_table

        _print_tables([measured_table(facts)])
        print(f"results in {folder}")
    return 0


def _add_bench(commands) -> None:
    parser = _command(
        commands,
        "bench",
        _bench,
        "measure the tracer's throughput",
        "Writes bench.json and bench.png into the output folder.",
    )
    parser.add_argument("--quick", action="store_true", help="fewer cases and rounds, under 20 s")
    parser.add_argument("--device", metavar="D", help=DEVICE_HELP)
    parser.add_argument(
        "--out", type=Path, default=Path("irtscots-out/bench"), metavar="DIR", help="default irtscots-out/bench"
    )


def _bench(options: argparse.Namespace) -> int:
    from irtscots_cl.files import check_output_folder, plain, write_json

    check_output_folder(options.out)
    from irtscots_cl.bench import bench_tables, run_bench, write_plot
    from irtscots_cl.device import select_device

    results = run_bench(select_device(options.device), options.quick)
    options.out.mkdir(parents=True, exist_ok=True)
    write_json(options.out / "bench.json", results)
    write_plot(results, options.out / "bench.png")
    if options.json:
        _print_json(plain(results))
    else:
        _print_tables(bench_tables(results))
        print(f"multiply-add limit {results['multiply_adds_per_second'] / 1e9:.0f} G/s; results in {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
