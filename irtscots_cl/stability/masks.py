"""Cases: integration of slopes on difficult masks: bridges, islands, a ring, a pixel, a million nodes."""

from __future__ import annotations

import multiprocessing
import time
from functools import partial

import numpy as np
from skimage.measure import label

from irtscots_cl.maths.integration import integrate_slopes
from irtscots_cl.stability.checks import Bench, Case, Finding, Limit, count, finding
from irtscots_cl.system.memory import peak_bytes

SIZE = 64
STEP_MM = 2.0
EXACT = Limit(1e-6, "nm", "rounding of a millimetre of sag: the method is exact for quadratics on any nodes")
LARGE = 1000
SECONDS = Limit(10.0, "s", "a measurement's other steps take as long")
MEMORY = Limit(2.0, "GiB", "what a small computer has to spare")


def _surface(x_mm: np.ndarray, y_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A quadratic: height in mm and its slopes."""
    a, b, c = 1e-5, -2e-5, 1.5e-5
    height = a * x_mm**2 + b * x_mm * y_mm + c * y_mm**2 + 1e-3 * x_mm - 2e-3 * y_mm
    return height, 2 * a * x_mm + b * y_mm + 1e-3, b * x_mm + 2 * c * y_mm - 2e-3


def _nodes(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Node positions [size, size]: a sheared and bent grid, as an oblique camera sees a mirror."""
    row, column = np.meshgrid(np.arange(size) - size / 2, np.arange(size) - size / 2, indexing="ij")
    return STEP_MM * (column + 0.1 * row + 1e-4 * column * row), STEP_MM * (row - 0.05 * column)


def _masks() -> dict[str, np.ndarray]:
    row, column = np.meshgrid(np.arange(SIZE), np.arange(SIZE), indexing="ij")
    radius = np.hypot(row - SIZE / 2 + 0.5, column - SIZE / 2 + 0.5)
    empty = np.zeros((SIZE, SIZE), bool)
    bridge = (column < 20) | (column > 40) | (row == 31)
    spiral = (radius < 31) & (((np.arctan2(row - 31.5, column - 31.5) / (2 * np.pi) + radius / 6) % 1) < 0.55)
    pixel = empty.copy()
    pixel[10, 50] = True
    diagonal = np.eye(SIZE, dtype=bool)  # every pixel touches the next only at a corner
    comb = (row < 3) | (column % 2 == 0)
    return {
        "a disk": radius < 31,
        "two halves and a one-pixel bridge": bridge,
        "a ring": (radius < 31) & (radius > 12),
        "a ring one pixel wide": (radius < 31) & (radius > 29.5),
        "a spiral": spiral,
        "three islands": ((row // 16) % 2 == 0) & (row < 48) & (radius < 31) | pixel,
        "a comb with teeth one pixel wide": comb,
        "a single pixel": pixel,
        "a diagonal of lone pixels": diagonal,
        "every second pixel": (row + column) % 2 == 0,
    }


def _quadratic(mask: np.ndarray, bench: Bench) -> list[Finding]:
    """Every island's heights minus the true ones, each without its own mean."""
    x, y = _nodes(SIZE)
    height, slope_x, slope_y = _surface(x, y)
    nan = np.where(mask, 0.0, np.nan)  # nothing outside the mask may matter
    found = integrate_slopes(x + nan, y + nan, slope_x + nan, slope_y + nan, mask, join=False)
    islands, errors, means = label(mask, connectivity=1), np.zeros(mask.shape), []
    for island in range(1, islands.max() + 1):
        at = islands == island
        means.append(found[at].mean())
        errors[at] = found[at] - (height[at] - height[at].mean())
    return [
        finding("height of each island less its piston", errors[mask] * 1e6, EXACT),
        finding(f"piston of {len(means)} islands", np.array(means) * 1e6, EXACT),
        count(
            "values outside the mask", np.sum(np.isfinite(found) != mask), mask.size, "no number where none is known"
        ),
    ]


def _large_job(size: int, answer) -> None:
    """Runs in a separate process, so that its peak memory is that of this job."""
    x, y = _nodes(size)
    height, slope_x, slope_y = _surface(x, y)
    started = time.perf_counter()
    found = integrate_slopes(x, y, slope_x, slope_y, np.ones((size, size), bool))
    seconds = time.perf_counter() - started
    error = found - (height - height.mean())
    answer.send((np.abs(error).max(), np.sqrt(np.mean(error**2)), seconds, peak_bytes() or np.nan))


def _large(bench: Bench) -> list[Finding]:
    here, there = multiprocessing.get_context("spawn").Pipe()
    process = multiprocessing.get_context("spawn").Process(target=_large_job, args=(LARGE, there))
    process.start()
    there.close()  # so that the pipe closes when the process ends
    try:
        largest, rms, seconds, memory = here.recv()
    except EOFError:  # for example killed for its memory
        return [count("jobs that died", 1, 1, "a small computer must do it")]
    finally:
        process.join()
    limit = Limit(0.01, "nm", "rounding that a million steps of 1 um add up")
    return [
        Finding("height", largest * 1e6, rms * 1e6, LARGE**2, limit),
        finding("time", [seconds], SECONDS),
        finding("memory of the process", [memory / 2**30], MEMORY),
    ]


CASES = (
    *(Case("integration", name, partial(_quadratic, mask), on_host=True) for name, mask in _masks().items()),
    Case("integration", "a million nodes", _large, long=True, on_host=True),
)
