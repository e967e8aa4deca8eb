#!/usr/bin/env python3
"""Heights from images with noise, background and unequal frames: print the tables of docs/real-light.md.

tools/real_light.py [noise] [pulls] [cameras] [alarms] [faults] [--seeds N]: all without names. Images are those of a
scene in closed form with NumPy's noise added, so that nothing but the measurement is judged. Slow: some 10 minutes.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from irtscots_cl import LineScan, error_bars, estimate_centroids, load_scene, measure_by, trace
from irtscots_cl.imaging.image_stack import ImageStack, Scan
from irtscots_cl.maths.low_order import remove_terms, rms
from irtscots_cl.maths.zernike.polynomials import zernike
from irtscots_cl.measurement.error_bars import ErrorBars
from irtscots_cl.measurement.quality import check_images
from irtscots_cl.measurement.reconstruction import Reconstruction
from irtscots_cl.measurement.saturation import find_ceiling
from irtscots_cl.optics.setup import Setup
from irtscots_cl.optics.surface import Surface

PIXELS = 45  # of a coarse camera, for statistics over many seeds
LINES = 21
TERMS = 45  # Noll terms of the pulls


class Case:
    """A scene with its noise-free images [pixels, lines] of both scans, and its truth."""

    def __init__(self, scene):
        self.setup, self.surface = Setup(scene.nominal()), Surface.of(scene.mirror)
        stack = trace(scene, estimator="analytic").images(LineScan(scene))
        self.scans = (stack.x, stack.y)
        self.clean = [dense(scan) for scan in self.scans]
        self.peak = max(float(images.max()) for images in self.clean)

    def images(self, change) -> ImageStack:
        """The images, each scan's [pixels, lines] in peaks changed by `change`."""
        return ImageStack(
            *(
                replace(
                    scan,
                    first_line=np.zeros(len(images), np.int64),
                    flux_w=change(images / self.peak)[None],
                    hits=np.full(len(images), np.nan),
                    weights=np.ones(1),
                )
                for scan, images in zip(self.scans, self.clean, strict=True)
            )
        )

    def error_mm(self, result: Reconstruction) -> np.ndarray:
        """Height error [rows, columns] of a result, piston and tilt removed."""
        truth = self.surface.deviation_at(result.x_mm, result.y_mm)[0]
        return remove_terms(result.x_mm, result.y_mm, result.deviation_mm - truth, result.mask, "piston_tilt")


def dense(scan: Scan) -> np.ndarray:
    """Curves [pixels, lines] of a simulated scan, dark outside the windows."""
    lines = len(scan.positions_mm)
    full = np.zeros((len(scan.pixels), lines + scan.flux_w.shape[2]))
    np.put_along_axis(full, scan.lines, scan.mean_w(), 1)
    return full[:, :lines]


def small_scene(pixels: int = PIXELS, lines: int = LINES):
    scene = load_scene("sphere-deviated")
    detector = scene.camera.detector
    coarse = replace(
        detector, pixels=(pixels, pixels), pitch_mm=detector.pitch_mm * detector.pixels[0] / pixels
    )  # fmt: skip
    screen = replace(scene.screen, pixels=(lines, lines))
    return replace(scene, camera=replace(scene.camera, detector=coarse), screen=screen)


def changed(random: np.random.Generator, noise: float, pedestal=0.0, drift=0.0, jitter=0.0):
    """Noise and pedestal in peaks; drift over the scan and jitter from frame to frame, relative."""

    def change(images: np.ndarray) -> np.ndarray:
        lines = images.shape[1]
        gain = (1 + drift * np.linspace(-0.5, 0.5, lines)) * (1 + jitter * random.standard_normal(lines))
        return images * gain + pedestal + noise * random.standard_normal(images.shape)

    return change


def rows(case: Case, measure: str, seeds: int, **noise) -> list[tuple[Reconstruction, ErrorBars, np.ndarray]]:
    found = []
    for seed in range(seeds):
        result = measure_by(measure, case.images(changed(np.random.default_rng(seed), **noise)), case.setup)
        found.append((result, error_bars(result), case.error_mm(result)))
    return found


