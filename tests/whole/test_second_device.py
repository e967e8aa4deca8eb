"""Two OpenCL implementations agree: whole numbers bit for bit, the same rays but for rounding, others within noise.

tools/second_device makes an environment with two; with one these tests are skipped.
"""

from __future__ import annotations

import numpy as np
import pytest
from device_kernels import draw_on
from fuzz import seeds
from scipy import stats
from significance import sidak_p

from irtscots_cl.imaging.patterns import LineScan
from irtscots_cl.opencl.device import Device, all_devices
from irtscots_cl.opencl.kernel import Workspace
from irtscots_cl.opencl.program import compose
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.tracing.trace import trace

pytestmark = pytest.mark.needs_device  # its fixture finds two
FAILURE_CHANCE = 1e-6  # of the one statistical test, of each estimator
REPLICATES = 32
OTHER_BINS = 1e-3  # of the rays: rounding takes those at an edge to the other side


@pytest.fixture(scope="module")
def two() -> tuple[Device, Device]:
    """The first device of each of two platforms."""
    of_platform = {device.platform: device for device in reversed(all_devices()) if device.platform != "Oclgrind"}
    if len(of_platform) < 2:
        pytest.skip("one OpenCL platform here: tools/second_device makes an environment with two")
    first, second, *_ = of_platform.values()
    return first, second


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Scene:
    """sphere-deviated on small grids."""
    path = tmp_path_factory.mktemp("scene") / "small.toml"
    path.write_text(next(text for text in seeds() if '"sphere-deviated"' in text))
    return load_scene(path)


@pytest.mark.parametrize("sampler", ["philox", "sobol", "lattice"])
def test_words_are_the_same(two, tmp_path, sampler):
    for width in (1, 8, 16):
        one, other = (draw_on(device, tmp_path, sampler, width)(2**63 + 5, 1234, 3, 2**33, 1024) for device in two)
        assert np.unique(one).size > 4000 and np.array_equal(one, other)


def test_sums_are_the_same(two):
    random = np.random.default_rng(4)
    amounts, targets = random.integers(0, 2**63, 2**14, dtype=np.uint64), random.integers(0, 5, 2**14, dtype=np.uint32)
    found = []
    for device in two:
        work = Workspace(device, compose("probe_sums.cl", {}, {}, "fp32", 1), "probe_sums")
        sums = work.empty(8 * 5)
        work.clear(sums)
        work.launch((len(amounts), 1), [work.upload(amounts), work.upload(targets), sums])
        found.append(work.download(sums, np.zeros(5, np.uint64)).tolist())
    assert found[0] == found[1] == [sum(int(a) for a in amounts[targets == k]) % 2**64 for k in range(5)]


ESTIMATORS = {
    "forward": {"estimator": "forward", "rays_per_pixel": 2**16},
    "adjoint": {"estimator": "adjoint", "rays_per_pixel": 2**12},
    "lines": {"estimator": "adjoint", "smoothing": True, "rays_per_pixel": 2**12},
}


@pytest.mark.parametrize("precision", ["fp32", "fp64"])
@pytest.mark.parametrize("estimator", ["forward", "adjoint"])
def test_the_same_rays_land_in_the_same_bins(two, scene, estimator, precision):
    """All but those that rounding takes over an edge."""
    options = ESTIMATORS[estimator] | {"precision": precision, "replicates": 1}
    one, other = (trace(scene, device=device, seed=7, **options).counts.astype(float) for device in two)
    assert np.abs(one - other).sum() < 2 * OTHER_BINS * one.sum()


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_other_rays_bring_the_same_light(two, scene, estimator):
    """Flux of each pixel and of all in both scans: t tests over the replicates."""
    options = ESTIMATORS[estimator] | {"replicates": REPLICATES}
    runs = [trace(scene, device=device, seed=seed, **options) for seed, device in enumerate(two)]
    for scan in ("x", "y"):
        fluxes = [getattr(run.images(LineScan(scene)), scan).flux_w.sum(-1) for run in runs]
        fluxes = [np.column_stack([flux, flux.sum(1)]) for flux in fluxes]
        lit = np.minimum(*(flux.mean(0) for flux in fluxes)) > 0
        assert lit.sum() > 20
        p = stats.ttest_ind(*(flux[:, lit] for flux in fluxes), equal_var=False).pvalue
        assert p.min() > sidak_p(int(lit.sum()), FAILURE_CHANCE / 2), scan
