"""Ghosts of a real lens: the light that they bring to the detector, and the height that they add, by its coating."""

import sys
from dataclasses import replace

import irtscots_cl as irt

quick = "--quick" in sys.argv
scene = irt.load_scene("sphere-singlet")
detector = replace(scene.camera.detector, pixels=(25, 25), pitch_mm=0.185)  # few pixels: more rays for each
scene = replace(scene, camera=replace(scene.camera, detector=detector))
for reflectance in (0.04, 0.01, 0.0025):  # uncoated, a single layer, a broadband coating
    lens = tuple(replace(surface, reflectance=reflectance) for surface in scene.element)
    light = irt.trace_paths(replace(scene, element=lens), rays_per_pixel=1024 if quick else 16384, branches="split")
    print(f"each surface of the lens reflects {reflectance:.2%}")
    for stray in irt.stray_light(light):
        print(f"  {stray.kind}: {stray.of_direct:.2e} of the direct light, {stray.height_nm} nm rms of height")
