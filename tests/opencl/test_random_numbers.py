"""Random words on the device and in NumPy: known answers, addressing, and the reals made of them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from device_kernels import SmallKernel, draw_on, kernel_text, lanes, width_of
from scipy import stats
from significance import chi_square_p

from irtscots_cl.opencl.structs import PRECISIONS
from irtscots_cl.tracing.samplers import philox4x32_10, sample_words

# Random123 1.14, kat_vectors: counter, key, output
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]
SEEDS = [0, 1, 2**32, 0x0123456789ABCDEF, 2**64 - 1]


def words_of(text):
    return np.array([int(word, 16) for word in text.split()], np.uint32)


@pytest.fixture(params=["scalar", "own"])
def width(request, device):
    """One ray per work-item, and as many side by side as the device likes."""
    return width_of(device, request.param)


@pytest.fixture
def draw(device, tmp_path, width):
    """draw(seed, stream, replicate, first, count) -> words [count, 4] of the device's philox sampler."""
    return draw_on(device, tmp_path, "philox", width)


@pytest.mark.parametrize(("counter", "key", "output"), KNOWN)
def test_known_answers_of_the_twin(counter, key, output):
    result = philox4x32_10(words_of(counter), tuple(int(k) for k in words_of(key)))
    np.testing.assert_array_equal(result, words_of(output))


@pytest.mark.parametrize(("counter", "key", "output"), KNOWN)
def test_known_answers_on_the_device(device, tmp_path, width, counter, key, output):
    body = """    Philox c;
    for (int i = 0; i < 4; ++i) c.word[i] = (wordv)(counter[i]);
    c = philox4x32_10(c, key[0], key[1]);
    for (int lane = 0; lane < WORD_LANES; ++lane)
        for (int i = 0; i < 4; ++i) out[4 * lane + i] = ((uint *)&c.word[i])[lane];"""
    signature = "__global const uint *counter, __global const uint *key, __global uint *out"
    kernel = SmallKernel(
        device, kernel_text(tmp_path / "known.cl", ["philox.cl"], signature, body), "fp32", width=width
    )
    out = kernel.run((1, 1), [words_of(counter), words_of(key)], [np.zeros((kernel.words, 4), np.uint32)])[0]
    np.testing.assert_array_equal(out, np.tile(words_of(output), (kernel.words, 1)))


@pytest.mark.parametrize("first", [0, 768, 2**32 - 512, 2**32 - 256, 2**32, 7 * 2**32 - 256, 2**40 + 2**8, 2**63])
def test_device_words_equal_the_twins(draw, first):
    rays = np.arange(512, dtype=np.uint64) + np.uint64(first)
    for seed, source, replicate in [(1, 0, 0), (SEEDS[3], 77, 5), (2**64 - 1, 2**32 - 1, 1023)]:
        np.testing.assert_array_equal(
            draw(seed, source, replicate, first, 512), sample_words("philox", seed, source, replicate, rays)
        )


def test_words_do_not_depend_on_where_a_launch_begins(draw):
    whole = draw(9, 4, 2, 2**32 - 512, 1024)
    for start, count in [(256, 20), (256, 512), (512, 40)]:  # launches begin with whole blocks
        np.testing.assert_array_equal(draw(9, 4, 2, 2**32 - 512 + start, count), whole[start : start + count])


def test_no_block_repeats_over_streams_replicates_seeds_and_rays(draw):
    rays_from = [0, 2**32 - 256, 2**33]
    blocks = [
        draw(seed, source, replicate, first, 16)
        for seed, source, replicate, first in itertools.product(SEEDS, (0, 1, 2, 440), (0, 1, 7), rays_from)
    ]
    blocks = np.concatenate(blocks)
    # 2880 blocks of 128 bits: a chance repetition has probability 1e-32
    assert len(np.unique(blocks, axis=0)) == len(blocks) == len(SEEDS) * 4 * 3 * 3 * 16


def test_words_are_uniform_bit_by_bit_and_in_bins(draw):
    words = draw(3, 0, 0, 0, 2**18)
    ones = np.array([[np.count_nonzero(words[:, i] >> np.uint32(bit) & 1) for bit in range(32)] for i in range(4)])
    z = (ones - 2**17) / np.sqrt(2**16)
    assert np.abs(z).max() < 5.8  # 128 bits, Sidak: failure chance 1e-6
    for i in range(4):
        observed = np.bincount(words[:, i] >> 20, minlength=4096)
        assert chi_square_p(observed, np.full(4096, 64.0), fitted=1) > 2.5e-7  # of four: failure chance 1e-6


# --- words to reals ----------------------------------------------------------------------------------------


