"""The ray samplers by name: each is a kernel file sampler_NAME.cl with the verbs sampler_begin and sampler_block.

A ray's four words are a pure function of (seed, source, replicate, ray number); here are the kernels' NumPy twins.
"""

from __future__ import annotations

import numpy as np

SAMPLERS = ("philox", "sobol", "lattice")
INDEPENDENT = ("philox",)  # their rays are independent of each other, so that the noise follows from their number
DIMENSIONS = 4
_MULTIPLIERS = (np.uint64(0xD2511F53), np.uint64(0xCD9E8D57))
_WEYL = (0x9E3779B9, 0xBB67AE85)
_LOW = np.uint64(0xFFFFFFFF)
_HALF = np.uint64(32)

# Primitive polynomials over GF(2), by degree and inner coefficients, and first direction integers of Joe and Kuo
# (2008, new-joe-kuo-6.21201) for the second to fourth dimension; the first has all integers 1.
_JOE_KUO = ((1, 0, (1,)), (2, 1, (1, 3)), (3, 1, (1, 3, 1)))
_OWEN_FACTORS = (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6)  # Burley, JCGT 9(4), 2020
_SOBOL_BITS = np.uint32(8)  # SOBOL_BITS of the kernel
_FIRST_BITS = np.uint32(0xFF000000)
_LATTICE_STEPS = np.array(
    [0xDB4F0B9175AE2165, 0xBBE0563303A4615F, 0xA0F2EC75A1FE1576, 0x89E182857D9ED689], np.uint64
)  # phi^-1 ... phi^-4 in units of 2^-64, phi^5 = phi + 1
_LATTICE_BLOCK = 256  # LATTICE_BLOCK of the kernel


def philox4x32_10(counter: np.ndarray, key: tuple[int, int]) -> np.ndarray:
    """NumPy twin of kernels/random/philox.cl: counter [..., 4] uint32, key of two 32-bit words -> [..., 4] uint32.

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


def sample_words(sampler: str, seed: int, source: int, replicate: int, rays: np.ndarray) -> np.ndarray:
    """NumPy twin of kernels/random/sampler_*.cl: the words [n, 4] uint32 of rays [n] (64-bit numbers) of a stream.

    sampler: one of SAMPLERS. seed: 64 bits; source, replicate: 32 bits.
    """
    words = {"philox": _philox_words, "sobol": _sobol_words, "lattice": _lattice_words}[sampler]
    return words(seed, source, replicate, np.asarray(rays, np.uint64))


def sobol_directions() -> np.ndarray:
    """Direction numbers [4, 32] uint32 of Joe and Kuo (2008), most significant bit first: [dimension][bit of number].

    Their integers m_k follow the recurrence of the dimension's polynomial of degree s,
    m_k = 2 a_1 m_{k-1} ^ ... ^ 2^{s-1} a_{s-1} m_{k-s+1} ^ 2^s m_{k-s} ^ m_{k-s}; direction k is m_k 2^{31-k}.
    """
    integers = [[1] * 32]
    for degree, inner, first in _JOE_KUO:
        m = list(first)
        for k in range(degree, 32):
            value = m[k - degree] ^ (m[k - degree] << degree)
            for i in range(1, degree):
                if inner >> (degree - 1 - i) & 1:
                    value ^= m[k - i] << i
            m.append(value)
        integers.append(m)
    return np.array([[value << (31 - k) for k, value in enumerate(m)] for m in integers], np.uint32)


def sobol_points(rays: np.ndarray) -> np.ndarray:
    """Sobol points [n, 4] uint32 of the rays [n], not scrambled, in natural (not Gray-code) order."""
    numbers = np.asarray(rays, np.uint64) & _LOW
    points = np.zeros((len(numbers), DIMENSIONS), np.uint32)
    for bit, directions in enumerate(sobol_directions().T):
        points[(numbers >> np.uint64(bit) & np.uint64(1)).astype(bool)] ^= directions
    return points


def owen_scramble(points: np.ndarray, seeds: np.ndarray) -> np.ndarray:
    """Points uint32 after Owen's scrambling by hash (Laine and Karras 2011; Burley 2020); broadcasts."""
    x = _reverse_bits(points) + np.asarray(seeds, np.uint32)
    for factor in _OWEN_FACTORS:
        x = x ^ x * np.uint32(factor)
    return _reverse_bits(x)


def _philox_words(seed: int, source: int, replicate: int, rays: np.ndarray) -> np.ndarray:
    return _philox(seed, rays & _LOW, rays >> _HALF, source, replicate)


def _sobol_words(seed: int, source: int, replicate: int, rays: np.ndarray) -> np.ndarray:
    points, runs = sobol_points(rays), rays >> _HALF
    leading = owen_scramble(points & _FIRST_BITS, _sampler_seeds(seed, source, replicate, runs))
    trailing = owen_scramble(points << _SOBOL_BITS, _sampler_seeds(seed, source, replicate, runs, 1))
    return leading ^ trailing >> _SOBOL_BITS


def _lattice_words(seed: int, source: int, replicate: int, rays: np.ndarray) -> np.ndarray:
    shift = _sampler_seeds(seed, source, replicate, np.zeros(1, np.uint64))
    within = rays % np.uint64(_LATTICE_BLOCK)
    words = [(part[:, None] * _LATTICE_STEPS >> _HALF).astype(np.uint32) for part in (rays - within, within)]
    return words[0] + words[1] + shift  # all modulo their word


def _sampler_seeds(seed: int, source: int, replicate: int, runs: np.ndarray, part: int = 0) -> np.ndarray:
    """Twin of kernels/random/seeds.cl: words [n, 4] that a part of the runs [n] of 2^32 rays is randomised with."""
    return _philox(seed, runs, _LOW - np.uint64(part), source, replicate)


def _philox(seed: int, *counter) -> np.ndarray:
    words = np.broadcast_arrays(*(np.asarray(word, np.uint64) for word in counter))
    return philox4x32_10(np.stack(words, -1), (seed & 0xFFFFFFFF, seed >> 32))


def _reverse_bits(words: np.ndarray) -> np.ndarray:
    """The bits of uint32 words in opposite order."""
    bits = np.unpackbits(np.ascontiguousarray(words, "<u4")[..., None].view(np.uint8), axis=-1, bitorder="little")
    return np.packbits(bits, axis=-1, bitorder="big").view(">u4")[..., 0].astype(np.uint32)
