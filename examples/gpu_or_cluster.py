"""The same rays on every device of this machine, or on a Dask cluster: the same bits.

python gpu_or_cluster.py [--quick] [--cluster [tcp://scheduler:8786]]
"""

import sys

import numpy as np

import irtscots_cl as irt

if __name__ == "__main__":  # workers of a local cluster import this file
    quick = "--quick" in sys.argv
    scene = irt.load_scene("sphere-deviated")
    how = {"rays_per_pixel": 64 if quick else 4096, "seed": 1}
    for device in irt.all_devices():
        print(device.name)
    one = irt.trace(scene, **how)  # the best device; IRTSCOTS_DEVICE=gpu takes a GPU
    if "--cluster" in sys.argv:
        from dask.distributed import Client

        with Client(*[word for word in sys.argv if word.startswith("tcp:")]) as client:
            many = irt.trace(scene, client=client, **how)
    else:
        many = irt.trace(scene, device=irt.select_devices("all"), **how)
    images = [run.images(irt.LineScan(scene)).x.flux_w for run in (one, many)]
    print("same bits:", np.array_equal(*images))