@pytest.fixture
def reals(device, tmp_path, precision):
    """reals(verb call, words [n, 2]) -> what a verb of uniform.cl makes of the words, [n, 2] (x, y)."""

    def run(call, words):
        kernel_words = np.ascontiguousarray(words, np.uint32)
        body = f"""    uintv first, second;
    realv x, y = 0;
    for (int lane = 0; lane < WIDTH; ++lane) {{
        ((uint *)&first)[lane] = words[2 * (get_global_id(0) * WIDTH + lane)];
        ((uint *)&second)[lane] = words[2 * (get_global_id(0) * WIDTH + lane) + 1];
    }}
    {call};
    for (int lane = 0; lane < WIDTH; ++lane) {{
        out[2 * (get_global_id(0) * WIDTH + lane)] = {lanes("x")};
        out[2 * (get_global_id(0) * WIDTH + lane) + 1] = {lanes("y")};
    }}"""
        entry = kernel_text(
            tmp_path / "reals.cl", ["uniform.cl"], "__global const uint *words, __global real *out", body
        )
        kernel = SmallKernel(device, entry, precision)
        assert len(words) % kernel.width == 0
        out = np.zeros((len(words), 2), PRECISIONS[precision])
        return kernel.run((len(words) // kernel.width, 1), [kernel_words], [out])[0]

    return run


# A word and its neighbours at every place where its meaning turns over.
EDGES = np.unique(
    [
        (base + step) % 2**32
        for base in (0, 2**31, 2**32 - 1, 2**30, 3 * 2**30)
        for step in (-256, -255, -128, -127, -1, 0, 1, 127, 128, 255, 256)
    ]
)
EDGES = np.resize(EDGES, 64).astype(np.uint32)


def random_words(count, seed):
    return np.random.default_rng(seed).integers(0, 2**32, (count, 2), dtype=np.uint32)


def test_uniform_centred_is_exact_and_keeps_off_the_ends(reals):
    words = np.concatenate([np.column_stack([EDGES, EDGES]), random_words(2**14, 1)])
    result = reals("x = uniform_centred(first)", words)[:, 0].astype(float)
    signed = words[:, 0].astype(np.int64) - 2**32 * (words[:, 0] >= 2**31)
    odd = 2 * np.floor_divide(signed, 256) + 1  # the odd multiple of 2^-25 in the word's own interval of 2^-24
    np.testing.assert_array_equal(result, odd * 2.0**-25)
    assert np.abs(result).min() == 2.0**-25 and np.abs(result).max() == 0.5 - 2.0**-25


def test_uniform_open_is_exact_and_keeps_off_the_ends(reals):
    words = np.concatenate([np.column_stack([EDGES, EDGES]), random_words(2**14, 2)])
    result = reals("x = uniform_open(first)", words)[:, 0].astype(float)
    odd = 2 * (words[:, 0].astype(np.int64) // 512) + 1
    np.testing.assert_array_equal(result, odd * 2.0**-24)
    assert result.min() == 2.0**-24 and result.max() == 1 - 2.0**-24


def test_unit_disk_is_the_polar_map(reals, precision):
    words = np.concatenate([np.array(list(itertools.product(EDGES[:32], EDGES[:32]))), random_words(2**18, 3)])
    result = reals("unit_disk(first, second, &x, &y)", words).astype(float)
    radius = np.sqrt((2 * (words[:, 0].astype(np.int64) // 512) + 1) * 2.0**-24)
    signed = words[:, 1].astype(np.int64) - 2**32 * (words[:, 1] >= 2**31)
    angle = 2 * np.pi * (2 * np.floor_divide(signed, 256) + 1) * 2.0**-25
    exact = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
    # 1 - 2 s^2 makes four of one error of the sine: 7e-9 of the polynomial, in fp32 five roundings of 3e-8, and one
    # more on a device without fused multiply-add
    tolerance = 4 * (7e-9 + {"fp32": 1.8e-7, "fp64": 0.0}[precision])
    assert np.abs(result - exact).max() < tolerance
    assert np.hypot(*result.T).max() < 1 + tolerance


def test_unit_disk_is_uniform_in_area(reals):
    x, y = reals("unit_disk(first, second, &x, &y)", random_words(2**18, 4)).astype(float).T
    ring = np.floor(np.minimum(x * x + y * y, 1 - 1e-9) * 16).astype(int)
    sector = np.floor((np.arctan2(y, x) / (2 * np.pi) + 0.5) * 16).astype(int) % 16
    observed = np.bincount(ring * 16 + sector, minlength=256)
    assert chi_square_p(observed, np.full(256, 2**18 / 256), fitted=1) > 1e-6  # failure chance 1e-6
    assert stats.kstest(x * x + y * y, "uniform").pvalue > 1e-6  # failure chance 1e-6
