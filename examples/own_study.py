"""A question of one's own: height error against the diameter of the camera's aperture, and against the rays."""

import sys
from dataclasses import replace

import irtscots_cl as irt

quick = "--quick" in sys.argv
print("aperture [mm]   rays per pixel   height error [nm rms]")
for aperture_mm in (0.5, 1.0, 2.0):
    scene = irt.load_scene("sphere-deviated")
    scene = replace(scene, camera=replace(scene.camera, aperture_diameter_mm=aperture_mm))
    for rays in (16, 64) if quick else (256, 1024, 4096):
        run = irt.trace(scene, rays_per_pixel=rays, seed=1)
        result = irt.reconstruct(run.images(irt.LineScan(scene)), scene.nominal())
        error = irt.compare(result, scene).height_error_nm["piston_tilt"]
        print(f"{aperture_mm:13}   {rays:14}   {error}")
