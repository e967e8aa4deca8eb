"""Low-discrepancy samplers: words on the device and in NumPy, nets and lattice, unbiased means that converge fast."""

from __future__ import annotations

import itertools
from decimal import Decimal, localcontext
from importlib import import_module

import numpy as np
import pytest
from device_kernels import SmallKernel, draw_on, kernel_text, launch_of, width_of
from scenes import coarse
from scipy import stats
from scipy.stats import qmc
from significance import sidak_p

from irtscots_cl.opencl.structs import WEIGHT_ONE
from irtscots_cl.tracing.options import ESTIMATORS
from irtscots_cl.tracing.samplers import SAMPLERS, owen_scramble, sample_words, sobol_directions, sobol_points
from irtscots_cl.tracing.trace import trace

tracer_module = import_module("irtscots_cl.tracing.estimators.sequential")
LOW_DISCREPANCY = ("sobol", "lattice")
SEED = 0x0123456789ABCDEF
KEYS = [(1, 0, 0), (SEED, 77, 5), (2**64 - 1, 2**32 - 1, 1023)]  # seed, stream, replicate


def rays_from(first, count):
    return np.arange(count, dtype=np.uint64) + np.uint64(first)


@pytest.fixture(params=["scalar", "own"])
def width(request, device):
    """One ray per work-item, and as many side by side as the device likes."""
    return width_of(device, request.param)


# --- the device and its twin -------------------------------------------------------------------------------


@pytest.mark.parametrize("sampler", LOW_DISCREPANCY)
def test_device_words_equal_the_twins(device, tmp_path, width, sampler):
    draw = draw_on(device, tmp_path, sampler, width)
    for first, key in itertools.product([0, 256, 2**18, 2**32 - 256, 2**32, 2**40], KEYS):
        words = draw(*key, first, 512)  # on CPUs two blocks; from 2^32 - 256 on, one on either side of 2^32
        np.testing.assert_array_equal(words, sample_words(sampler, *key, rays_from(first, 512)))


@pytest.mark.parametrize("sampler", LOW_DISCREPANCY)
def test_a_sampler_goes_on_from_block_to_block(device, tmp_path, width, sampler):
    """One sampler through 2^32 and on, as a work-item takes it; the test above begins a new one at every block."""
    body = """    Sampler sampler;
    Words words;
    sampler_begin(&sampler, &launch, stream);
    for (int block = 0; block < 768 / BLOCK; ++block) {
        sampler_block(&sampler, launch.first_ray + block * BLOCK, &words);
        for (int ray = 0; ray < BLOCK; ++ray)
            for (int i = 0; i < 4; ++i) {
                const uintv word = ray_words(&words, i, ray / WIDTH);
                out[4 * (block * BLOCK + ray) + i] = ((const uint *)&word)[ray % WIDTH];
            }
    }"""
    signature = "const Launch launch, uint stream, __global uint *out"
    entry = kernel_text(tmp_path / "walk.cl", [f"sampler_{sampler}.cl"], signature, body)
    launch = launch_of(seed_low=5, replicate=3, first_ray=2**32 - 512)
    kernel = SmallKernel(device, entry, "fp32", width=width)
    (words,) = kernel.run((1, 1), [launch, np.uint32(9)], [np.zeros((768, 4), np.uint32)])
    np.testing.assert_array_equal(words, sample_words(sampler, 5, 9, 3, rays_from(2**32 - 512, 768)))


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_words_differ_between_streams_replicates_and_seeds(sampler):
    rays = rays_from(0, 256)
    changes = [(1, 0, 0), (2, 0, 0), (1 + 2**32, 0, 0), (1, 1, 0), (1, 0, 1), (1, 2, 0), (1, 0, 2)]
    drawn = [sample_words(sampler, *key, rays) for key in changes]
    for one, other in itertools.combinations(drawn, 2):
        # A scrambling or a shift maps different seeds to different words: only equal seeds, chance 2^-32, give equal
        # ones. Of philox's 21 x 1024 pairs of words one is equal with chance 5e-6.
        assert (one != other).all()


# --- Sobol points and their scrambling -----------------------------------------------------------------------


def test_sobol_points_are_scipys():
    exact = qmc.Sobol(4, scramble=False, bits=32).random(2**14) * 2.0**32
    number = np.arange(2**14)
    # SciPy takes its points in the order of Gray's code, the kernel in that of the plain binary number
    np.testing.assert_array_equal(sobol_points(number ^ (number >> 1)), exact)


