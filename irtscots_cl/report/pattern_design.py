"""The choice of patterns: as data for programs, as a table, as the command that writes them, and as a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from irtscots_cl.measurement.pattern_design.choice import PatternDesign, SetError
from irtscots_cl.measurement.pattern_design.curve import error_curve
from irtscots_cl.report.table import Table
from irtscots_cl.system.atomic_files import replacing

NAME = "nm_against_periods.png"


def command_of(one: SetError, scene: str) -> str | None:
    """The command that writes the pictures of fringes; None for line scans."""
    if one.fringes is None:
        return None
    periods = " ".join(f"{p:g}" for p in one.fringes.periods)
    return f"irtscots patterns {scene} --steps {one.fringes.steps} --periods {periods}"


def design_facts(found: PatternDesign, scene: str) -> dict[str, Any]:
    """All of it as plain data. scene: as it was named."""
    camera, best = found.camera, found.best_fringes
    return {
        "scene": found.scene.name,
        "frames": found.frames,
        "ambiguity_limit": found.limit,
        "screen_gamma": found.gamma,
        "camera": {
            "electrons_at_peak": camera.electrons, "read_noise_e": camera.read_noise_e,
            "electrons_per_count": camera.step_e, "dark_e": camera.dark_e, "shot_noise": camera.shot,
            "exposure_s": camera.exposure_s, "frame_s": camera.frame_s,
        },
        "bound_nm": {"equal_frames": found.bound_frames_nm, "equal_light": found.bound_light_nm},
        "sets": [_set_facts(one, found) for one in found.sets],
        "best": None if found.best is None else found.best.name,
        "best_fringes": None if best is None else _set_facts(best, found) | {"command": command_of(best, scene)},
    }  # fmt: skip


def _set_facts(one: SetError, found: PatternDesign) -> dict[str, Any]:
    facts: dict[str, Any] = {
        "name": one.name,
        "frames": one.frames,
        "frames_used": one.used,
        "nm": {"equal_frames": one.nm_frames, "equal_light": one.nm_light, "equal_time": one.nm_time},
        "nm_as_recorded": as_recorded(one, found.frames),
        "bound_of_its_frames_nm": one.nm_bound,
        "rounding_nm": one.nm_rounding,
        "recommendable": one.recommendable,
    }
    if one.fringes is not None and one.safe is not None:
        facts |= {
            "periods": list(one.fringes.periods), "steps": one.fringes.steps, "ambiguous_share": one.ambiguous,
            "wrong_order_of_worst_pixel": one.wrong, "highest_safe_periods": one.safe.highest,
            "limited_by": one.safe.why, "gamma_bias_nm": one.bias_nm,
        }  # fmt: skip
    if one.lines is not None:
        facts |= {"line_width_px": one.lines[0], "line_step_px": one.lines[1]}
    return facts


def as_recorded(one: SetError, frames: int) -> float | None:
    """Height error in nm of the whole passes that fit the frames; None where none fits."""
    return one.nm_frames * float(np.sqrt(frames / one.used)) if one.used else None


def design_tables(found: PatternDesign) -> list[Table]:
    """The table of the terminal: the best of each kind of set."""
    camera = found.camera
    title = (
        f"{found.scene.name}: rms height error [nm] of {found.frames} frames; {camera.electrons:.4g} electrons in the "
        f"brightest pixel under a white screen, noise {np.sqrt(camera.noise.read):.3g} e-"
        f"{' and of the light' if camera.shot else ''}, {camera.exposure_s + camera.frame_s:.3g} s a frame"
    )
    head = ["patterns", "frames", "periods", "at equal frames", "at equal light", "at equal time", "over its bound",
            f"above {found.limit:g}", "highest safe", "limited by"]  # fmt: skip
    if found.gamma != 1:
        head.append(f"bias of gamma {found.gamma:g}")
    rows = [_row(one, found) for one in _shown(found)]
    bound = ("bound of any pattern", "", "", _nm(found.bound_frames_nm), _nm(found.bound_light_nm), "")
    rows.append((*bound, *[""] * (len(head) - len(bound))))
    return [Table(title, tuple(head), rows)]


def _shown(found: PatternDesign) -> list[SetError]:
    """The best number of steps of each kind of set; three steps only where more do not fit."""
    shown: dict[object, SetError] = {}
    for one in sorted(found.sets, key=lambda one: one.fringes is not None and not one.fringes.tells_noise):
        kind = one.lines if one.fringes is None else (one.fringes.family, len(one.fringes.periods))
        shown.setdefault(kind, one)
    return sorted(shown.values(), key=found.sets.index)


def _row(one: SetError, found: PatternDesign) -> tuple[str, ...]:
    cells = [
        one.name,
        f"{one.frames}{'' if one.used else ', too many'}",
        " ".join(f"{p:g}" for p in one.fringes.periods) if one.fringes else "",
        *(_nm(nm) for nm in (one.nm_frames, one.nm_light, one.nm_time)),
        f"{one.nm_frames / one.nm_bound:.2f}" if one.nm_bound > 0 and np.isfinite(one.nm_bound) else "",
    ]
    if one.safe is None:
        cells += ["", "", ""]
    else:
        cells += [f"{100 * one.ambiguous:.2g} %", f"{one.safe.highest:.3g}" if one.safe.found else "none", one.safe.why]
    if found.gamma != 1:
        cells.append("" if one.bias_nm is None else _nm(one.bias_nm))
    return tuple(cells)


def _nm(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "-"


def advice(found: PatternDesign, scene: str) -> list[str]:
    """What to do, a sentence a line. scene: as it was named."""
    best, fringes = found.best, found.best_fringes
    if best is None:
        return ["no set is safe: more frames or light, or a larger --ambiguity"]
    lines = []
    if best.lines is not None:
        width, step = best.lines
        lines.append(
            f"best: a line scan, width_px = {width}, step_px = {step} in the scene's table [screen.lines]: "
            f"{_nm(as_recorded(best, found.frames) or np.nan)} nm in {best.used} frames"
        )
        lines.append(f"  irtscots patterns {scene} --kind lines --line-width {width} --line-step {step}")
    if fringes is not None and fringes.fringes is not None:
        passes = fringes.used // fringes.frames
        times = "once" if passes == 1 else f"{passes} times, averaged"
        word = "best fringes" if best.lines is not None else "best"
        lines += [
            f"{word}: {fringes.name}, each frame {times}: {_nm(as_recorded(fringes, found.frames) or np.nan)} nm in "
            f"{fringes.used} frames, {_nm(fringes.nm_rounding)} nm of it rounding",
            f"  {command_of(fringes, scene)}",
        ]
    return lines


def write_design_figure(found: PatternDesign, folder: Path) -> str:
    """Height error against the highest number of periods, with the bounds, as a PNG file in the folder; its name."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = Figure(figsize=(8, 5), layout="tight")
    axes = figure.subplots()
    for curve in error_curve(found):
        (line,) = axes.loglog(curve.highest, curve.nm, "--", linewidth=1)
        axes.loglog(curve.highest, np.where(curve.safe, curve.nm, np.nan), color=line.get_color(), label=curve.name)
    for one in found.sets:
        if one.lines is not None and one.used:
            axes.axhline(one.nm_frames, color="0.6", linestyle="-.", linewidth=1)
            axes.annotate(one.name, (0.01, one.nm_frames), xycoords=("axes fraction", "data"), va="bottom", fontsize=8)
    axes.axhline(found.bound_frames_nm, color="k", linestyle=":", label="Cramer-Rao bound of any pattern")
    axes.set(xlabel="highest number of periods over the screen", ylabel="rms height error, nm",
             title=f"{found.scene.name}, {found.frames} frames; dashed: not safe")  # fmt: skip
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.grid(True, which="both", alpha=0.3)
    axes.legend(fontsize=8)
    with replacing(folder / NAME) as temporary:
        figure.savefig(temporary, dpi=120)
    return NAME
