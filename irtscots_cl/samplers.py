"""The ray samplers by name: each is a kernel file sampler_NAME.cl with one verb, sample_words."""

from __future__ import annotations

import numpy as np

SAMPLERS = ("philox", "sobol", "lattice")
_MULTIPLIERS = (np.uint64(0xD2511F53), np.uint64(0xCD9E8D57))
_WEYL = (0x9E3779B9, 0xBB67AE85)
_LOW = np.uint64(0xFFFFFFFF)


def philox4x32_10(counter: np.ndarray, key: tuple[int, int]) -> np.ndarray:
    """NumPy twin of kernels/philox.cl: counter [..., 4] uint32, key of two 32-bit words -> [..., 4] uint32.

    Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC'11.
    """
    c0, c1, c2, c3 = (np.asarray(counter[..., i], np.uint64) for i in range(4))
    key0, key1 = (np.uint64(k) for k in key)
    for _ in range(10):
        product0, product1 = c0 * _MULTIPLIERS[0], c2 * _MULTIPLIERS[1]
        c0, c1, c2, c3 = (
            (product1 >> np.uint64(32)) ^ c1 ^ key0,
            product1 & _LOW,
            (product0 >> np.uint64(32)) ^ c3 ^ key1,
            product0 & _LOW,
        )
        key0, key1 = (np.uint64((int(k) + w) & 0xFFFFFFFF) for k, w in zip((key0, key1), _WEYL, strict=True))
    return np.stack([c0, c1, c2, c3], -1).astype(np.uint32)


def sample_words(seed: int, stream: int, replicate: int, rays: np.ndarray) -> np.ndarray:
    """NumPy twin of kernels/sampler_philox.cl: the four words [n, 4] of rays [n] (64-bit numbers) of a stream."""
    rays = np.asarray(rays, np.uint64)
    words = [rays & _LOW, rays >> np.uint64(32), np.full_like(rays, stream), np.full_like(rays, replicate)]
    return philox4x32_10(np.stack(words, -1), (seed & 0xFFFFFFFF, seed >> 32))
