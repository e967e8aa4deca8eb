"""The self-test: a device that computes wrongly is refused before anything is traced on it."""

from __future__ import annotations

import re
import shutil
from fractions import Fraction

import numpy as np
import pytest
from faults import FaultyKernel
from synthetic import small_scene

import irtscots_cl.opencl.selftest as module
from irtscots_cl.opencl.device import DeviceError
from irtscots_cl.opencl.program import kernel_files, kernels_folder
from irtscots_cl.opencl.selftest import KNOWN_WORDS, MAX_DIVISION_ULP, MAX_SQRT_ULP, check_device, probe
from irtscots_cl.tracing.samplers import philox4x32_10
from irtscots_cl.tracing.trace import trace

ROOT_WITHIN = "within 3.0 units of the last place, found"
QUOTIENT_WITHIN = "within 2.5 units of the last place, found"


@pytest.fixture(autouse=True)
def fresh():
    """Every test here tests its device anew, and leaves no verdict behind."""
    check_device.cache_clear()
    yield
    check_device.cache_clear()


@pytest.fixture
def altered(monkeypatch):
    """altered(change): what the device answers in the precisions given is changed by change(reals, words, sums)."""
    answers = module._answers

    def install(change, precisions=("fp32", "fp64")):
        def changed(device, precision, *given):
            found = answers(device, precision, *given)
            if precision in precisions:
                change(*found)
            return found

        monkeypatch.setattr(module, "_answers", changed)

    return install


def refusal_of(device, precision) -> str:
    with pytest.raises(DeviceError) as caught:
        check_device(device, precision)
    message = str(caught.value)
    assert message.startswith(f"{device.label}: ") and message.isprintable()  # one line
    return message


# --- devices that are right --------------------------------------------------------------------------------


def test_the_device_passes(device, precision):
    found = check_device(device, precision)
    assert 0 <= found.sqrt_ulp <= MAX_SQRT_ULP and 0 <= found.division_ulp <= MAX_DIVISION_ULP
    assert isinstance(found.fused, bool)


def test_it_is_tested_once_in_a_process(device, monkeypatch):
    asked, answers = [], module._answers
    monkeypatch.setattr(module, "_answers", lambda d, precision, *given: asked.append(precision)
                        or answers(d, precision, *given))  # fmt: skip
    for _ in range(2):
        trace(small_scene("sphere", 25), device=device, rays_per_pixel=8)
        probe(device)
    assert asked == (["fp32", "fp64"] if device.has_fp64 else ["fp32"])


def test_what_opencl_allows_passes_and_is_told(device, altered):
    def less_exact(reals, words, sums):
        reals[:, 0] *= 1 + np.float32(2**-23)
        reals[:, 1] *= 1 - np.float32(2**-24)

    altered(less_exact)
    found, facts = check_device(device, "fp32"), probe(device)
    assert 1 < found.sqrt_ulp <= 3 and 0.5 < found.division_ulp <= 2.5
    assert (facts["sqrt_correctly_rounded"], facts["division_correctly_rounded"]) == (False, False)
    assert (facts["sqrt_error_ulp"], facts["division_error_ulp"]) == (
        round(found.sqrt_ulp, 2),
        round(found.division_ulp, 2),
    )


def test_multiply_add_may_round_twice(device, altered):
    x, y, z = module._numbers(np.float32)

    def unfused(reals, words, sums):
        reals[:, 2] = np.resize(x * y + z, len(reals))

    altered(unfused)
    assert not check_device(device, "fp32").fused


# --- the references ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_the_reference_of_fused_multiply_add_is_correctly_rounded(real):
    x, y, z = module._numbers(real)
    differ = 0
    for a, b, c, fused in zip(x, y, z, module._fused(x, y, z), strict=True):
        exact = Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c))
        assert abs(Fraction(float(fused)) - exact) <= Fraction(float(abs(np.spacing(fused)))) / 2
        differ += fused != a * b + c
    assert differ > len(x) / 4  # those whose leading digits cancel tell the two apart


def test_sums_carry_and_one_is_the_largest_there_is():
    amounts, targets = module._amounts()
    totals = [sum(int(a) for a in amounts[targets == k]) for k in range(targets.max() + 1)]
    assert totals[0] == 2**64 - 1 and all(2**33 < total < 2**64 for total in totals)


@pytest.mark.parametrize(("counter", "key", "words"), KNOWN_WORDS)
def test_known_words_are_those_of_the_twin(counter, key, words):
    counter, key, words = (np.array([int(w, 16) for w in text.split()], np.uint32) for text in (counter, key, words))
    np.testing.assert_array_equal(philox4x32_10(counter, tuple(int(k) for k in key)), words)


# --- devices that are wrong: kernels that compute something else -------------------------------------------