def test_the_kernels_direction_numbers(device, tmp_path):
    body = "    for (int d = 0; d < 4; ++d) out[4 * get_global_id(0) + d] = sobol_direction[d][get_global_id(0)];"
    entry = kernel_text(tmp_path / "table.cl", ["sampler_sobol.cl"], "__global uint *out", body)
    (table,) = SmallKernel(device, entry, "fp32").run((32, 1), [], [np.zeros((32, 4), np.uint32)])
    reversed_bits = [[int(f"{word:032b}"[::-1], 2) for word in row] for row in table.T]
    np.testing.assert_array_equal(reversed_bits, sobol_directions())


@pytest.mark.parametrize("dimension", range(4))
@pytest.mark.parametrize("first", [0, 3 * 2**12, 2**32, 2**40])
def test_every_dyadic_interval_gets_one_point(dimension, first):
    for key in KEYS:
        words = sample_words("sobol", *key, rays_from(first, 2**12))[:, dimension]
        for k in range(4, 13):
            intervals = np.sort(words[: 2**k] >> np.uint32(32 - k))
            np.testing.assert_array_equal(intervals, np.arange(2**k))


def counts_of_boxes(words, bits):
    """Points in every elementary box of 2^bits[d] intervals along dimension d."""
    box = np.zeros(len(words), np.int64)
    for d, count in enumerate(bits):
        box = box << count | words[:, d].astype(np.int64) >> (32 - count)
    return np.bincount(box, minlength=2 ** sum(bits))


@pytest.mark.parametrize("key", KEYS)
def test_elementary_boxes_of_the_first_two_dimensions_get_one_point_each(key):
    words = sample_words("sobol", *key, rays_from(0, 2**12))
    for k in range(4, 13):
        for along_x in range(k + 1):
            assert (counts_of_boxes(words[: 2**k, :2], (along_x, k - along_x)) == 1).all()


@pytest.mark.parametrize("key", KEYS)
def test_elementary_boxes_in_four_dimensions_get_eight_points_each(key):
    """t = 3: the degrees 1, 2, 3 of the last three dimensions' polynomials, less one each."""
    words = sample_words("sobol", *key, rays_from(0, 2**10))
    shapes = [bits for bits in itertools.product(range(8), repeat=4) if sum(bits) == 7]
    assert len(shapes) == 120
    for bits in shapes:
        assert (counts_of_boxes(words, bits) == 8).all()


def test_every_run_of_2_to_the_32_rays_has_its_own_scrambling():
    runs = [sample_words("sobol", 1, 4, 0, rays_from(run * 2**32, 256)) for run in (0, 1, 2, 255)]
    for one, other in itertools.combinations(runs, 2):
        assert (one != other).all()  # as above: equal only for equal seeds


