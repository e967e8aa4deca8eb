"""Your own mirror: a 406 mm f/4 paraboloid, a 27 inch 4K monitor and a machine-vision camera."""

import sys
from dataclasses import replace

import irtscots_cl as irt

quick = "--quick" in sys.argv
bench = irt.Bench(screen_diagonal_mm=27 * 25.4, screen_pixels=(3840, 2160), sensor_pixels=(2448, 2048))
first = irt.design(406.4, 2 * 4 * 406.4, conic=-1.0, name="newtonian", bench=bench)
check = irt.check_scene(first.scene, heights=not quick)
print(f"{check.measured:.0%} of the mirror is measured; {len(check.findings)} remarks, the worst: {check.worst}")
for finding in check.findings:
    print(f"  {finding.level}: {finding.text}")

# What is to be found: 20 nm rms of astigmatism on the mirror that is made
terms = irt.ZernikeTerms(radius_mm=203.2, ordering="noll", coefficients_um={6: 0.02})
made = replace(first.scene, mirror=replace(first.scene.mirror, zernike=(terms,)))
run = irt.trace(made, rays_per_pixel=16 if quick else 256, smoothing=True)
result = irt.measure_by("fine", run.images(irt.LineScan(made)), first.scene)
print(irt.compare(result, made))