def noise_table(seeds: int) -> None:
    """Height errors by noise, background and unequal frames, with the Cramer-Rao bound of the same samples."""
    settings = [
        {"noise": 0.001}, {"noise": 0.003}, {"noise": 0.01}, {"noise": 0.03},
        {"noise": 0.01, "pedestal": 0.01}, {"noise": 0.01, "pedestal": 0.2}, {"noise": 0.001, "pedestal": 0.2},
        {"noise": 0.01, "drift": 0.05}, {"noise": 0.01, "jitter": 0.03},
        {"noise": 0.001, "pedestal": 0.2, "drift": 0.05, "jitter": 0.03},
    ]  # fmt: skip
    for lines in (LINES, 201):
        case = Case(small_scene(lines=lines))
        print(f"\n{lines} lines a scan, {seeds} seeds\n")
        print("| noise | pedestal | drift | jitter | measure | height error [nm] | stated [nm] | bias [nm] | / bound |")
        print("|---|---|---|---|---|---|---|---|---|")
        for setting in settings if lines == LINES else settings[:3]:
            for measure in ("likelihood", "windowed"):
                found = rows(case, measure, seeds, **setting)
                error = rms_nm([e for _, _, e in found], found)
                stated = float(np.sqrt(np.mean([rms(b.height_mm, r.mask) ** 2 for r, b, _ in found]))) * 1e6
                bound = np.mean([[of_bound(e) for e in r.estimates_of_scans] for r, _, _ in found])
                words = [f"{setting.get(name, 0):g}" for name in ("noise", "pedestal", "drift", "jitter")]
                figures = f"{error:.3g} | {stated:.3g} | {bias_nm(found):.2g} | {bound:.3f}"
                print(f"| {' | '.join(words)} | {measure} | {figures} |")


def of_bound(estimate) -> float:
    good = estimate.flags == 0
    return float(np.sqrt(np.nanmean((estimate.error_mm[good] / estimate.bound_mm[good]) ** 2)))


def rms_nm(errors: list[np.ndarray], found) -> float:
    return float(np.sqrt(np.mean([rms(e, r.mask) ** 2 for e, (r, _, _) in zip(errors, found, strict=True)]))) * 1e6


def bias_nm(found) -> float:
    """Rms of the mean error map, less what noise leaves in a mean of so many."""
    maps = np.stack([np.where(r.mask, e, np.nan) for r, _, e in found])
    count = np.isfinite(maps).sum(0)
    use = count == len(maps)
    mean, spread = maps[:, use].mean(0), maps[:, use].std(0, ddof=1)
    return float(np.sqrt(max(np.mean(mean**2) - np.mean(spread**2) / len(maps), 0.0))) * 1e6


def pulls_table(seeds: int) -> None:
    """Errors over stated errors: mean, standard deviation, and how often 95 % intervals hold the truth."""
    case = Case(small_scene())
    print(f"\nPulls, 1 % of the peak, {seeds} seeds\n\n| measure | of | mean | standard deviation | within 1.96 |")
    print("|---|---|---|---|---|")
    for measure in ("likelihood", "windowed"):
        found = rows(case, measure, seeds, noise=0.01)
        kinds: dict[str, list[np.ndarray]] = {"slope": [], "height": [], "Zernike": [], "piston": []}
        for result, bars, error in found:
            mask = result.mask
            for axis, truth in zip("xy", case.surface.gradient(result.x_mm, result.y_mm), strict=True):
                off = getattr(result, f"slope_{axis}") - truth
                kinds["slope"].append((off / getattr(bars, f"slope_{axis}"))[mask])
            kinds["height"].append((error / bars.height_mm)[mask])
            radius = case.surface.aperture_radius_mm
            x, y = result.x_mm[mask] / radius, result.y_mm[mask] / radius
            basis = np.stack([zernike(j, x, y) for j in range(1, TERMS + 1)], 1)
            fit = np.linalg.pinv(basis)
            off = result.deviation_mm[mask] - case.surface.deviation_at(result.x_mm, result.y_mm)[0][mask]
            pull = fit @ (off - off.mean()) / (fit @ bars.draws_mm[:, mask].T).std(1)
            kinds["Zernike"].append(pull)
            kinds["piston"].append(pull[:1])
        for kind, values in kinds.items():
            pull = np.stack(values) if kind in ("Zernike", "piston") else np.concatenate(values)
            within = np.mean(np.abs(pull) < 1.96)
            print(f"| {measure} | {kind} | {pull.mean():+.3f} | {pull.std():.3f} | {within:.1%} |")
        worst = np.abs(np.mean(kinds["Zernike"], axis=0)).max()
        print(f"| {measure} | largest mean of one Zernike term | {worst:.3f} | | |")