def test_scrambling_permutes_the_leading_bits(device, tmp_path):
    """Of every length: the first k bits of a word are a bijective function of the first k bits of the point alone."""
    prefix = np.arange(2**16, dtype=np.uint32) << np.uint32(16)
    tails = np.random.default_rng(5).integers(0, 2**16, (2, 2**16), dtype=np.uint32)
    body = """    wordv x;
    for (int i = 0; i < WORD_LANES; ++i) ((uint *)&x)[i] = points[get_global_id(0) * WORD_LANES + i];
    x = reverse_bits(owen_scramble(reverse_bits(x), (wordv)(seed)));
    for (int i = 0; i < WORD_LANES; ++i) out[get_global_id(0) * WORD_LANES + i] = ((uint *)&x)[i];"""
    signature = "uint seed, __global const uint *points, __global uint *out"
    entry = kernel_text(tmp_path / "scramble.cl", ["sampler_sobol.cl"], signature, body)
    kernel = SmallKernel(device, entry, "fp32")
    for seed in (0, 1, 0x9E3779B9, 0xFFFFFFFF):
        scrambled = []
        for points in prefix | tails:
            grid = (len(points) // kernel.words, 1)
            (words,) = kernel.run(grid, [np.uint32(seed), points], [np.zeros_like(points)])
            np.testing.assert_array_equal(words, owen_scramble(points, seed))
            scrambled.append(words >> np.uint32(16))
        np.testing.assert_array_equal(*scrambled)
        for k in range(1, 17):
            leading = (scrambled[0] >> np.uint32(16 - k)).reshape(2**k, -1)
            assert (leading == leading[:, :1]).all()
            np.testing.assert_array_equal(np.sort(leading[:, 0]), np.arange(2**k))


# --- the lattice ---------------------------------------------------------------------------------------------


def lattice_steps():
    """phi^-1 ... phi^-4 for phi^5 = phi + 1, each as round(step 2^96): 32 bits more than the kernel's."""
    with localcontext() as context:
        context.prec = 60
        phi = Decimal(1)
        for _ in range(100):
            phi -= (phi**5 - phi - 1) / (5 * phi**4 - 1)
        return [int((phi**-d * 2**96).to_integral_value()) for d in (1, 2, 3, 4)]


@pytest.mark.parametrize("first", [0, 255, 2**32 - 7, 2**40])
def test_the_lattice_steps_by_powers_of_the_golden_ratio(first):
    rays = rays_from(first, 1024)
    words = sample_words("lattice", SEED, 3, 2, rays)
    shift = sample_words("lattice", SEED, 3, 2, rays_from(0, 1))[0]
    for d, step in enumerate(lattice_steps()):
        exact = np.array([int(ray) * step % 2**96 / 2**64 for ray in rays])
        error = ((words[:, d] - shift[d]).astype(float) - exact + 2**31) % 2**32 - 2**31
        # in words: two truncations of 1 at most, and the ray's number times the half unit 2^-65 of the kernel's step
        assert np.abs(error).max() <= 2 + (first + 1024) * 2.0**-33


def largest_gap(step, count):
    """Largest gap of the points 0, step, ... (count - 1) step (mod 1), in units of 2^-96, by the three-gap theorem.

    Let q_k be the denominators of the step's convergents and D_k = |q_k step - p_k|. With count = m q_k + q_{k-1} + r,
    1 <= m <= a_{k+1} and 0 <= r < q_k, the gaps are D_k, D_{k-1} - m D_k and, q_k - r of them, D_{k-1} - (m - 1) D_k
    (Slater 1967).
    """
    q, q_before = 1, 0
    distance, before = step, 2**96  # of q_k = 1 and q_{k-1} = 0
    while True:
        quotient = before // distance  # a_{k+1}
        if count < (quotient + 1) * q + q_before:
            return before - ((count - q_before) // q - 1) * distance
        q, q_before = quotient * q + q_before, q
        distance, before = before - quotient * distance, distance


@pytest.mark.parametrize("dimension", range(4))
def test_gaps_of_the_lattice_are_those_of_the_three_gap_theorem(dimension):
    words = sample_words("lattice", 1, 0, 0, rays_from(0, 2**16))[:, dimension].astype(np.int64)
    step, worst = lattice_steps()[dimension], 0.0
    for count in 2 ** np.arange(4, 17):
        ordered = np.sort(words[:count])
        gap = np.diff(ordered, append=ordered[0] + 2**32).max()
        assert abs(gap - largest_gap(step, int(count)) / 2**64) <= 2  # truncations of both ends
        worst = max(worst, gap * count / 2**32)
    # With a = a_{k+1} the gap is at most (a + 2 - m) D_k, D_k < 1 / (a q_k + q_{k-1}) and
    # count < (m + 1) q_k + q_{k-1}. So gap x count < (a + 2 - m) (m + 2) / (a + 1), largest at m = a / 2. Up to 2^16
    # points no a is above 42.
    assert worst < 23**2 / 43


def test_lattice_shifts_fill_the_unit_interval():
    shifts = np.stack([sample_words("lattice", 2, s, 0, rays_from(0, 1))[0] for s in range(1024)]) * 2.0**-32
    for d in range(4):
        assert stats.kstest(shifts[:, d], "uniform").pvalue > sidak_p(4, 1e-6)  # failure chance 1e-6


# --- means of smooth functions -------------------------------------------------------------------------------

COSINE, SINE = np.array([0.5, -0.4, 0.3, 0.6]), np.array([0.3, 0.2, -0.5, 0.1])
RATE = np.array([1.0, 0.8, -0.6, 0.4])


def waves(words):
    """A product of waves along every dimension, periodic as a lattice wants it; its mean is exactly 1."""
    angle = (words + 0.5) * (2 * np.pi * 2.0**-32)
    return np.prod(1 + COSINE * np.cos(angle) + SINE * np.sin(angle), axis=-1)


def exponentials(words):
    """An exponential along every dimension, not periodic; its mean is exactly 1."""
    return np.exp((words + 0.5) * 2.0**-32 @ RATE) / np.prod(np.expm1(RATE) / RATE)


def errors(sampler, function, count, sources):
    """Errors [streams] of the mean over the first count rays of each stream."""
    rays = rays_from(0, count)
    return np.array([function(sample_words(sampler, 11, source, 0, rays)).mean() - 1 for source in sources])


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("function", [waves, exponentials])
@pytest.mark.parametrize("count", [1, 100, 1024])  # also where no net is complete
def test_means_are_unbiased(sampler, function, count):
    found = errors(sampler, function, count, range(400))
    t = found.mean() / found.std(ddof=1) * np.sqrt(400)
    assert abs(t) < stats.t.isf(sidak_p(18, 1e-6) / 2, 399)  # of 18 tests: failure chance 1e-6


def exponent(sampler, function, counts, replicates):
    """The power of the ray number that the rms error falls with: a line through log-log points of separate streams."""
    rms = []
    for k, count in enumerate(counts):
        found = errors(sampler, function, count, range(k * replicates, (k + 1) * replicates))
        rms.append(np.sqrt(np.mean(found**2)))
    return np.polyfit(np.log(counts), np.log(rms), 1)[0]


@pytest.mark.parametrize(
    ("sampler", "low", "high"), [("philox", -0.6, -0.4), ("sobol", -2, -0.8), ("lattice", -2, -0.8)]
)
def test_errors_fall_with_the_number_of_rays(sampler, low, high):
    counts = 2 ** np.arange(6, 14)
    # Log rms of 64 normal errors scatters by 1/sqrt(128), so the slope by 0.088/sqrt(42 ln^2 2) = 0.02: the limits of
    # philox are 5 sigma. Sobol's power tends to -1.5 (and logarithms), the lattice's to -1: ten sigma to their limit.
    assert low < exponent(sampler, waves, counts, 64) < high


def test_owens_scrambling_gains_what_a_shift_does_not():
    # N^-1.5 but for logarithms, where points shifted at random stay at N^-1; ten sigma, of 0.02 as above, from that
    assert exponent("sobol", exponentials, 2 ** np.arange(6, 14), 64) < -1.2


def test_the_lattices_error_falls_as_the_inverse_number_of_rays():
    # Log rms of 32 shifts scatters by 1/sqrt(64), so the slope by 0.125/sqrt(60 ln^2 2) = 0.023: four sigma above -1
    assert exponent("lattice", waves, 2 ** np.arange(8, 17), 32) < -0.9


# --- traced ----------------------------------------------------------------------------------------------------


def total_flux(device, sampler, estimator):
    """Total flux [64 replicates]; the ledger must close."""
    rays = 64 * 2047  # not whole blocks
    options = {"sampler": sampler, "estimator": estimator, "rays_per_pixel": rays, "replicates": 64}
    run = trace(coarse("sphere"), device=device, **options)
    ledger = dict(run.ledger)
    assert ledger.pop("launched") == run.rays_total == sum(ledger.values()) > 0
    assert ledger["failed"] == ledger["absorbed"] == 0
    if estimator == "forward":
        assert run.counts.sum() == ledger["detected"]
    else:
        # cos^4 over the coarsest pixel
        assert run.counts.sum() / WEIGHT_ONE == pytest.approx(ledger["detected"], rel=0.02)
    return np.array([run.flux_w(r).sum() for r in range(64)])


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_samplers_agree_in_total_flux(device, estimator):
    philox = total_flux(device, "philox", estimator)
    assert philox.std(ddof=1) / 8 < 1e-3 * philox.mean()  # the checks mean something
    for sampler in LOW_DISCREPANCY:
        flux = total_flux(device, sampler, estimator)
        t = (flux.mean() - philox.mean()) / np.sqrt((flux.var(ddof=1) + philox.var(ddof=1)) / 64)
        assert abs(t) < stats.t.isf(sidak_p(4, 1e-6) / 2, 63)  # Welch: 63 degrees or more; of four tests, 1e-6
        # Less scatter is what these samplers are for. A third of the variance would fail with chance 1e-5 (F with 63
        # and 63 degrees); it is a sixth at most.
        assert flux.var(ddof=1) < philox.var(ddof=1)


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("sampler", LOW_DISCREPANCY)
def test_counts_do_not_depend_on_the_launches(device, monkeypatch, sampler, estimator):
    options = {"device": device, "sampler": sampler, "estimator": estimator, "rays_per_pixel": 2500, "replicates": 2}
    whole = trace(coarse("sphere"), **options, launch_rays=10**9)
    for launch_rays, per_item in [(None, 2**18), (50_000, 256), (5000, 512), (200_000, 768), (10**9, 1024)]:
        monkeypatch.setattr(tracer_module.SequentialTask, "max_rays_per_item", per_item)  # in 256s
        parts = trace(coarse("sphere"), **options, launch_rays=launch_rays)
        np.testing.assert_array_equal(parts.counts, whole.counts)
        assert parts.ledger == whole.ledger