WRONG_KERNELS = {
    "square root": (
        {"real_float.cl": ("__builtin_sqrtf(x)", "(__builtin_sqrtf(x) * 1.0000005f)"),
         "simd_vector.cl": ("return __builtin_elementwise_sqrt(x)",
                            "return __builtin_elementwise_sqrt(x) * (real)1.0000005"),
         "simd_scalar.cl": ("return sqrt(x)", "return sqrt(x) * (real)1.0000005")},
        # as many digits as a float has, not a double's
        rf"square root of [\d.e+-]+: expected [\d.e+-]+ {ROOT_WITHIN} [\d.e+-]{{3,14}}",
    ),
    "division": (
        {"self_test.cl": ("given[0] / given[1]", "given[0] / given[1] * (real)1.0000005")},
        rf"division of [\d.e+-]+, -?[\d.e+-]+: expected -?[\d.e+-]+ {QUOTIENT_WITHIN} -?[\d.e+-]+",
    ),
    "multiply-add": (
        {"self_test.cl": ("given[0] * given[1] + given[2]", "given[0] * given[1] * (real)1.0000005 + given[2]")},
        r"[\d.e+-]+ \* -?[\d.e+-]+ \+ -?[\d.e+-]+: expected -?[\d.e+-]+ or -?[\d.e+-]+, found -?[\d.e+-]+",
    ),
    "rounds of Philox": (
        {"philox.cl": ("round < 10", "round < 9")},
        r"Philox4x32-10: expected [0-9a-f ]{35}, found [0-9a-f ]{35}",
    ),
    "carries": (
        {"sum64.cl": ("(before + low < before)", "0")},
        r"64-bit sum by atomics: expected \d+, found \d+",
    ),
    "sums that replace each other": (
        {"sum64.cl": ("const uint before = atomic_add(&sums[2 * index], low);",
                      "const uint before = sums[2 * index]; sums[2 * index] = low;")},
        r"64-bit sum by atomics: expected \d+, found \d+",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG_KERNELS)
def test_a_device_that_computes_wrongly_is_refused(device, tmp_path, monkeypatch, what):
    changes, found = WRONG_KERNELS[what]
    folder = shutil.copytree(kernels_folder(), tmp_path / "kernels")
    for name, (before, after) in changes.items():
        path = kernel_files(folder)[name]
        text = path.read_text(encoding="ascii")
        assert before in text
        path.write_text(text.replace(before, after), encoding="ascii")
    monkeypatch.setattr("irtscots_cl.opencl.program.kernels_folder", lambda: folder)
    message = refusal_of(device, "fp32")
    assert re.fullmatch(
        rf"{re.escape(device.label)}: computes wrongly: {found}; choose another with --device", message
    ), message


# --- devices that are wrong: single answers ----------------------------------------------------------------


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
@pytest.mark.parametrize(("column", "what"), [(0, "square root"), (1, "division"), (2, r"\* .* \+ ")])
def test_one_wrong_real_of_one_lane_is_enough(device, precision, altered, column, what, value):
    def change(reals, words, sums):
        reals[len(reals) * 3 // 4 + 1, column] = value  # not of a product that cancels to 0

    altered(change)
    assert re.search(rf"computes wrongly: .*{what}.*expected .*, found {value}; ", refusal_of(device, precision))


@pytest.mark.parametrize("lane", [0, -1])
def test_one_wrong_bit_of_one_lane_is_enough(device, precision, altered, lane):
    def change(reals, words, sums):
        words[-1, lane, 3] ^= 1

    altered(change)
    assert "Philox4x32-10" in refusal_of(device, precision)


@pytest.mark.parametrize("index", range(5))
def test_one_lost_count_is_enough(device, precision, altered, index):
    def change(reals, words, sums):
        sums[index] -= np.uint64(1)

    altered(change)
    message = refusal_of(device, precision)
    expected, found = map(int, re.search(r"expected (\d+), found (\d+)", message).groups())
    assert expected - found == 1


def test_a_device_that_is_wrong_in_double_precision_alone_is_one_without(device, altered):
    if not device.has_fp64:
        pytest.skip("the device has no double precision")
    altered(lambda reals, words, sums: reals.fill(1.0), ("fp64",))
    facts = probe(device)
    assert facts["fp64"] is False and "computes wrongly: square root" in facts["fp64_unusable"]
    trace(small_scene("sphere", 25), device=device, rays_per_pixel=8)
    with pytest.raises(DeviceError, match="computes wrongly"):
        trace(small_scene("sphere", 25), device=device, rays_per_pixel=8, precision="fp64")


@pytest.mark.parametrize("options", [{"estimator": "adjoint"}, {"estimator": "forward"},
                                     {"estimator": "adjoint", "smoothing": True},
                                     {"estimator": "nonsequential"}], ids=str)  # fmt: skip
def test_nothing_is_traced_on_a_wrong_device(device, altered, options):
    altered(lambda reals, words, sums: sums.fill(0))
    with pytest.raises(DeviceError, match="computes wrongly: 64-bit sum"):
        trace(small_scene("sphere", 25), device=device, rays_per_pixel=8, **options)


# --- devices that cannot be asked --------------------------------------------------------------------------


def test_a_device_that_cannot_run_a_kernel_is_refused(device, monkeypatch):
    monkeypatch.setattr(module.cl, "Kernel", FaultyKernel("OUT_OF_RESOURCES", good=0))
    assert "cannot run a kernel: clEnqueueNDRangeKernel failed: OUT_OF_RESOURCES" in refusal_of(device, "fp32")


def test_precisions_are_checked(device):
    with pytest.raises(ValueError, match="precision = 'half': must be fp32 or fp64"):
        check_device(device, "half")


def test_probe(device):
    facts = probe(device)
    assert facts["fp64"] is device.has_fp64
    assert facts["vector_width_fp32"] in ((4, 8, 16) if device.kind == "cpu" else (1,))
    assert 0.1 < facts["memory_gib"] < 1e4 and facts["local_memory_kib"] >= 16  # OpenCL's least: 32 KiB, embedded 1
    assert 0 < facts["largest_buffer_gib"] <= facts["memory_gib"]
    assert facts["sqrt_correctly_rounded"] is (facts["sqrt_error_ulp"] <= 0.5)
    assert facts["division_correctly_rounded"] is (facts["division_error_ulp"] <= 0.5)
