"""The paper's test of a deviated sphere: rays from the screen to the camera, images, centroids, slopes, height."""

import sys

import irtscots_cl as irt

quick = "--quick" in sys.argv
scene = irt.load_scene("sphere-deviated")
run = irt.trace(scene, rays_per_pixel=64 if quick else 16384, seed=1)
stack = run.images(irt.LineScan(scene))
result = irt.reconstruct(stack, scene.nominal())
found = irt.compare(result, scene)
print(found)
