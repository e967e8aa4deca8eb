"""Scattered light: the same roughness, 2 nm rms, on the mirror and on the front of the camera's lens."""

import sys
from dataclasses import replace

import irtscots_cl as irt
from irtscots_cl.scene.scatter.models import Harvey

quick = "--quick" in sys.argv
lobe = Harvey(l=0.01, s=-1.5, roughness_nm=2.0, wavelength_nm=500.0)
scene = irt.load_scene("sphere-singlet")
detector = replace(scene.camera.detector, pixels=(25, 25), pitch_mm=0.185)  # few pixels: more rays for each
scene = replace(scene, camera=replace(scene.camera, detector=detector))
front, back = scene.element
rough = {
    "mirror": replace(scene, mirror=replace(scene.mirror, scatter=lobe)),
    "lens": replace(scene, element=(replace(front, scatter=lobe), back)),
}
for part, dull in rough.items():
    light = irt.trace_paths(dull, rays_per_pixel=1024 if quick else 65536)
    for stray in irt.stray_light(light):
        if stray.kind == "scatter":
            print(f"{part}: {stray.of_direct:.2e} of the direct light, {stray.height_nm} nm rms of height")
