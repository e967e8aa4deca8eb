"""Screens of uneven brightness, by +-10 % (paper, section 3.3 and figure 9), from one transport map."""

from __future__ import annotations

import numpy as np

from irtscots_cl.analysis.comparison import HEIGHT_TERMS
from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.maths.statistics import Estimate
from irtscots_cl.measurement.methods import measure_by
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.optics.setup import Setup
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.studies.drawing import maps
from irtscots_cl.studies.traces import SEED, SharedTraces
from irtscots_cl.studies.verdicts import StudyResult, exact, row
from irtscots_cl.tracing.results.transport import Transport
from irtscots_cl.tracing.trace import trace

TITLE = "Brightness variations of the screen, ideal sphere (figure 9)"
AMPLITUDE = 0.1
PRINTED_NM = {"linear": 94.09, "random": 43.01}
# Where +-10 % is reached, in half pixels beyond the outermost pixels' centres. The paper does not state it.
ENDS = {"the screen's edges": 1, "the outermost pixels' centres": 0}
PAPER_NOISE_NM = 7.08 * 2**0.5  # its numerical error, for the difference of two maps
RAYS, DRAWS = 16384, 40


def study(traces: SharedTraces) -> StudyResult:
    scene = load_scene("sphere")
    transport = trace(scene, device=traces.device, estimator="adjoint", sampler="sobol", rays_per_pixel=RAYS,
                      replicates=1, seed=SEED, progress=traces.progress, keeper=traces.keeper)  # fmt: skip
    nominal = Setup(scene.nominal())
    even = _measured(transport, nominal, None)
    random = np.random.default_rng(SEED)
    size = (DRAWS // 2 if traces.quick else DRAWS, *scene.screen.pixels[::-1])
    draws = list(1 + AMPLITUDE * random.uniform(-1, 1, size))
    linear = {f"linear, to {where}": _linear(scene, span) for where, span in ENDS.items()}
    heights = {kind: [_difference(transport, nominal, b, even)] for kind, b in linear.items()}
    heights["random"] = [_difference(transport, nominal, draw, even) for draw in draws]
    rows = []
    for kind, found in heights.items():
        for terms in HEIGHT_TERMS:
            values = [rms(remove_terms(even.x_mm, even.y_mm, h, even.mask, terms), even.mask) for h in found]
            rows.append(_row(kind, terms, np.array(values), scene))
    drawn, *_ = linear
    shown = [remove_terms(even.x_mm, even.y_mm, heights[kind][0], even.mask, "piston") for kind in (drawn, "random")]
    figure = maps(
        [("linear", linear[drawn]), ("random, first draw", draws[0]), ("height difference, linear", shown[0]),
         ("height difference, random", shown[1])],
        ["relative brightness"] * 2 + ["nm"] * 2, [(0.9, 1.1), (0.9, 1.1), None, None], ("column", "row"), columns=2,
        of_detector=[False] * 2 + [True] * 2,  # the first are of the screen
    )  # fmt: skip
    removed = [
        (f"{kind.split(',')[0]}, without {terms.replace('_', ', ')}",
         remove_terms(even.x_mm, even.y_mm, heights[kind][0], even.mask, terms))
        for kind in (drawn, "random") for terms in HEIGHT_TERMS
    ]  # fmt: skip
    return StudyResult(tuple(rows), (
        f"one transport map of {transport.rays_total:,} adjoint rays, Sobol, seed {SEED}; every brightness is a "
        "product with it; height differences from the even screen, so ray noise nearly cancels",
        f"linear: 0.9 to 1.1 across the screen's columns; the paper's number carries {PAPER_NOISE_NM:.0f} nm of its "
        "own ray noise",
        "expected: centroids shift by the light curve's variance, a^2/4 + d^2/12, times the brightness' relative "
        "slope, everywhere alike: tilt",
        f"random: uniform in 0.9 to 1.1 per screen pixel; {len(draws)} draws, mean and, in brackets, standard "
        "deviation of one",
        "the paper's 94.09 nm is tilt that was not removed; its 43.01 nm is one draw",
    ), {"fig9.png": figure, "fig9_removed.png": maps(removed, "nm")})  # fmt: skip


def _linear(scene: Scene, beyond: int) -> np.ndarray:
    """Brightness [rows, columns] that reaches +-AMPLITUDE `beyond` half pixels beyond the outermost pixels' centres."""
    columns, rows = scene.screen.pixels
    across = (2 * np.arange(columns) - (columns - 1)) / (columns - 1 + beyond)
    return np.broadcast_to(1 + AMPLITUDE * across, (rows, columns))


def _measured(transport: Transport, nominal: Setup, brightness: np.ndarray | None) -> Reconstruction:
    return measure_by("paper", transport.images(LineScan(transport.scene, brightness)), nominal)


def _difference(transport: Transport, nominal: Setup, brightness: np.ndarray, even: Reconstruction) -> np.ndarray:
    """Height [rows, columns] in nm that the brightness adds."""
    return 1e6 * (_measured(transport, nominal, brightness).deviation_mm - even.deviation_mm)


def _row(kind: str, terms: str, values: np.ndarray, scene: Scene):
    quantity = f"{kind}, without {terms.replace('_', ', ')} [nm]"
    paper = PRINTED_NM[kind.split(",")[0]] if terms == "piston" else np.nan
    if kind != "random":
        tilt = _tilt_nm(scene, ENDS[kind.removeprefix("linear, to ")])
        expected = tilt if terms == "piston" else np.nan
        return row(quantity, exact(values[0]), paper=paper, expected=expected, allowed=0.05 * tilt,
                   closeness=PAPER_NOISE_NM / PRINTED_NM["linear"])  # fmt: skip
    spread = values.std(ddof=1)
    # the paper's number is one draw: it agrees within three standard deviations of one draw
    return row(f"{quantity} ({spread:.2g})", Estimate(values.mean(), spread / np.sqrt(len(values))), paper=paper,
               closeness=3 * spread / PRINTED_NM[kind])  # fmt: skip


def _tilt_nm(scene: Scene, beyond: int) -> float:
    """Height rms of the tilt that a linear brightness gives."""
    radius, pitch, columns = scene.camera.aperture_diameter_mm / 2, scene.screen.pitch_mm, scene.screen.pixels[0]
    variance = radius**2 / 4 + pitch**2 / 12
    shift = variance * 2 * AMPLITUDE / ((columns - 1 + beyond) * pitch)
    return 1e6 * shift / (2 * scene.mirror.radius_mm) * scene.mirror.diameter_mm / 4
