"""The command `irtscots init`."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

from irtscots_cl.cli.common import command, print_json
from irtscots_cl.cli.terminal import path_of_scene

MOST_MM = 1e6
QUESTIONS = (
    ("diameter", "Diameter of the mirror in mm", None),
    ("radius", "Radius of curvature in mm (below 0 for a convex mirror, inf for a flat one)", None),
    ("conic", "Conic constant (0 for a sphere, -1 for a paraboloid)", "0"),
    ("off_axis", "Distance of the mirror's middle from its parent's axis in mm", "0"),
    ("screen_diagonal", "Diagonal of the monitor in inches", "27"),
    ("screen_pixels", "Its pixels, columns x rows", "3840x2160"),
    ("sensor_pixels", "Pixels of the camera's sensor, columns x rows", "2448x2048"),
    ("sensor_pitch", "Pitch of the sensor's pixels in um", "3.45"),
)


def add(commands) -> None:
    parser = command(
        commands,
        "init",
        _execute,
        "write a first scene for your own mirror",
        "Places screen and camera, sizes the screen's used part by the light, and chooses lens, binning and pattern. "
        "Without --diameter it asks.",
        example="--diameter 406.4 --f-ratio 4 --conic -1 --out mine.toml",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("my-mirror.toml"), metavar="FILE", help="default my-mirror.toml"
    )
    parser.add_argument("--force", action="store_true", help="replace a file that exists")
    mirror = parser.add_argument_group("mirror")
    mirror.add_argument("--diameter", metavar="MM", help="diameter in mm")
    mirror.add_argument("--radius", metavar="MM", help="radius of curvature in mm; below 0 convex, inf flat")
    mirror.add_argument(
        "--f-ratio", type=float, metavar="N", help="instead: focal length over diameter, of a concave mirror"
    )
    mirror.add_argument("--conic", metavar="K", help="0 sphere (default), -1 paraboloid")
    mirror.add_argument("--off-axis", metavar="MM", help="distance of its middle from the parent's axis; default 0")
    mirror.add_argument(
        "--hole", type=float, default=0.0, metavar="MM", help="diameter of a central hole; default none"
    )
    bench = parser.add_argument_group("screen and camera")
    bench.add_argument("--screen-diagonal", metavar="INCH", help="of the monitor; default 27")
    bench.add_argument("--screen-pixels", metavar="CxR", help="of the whole monitor; default 3840x2160")
    bench.add_argument("--sensor-pixels", metavar="CxR", help="of the whole sensor; default 2448x2048")
    bench.add_argument("--sensor-pitch", metavar="UM", help="of the sensor's pixels; default 3.45")
    bench.add_argument(
        "--lens", type=float, metavar="MM", help="focal length; default: the longest usual one that fits"
    )
    bench.add_argument("--f-number", type=float, default=16.0, metavar="N", help="of the lens; default 16")
    bench.add_argument(
        "--side",
        default="+x",
        metavar="S",
        help="of the mirror's normal, where the screen is: +x (default), -x, +y, -y",
    )


def _execute(options: argparse.Namespace) -> int:
    if options.diameter is None:
        _ask(options)
    diameter, radius = _number(options, "diameter"), _radius(options)
    if options.out.exists() and not options.force:
        raise ValueError(f"--out = {options.out}: exists; must be a new file, or --force")
    from irtscots_cl.planning.first_scene import INCH_MM, Bench, design
    from irtscots_cl.system.atomic_files import write_text

    bench = Bench(
        _number(options, "screen_diagonal", "27") * INCH_MM,
        _pair(options, "screen_pixels", "3840x2160"),
        _pair(options, "sensor_pixels", "2448x2048"),
        _number(options, "sensor_pitch", "3.45"),
        options.lens,
        options.f_number,
        options.side,
    )
    name = options.out.stem
    made = design(diameter, radius, conic=_number(options, "conic", "0", signed=True),
                  off_axis_mm=_number(options, "off_axis", "0", zero=True), obscuration_mm=options.hole, name=name,
                  bench=bench)  # fmt: skip
    write_text(options.out, made.toml)
    if options.json:
        print_json({"file": str(options.out), "binning": made.binning, "fringes": made.fringes, "toml": made.toml})
    else:
        print(made.toml, end="")
        print(f"\nwritten to {options.out}; next: irtscots check {path_of_scene(options.out)}")
    return 0


def _ask(options: argparse.Namespace) -> None:
    """Fill what was not given with the user's answers. Raises ValueError where nobody can answer."""
    if not sys.stdin.isatty():
        raise ValueError("--diameter: must be given where there is no terminal to ask on")
    for key, question, default in QUESTIONS:
        if getattr(options, key) is None and not (key == "radius" and options.f_ratio is not None):
            answer = input(f"{question}{f' [{default}]' if default else ''}: ").strip()
            setattr(options, key, answer or default)


def _radius(options: argparse.Namespace) -> float:
    """Radius of curvature in mm, from --radius or --f-ratio."""
    if options.f_ratio is not None:
        if options.radius is not None:
            raise ValueError("--f-ratio: must be left out with --radius")
        if not 0.1 <= options.f_ratio <= 1000:
            raise ValueError(f"--f-ratio = {options.f_ratio}: must be from 0.1 to 1000")
        return 2 * options.f_ratio * _number(options, "diameter")
    radius = _number(options, "radius", signed=True, infinite=True)
    if radius == 0:
        raise ValueError("--radius = 0: must be above 0 (concave), below 0 (convex) or inf (flat)")
    return radius


def _number(options, key: str, default: str | None = None, signed=False, zero=False, infinite=False) -> float:
    """An option as a number. Raises ValueError for what is none, or out of range."""
    text, option = getattr(options, key), f"--{key.replace('_', '-')}"
    if text is None and default is None:
        raise ValueError(f"{option}: must be given{' (or --f-ratio)' if key == 'radius' else ''}")
    try:
        value = float(text if text is not None else default)
    except ValueError:
        value = math.nan
    least = -MOST_MM if signed else 0.0
    allowed = (value > least or (zero and value == 0)) and (value <= MOST_MM or (infinite and value == math.inf))
    if not allowed:
        words = f"from {least:g} to {MOST_MM:g}" if signed or zero else f"above 0 and at most {MOST_MM:g}"
        raise ValueError(f"{option} = {text}: must be a number {words}{', or inf' if infinite else ''}")
    return value


def _pair(options: argparse.Namespace, key: str, default: str) -> tuple[int, int]:
    """An option such as 3840x2160."""
    text = getattr(options, key) or default
    parts = text.lower().replace(",", "x").replace(" ", "").split("x")
    if len(parts) == 2 and all(part.isdecimal() and 1 <= int(part) <= 16384 for part in parts):
        return int(parts[0]), int(parts[1])
    raise ValueError(f"--{key.replace('_', '-')} = {text}: must be COLUMNSxROWS, such as {default}")
