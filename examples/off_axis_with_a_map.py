"""An off-axis segment with a measured height map on it: grooves of polishing, 5 nm high and 60 mm apart."""

import sys
from dataclasses import replace

import numpy as np

import irtscots_cl as irt

quick = "--quick" in sys.argv
scene = irt.load_scene("off-axis")
pitch_mm = 4.0
x_mm = (np.arange(270) - 134.5) * pitch_mm
heights_mm = 5e-6 * np.sin(2 * np.pi * x_mm / 60.0) * np.ones((270, 1))
table = irt.MirrorMap(heights=irt.HeightMap(heights_mm, pitch_mm=(pitch_mm, pitch_mm)))  # or file="part.datx"
scene = replace(scene, mirror=replace(scene.mirror, map=(table,)))

run = irt.trace(scene, estimator="analytic") if quick else irt.trace(scene, rays_per_pixel=256, smoothing=True)
result = irt.measure_by("fine", run.images(irt.LineScan(scene)), scene.nominal())
found = irt.compare(result, scene)
measured = irt.height_map(result)
print(f"rms of the measured deviation: {np.nanstd(measured.heights_mm) * 1e6:.2f} nm; put on: {5 / 2**0.5:.2f} nm")
print(f"error without piston and tilt: {found.height_error_nm['piston_tilt']} nm")