def cameras_table(seeds: int) -> None:
    """A 12-bit camera with a full well of 10,000 electrons, 20 frames averaged; shot noise by the closed form."""
    from irtscots_cl import record
    from irtscots_cl.scene.detector_noise import DetectorNoise

    noise = DetectorNoise(
        electrons_at_peak=8000.0, shot_noise=True, read_noise_e=5.0, full_well_e=10000.0, gain_e_per_dn=2.5,
        offset_dn=64.0, bits=12, frames_averaged=20,
    )  # fmt: skip
    print("\n| scene | electrons a curve | centroid error [um] | plain centroid, shot noise alone [um] "
          "| height error [nm] | stated [nm] |\n|---|---|---|---|---|---|")  # fmt: skip
    for name in ("sphere-deviated", "off-axis"):
        scene = load_scene(name)
        case = Case(scene)
        clean = ImageStack(*case.scans)
        scene = replace(scene, camera=replace(scene.camera, detector=replace(scene.camera.detector, noise=noise)))
        result = measure_by("likelihood", record(clean, scene), case.setup)
        bars, error = error_bars(result), case.error_mm(result)
        electrons = float(np.median(case.clean[0].sum(1))) / case.peak * 8000 * 20
        by_scan = of_result(result), shot_noise(case, 8000 * 20)
        stated, shot = (np.median([of(k) for k in range(2)]) for of in by_scan)
        print(
            f"| {name} | {electrons:.3g} | {stated * 1e3:.3g} | {shot * 1e3:.3g} | {rms(error, result.mask) * 1e6:.3g} "
            f"| {rms(bars.height_mm, result.mask) * 1e6:.3g} |"
        )


def of_result(result: Reconstruction):
    """Median stated error in mm of the centroids of a scan, by its number."""
    return lambda k: float(np.median(result.estimates_of_scans[k].error_mm[result.estimates_of_scans[k].flags == 0]))


def shot_noise(case: Case, electrons_at_peak: float):
    """Median standard error in mm of the curves' centroids by shot noise alone, by the scan's number: the light's own
    rms width over the root of its electrons."""

    def of_scan(k: int) -> float:
        curves, place = case.clean[k], case.scans[k].positions_mm
        lit = curves[curves.sum(1) > 0.5 * np.median(curves.sum(1))]
        share = lit / lit.sum(1, keepdims=True)
        width = np.sqrt((share * (place - (share * place).sum(1, keepdims=True)) ** 2).sum(1))
        return float(np.median(width / np.sqrt(lit.sum(1) / case.peak * electrons_at_peak)))

    return of_scan


def alarms_table(seeds: int) -> None:
    """Checks that good images with noise fail: false alarms."""
    case = Case(small_scene())
    failed = 0
    for seed in range(seeds):
        stack = case.images(changed(np.random.default_rng(seed), noise=0.01, pedestal=0.02))
        result = measure_by("likelihood", stack, case.setup)
        checks = check_images(stack, case.setup, result.estimates_of_scans)
        bad = [check.name for check in checks if check.level != "ok"]
        failed += bool(bad)
        if bad:
            print(f"seed {seed}: {', '.join(bad)}")
    print(f"\nFalse alarms: {failed} of {seeds} good stacks of images with 1 % of noise failed a check.")


def faults_table(_seeds: int) -> None:
    """What becomes of images with a fault: those of tests/support/image_faults.py, with 0.2 % of noise."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
    from image_faults import FAULTS
    from noisy_images import height_difference_nm, images_of, setup_of

    print("\n| fault | checks that name it | height [nm] | stated [nm] |\n|---|---|---|---|")
    for fault in FAULTS:
        setup = setup_of(fault.scene)
        images = fault.make(images_of(fault.scene).noisy(0.002, seed=1), np.random.default_rng(2))
        stack = images.stack()
        stack = stack.saturating_at(find_ceiling(stack))
        try:
            result = measure_by("likelihood", stack, setup)
        except ValueError as error:
            print(f"| {fault.name} | refused: {str(error).split('; ')[-1]} | | |")
            continue
        checks = check_images(stack, setup, estimate_centroids(stack, setup, "likelihood"))
        named = ", ".join(check.name + " (error)" * (check.level == "error") for check in checks if check.level != "ok")
        if any(check.level == "error" for check in checks):
            print(f"| {fault.name} | {named} | refused | |")
            continue
        exact = measure_by("likelihood", images_of(fault.scene).stack(), setup)
        stated = rms(error_bars(result).height_mm, result.height_mask) * 1e6
        print(f"| {fault.name} | {named} | {height_difference_nm(result, exact):.3g} | {stated:.3g} |")


TABLES = {
    "noise": noise_table,
    "pulls": pulls_table,
    "cameras": cameras_table,
    "alarms": alarms_table,
    "faults": faults_table,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"of {', '.join(TABLES)}; default all")
    parser.add_argument("--seeds", type=int, default=200, metavar="N", help="of the pulls and alarms; default 200")
    options = parser.parse_args()
    for name in options.tables or TABLES:
        if name not in TABLES:
            parser.error(f"{name!r}: must be one of {', '.join(TABLES)}")
        TABLES[name](max(options.seeds // 10, 4) if name == "noise" else options.seeds)


if __name__ == "__main__":
    main()
