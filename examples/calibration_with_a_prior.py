"""A camera that stands 0.3 mm beside its place: found from the images, with what a tape measure knows as a prior."""

import sys
from dataclasses import replace
from pathlib import Path

import irtscots_cl as irt
from irtscots_cl.calibration.from_images import from_images
from irtscots_cl.scene.presets import with_noise_file

quick = "--quick" in sys.argv
scene = with_noise_file(irt.load_scene("sphere"), Path(__file__).with_name("camera-12-bit.toml"))
if quick:  # a camera of fewer, larger pixels
    detector = replace(scene.camera.detector, pixels=(40, 40), pitch_mm=0.037 * 125 / 40)
    scene = replace(scene, camera=replace(scene.camera, detector=detector))
known = {"camera.x_mm": irt.Knowledge(sigma=0.5), "camera.z_mm": irt.Knowledge(sigma=0.05, source="a rod")}
believed = replace(scene, calibration=irt.Calibration(known=known))
built = irt.moved(scene, {"camera.x_mm": 0.3, "camera.tilt_x_rad": 2e-4})

stack = irt.record(irt.trace(built, estimator="analytic").images(irt.LineScan(built)), built)
data, checks = from_images(stack, believed)
unknowns = irt.Unknowns(names=("camera.x_mm", "camera.z_mm", "camera.tilt_x_rad"), mirror_order=4)
found = irt.calibrate([data], believed, unknowns)
print(found.verdict)
for name, value, error in zip(found.fit.names, found.fit.values, found.fit.errors, strict=True):
    if name.startswith("camera"):
        print(f"{name:18} {value:+.5f} +- {error:.5f}")
