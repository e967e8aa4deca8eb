"""Checks that a device computes correctly: known answers in the kernels' own arithmetic, before the first trace.

Runs kernels/entry/self_test.cl, which includes the same files as every kernel.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np
import pyopencl as cl

from irtscots_cl.opencl.device import Device, DeviceError, driver_errors
from irtscots_cl.opencl.program import build, check_precision, compose
from irtscots_cl.opencl.structs import PRECISIONS

# In units of the last place of the exact result: OpenCL's limits in single precision. The kernels need no more.
MAX_SQRT_ULP = 3.0
MAX_DIVISION_ULP = 2.5

# Random123 1.14, kat_vectors of philox4x32-10: counter, key, words
KNOWN_WORDS = (
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
)
_COUNTERS, _KEYS, _WORDS = (
    np.array([[int(word, 16) for word in row[column].split()] for row in KNOWN_WORDS], np.uint32) for column in range(3)
)

_ITEMS = 1024  # enough that all cores add to the same sums
_TRIPLES = 512  # of numbers, used repeatedly
_SUMS = 5


@dataclass(frozen=True)
class Arithmetic:
    """Arithmetic of a device that passed: largest errors in units of the last place; whether multiply-add is fused."""

    sqrt_ulp: float
    division_ulp: float
    fused: bool


@lru_cache
def check_device(device: Device, precision: str) -> Arithmetic:
    """The self-test, once per process, device and precision: square root, division, multiply-add, Philox, 64-bit sums.

    Raises DeviceError, with the expected and the found values, if the device computes one of them incorrectly or cannot
    run the kernel; ValueError for an unknown precision.
    """
    check_precision(device, precision)
    real, width = PRECISIONS[precision], device.vector_width(precision)
    x, y, z = _numbers(real)
    amounts, targets = _amounts()
    reals, words, sums = _answers(device, precision, width, np.array([x, y, z]), amounts, targets)
    # every lane of every work-item, for the numbers given to it
    root, quotient, sum_ = (reals[:, k].reshape(-1, _TRIPLES) for k in range(3))

    wide_x, wide_y = x.astype(float), y.astype(float)
    sqrt_ulp = _largest_error(device, "square root", root, np.sqrt(wide_x), MAX_SQRT_ULP, x)
    division_ulp = _largest_error(device, "division", quotient, wide_x / wide_y, MAX_DIVISION_ULP, x, y)
    apart, fused = x * y + z, _fused(x, y, z)
    for k in np.argwhere((sum_ != apart) & (sum_ != fused))[:1]:
        expected = f"{apart[k[1]]!s} or {fused[k[1]]!s}"
        raise _refusal(device, f"{x[k[1]]!s} * {y[k[1]]!s} + {z[k[1]]!s}", expected, sum_[tuple(k)])

    item, lane = np.indices(words.shape[:2])
    known = (item + lane) % len(KNOWN_WORDS)
    for i, j in np.argwhere((words != _WORDS[known]).any(2))[:1]:
        raise _refusal(device, "Philox4x32-10", *(_hexadecimal(w) for w in (_WORDS[known[i, j]], words[i, j])))

    expected = np.zeros(_SUMS, np.uint64)
    np.add.at(expected, targets, amounts)
    for k in np.flatnonzero(sums != expected)[:1]:
        raise _refusal(device, "64-bit sum by atomics", expected[k], sums[k])
    return Arithmetic(sqrt_ulp, division_ulp, bool((sum_ == fused).all()))


def probe(device: Device) -> dict[str, object]:
    """The facts that `irtscots devices` prints: results of the self-test and sizes. Raises DeviceError as check_device.

    A device that fails only in double precision counts as one without it, and the reason is given.
    """
    single, double = check_device(device, "fp32"), {"fp64": device.has_fp64}
    try:
        if device.has_fp64:
            check_device(device, "fp64")
    except DeviceError as error:
        double = {"fp64": False, "fp64_unusable": str(error)}
    return {
        "sqrt_error_ulp": round(single.sqrt_ulp, 2),
        "sqrt_correctly_rounded": single.sqrt_ulp <= 0.5,
        "division_error_ulp": round(single.division_ulp, 2),
        "division_correctly_rounded": single.division_ulp <= 0.5,
        "multiply_add_fused": single.fused,
        **double,
        "vector_width_fp32": device.vector_width("fp32"),
        "memory_gib": round(device.cl_device.global_mem_size / 2**30, 2),
        "largest_buffer_gib": round(device.cl_device.max_mem_alloc_size / 2**30, 2),
        "local_memory_kib": device.cl_device.local_mem_size // 1024,
    }


def _numbers(real) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x > 0, y, z [_TRIPLES] in that precision; in every second triple, z cancels the product's leading digits."""
    random = np.random.default_rng(1)
    x, y, z = (real(random.uniform(1, 2, _TRIPLES) * 2.0 ** random.integers(-30, 31, _TRIPLES)) for _ in range(3))
    x[:8] = [1, 2, 4, 0.25, 9, 1e-6, 1e6, 3]
    y[1::4] *= -1
    z[::2] = -x[::2] * y[::2]
    return x, y, z


def _amounts() -> tuple[np.ndarray, np.ndarray]:
    """Amounts [_ITEMS] and indices of their sums [_ITEMS]; low words overflow in every sum; one ends at 2^64 - 1."""
    random = np.random.default_rng(2)
    amounts = random.integers(0, 2**41, _ITEMS, dtype=np.uint64)
    targets = (np.arange(_ITEMS) % _SUMS).astype(np.uint32)
    last = np.flatnonzero(targets == 0)[-1]
    amounts[last] = np.uint64(2**64 - 1 - sum(int(a) for a in amounts[targets == 0]) + int(amounts[last]))
    return amounts, targets


def _fused(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """x y + z, rounded once; x y is exact in the fractions."""
    exact = [Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c)) for a, b, c in zip(x, y, z, strict=True)]
    return np.array([float(value) for value in exact]).astype(x.dtype)


def _largest_error(device: Device, what: str, found, exact, limit: float, *arguments: np.ndarray) -> float:
    """Largest error of found [:, n] in units of the last place of exact [n]; DeviceError beyond the limit."""
    unit = np.abs(np.spacing(exact.astype(found.dtype)).astype(float))
    error = np.abs(found.astype(float) - exact) / unit
    error[~np.isfinite(error)] = np.inf
    worst = np.unravel_index(np.argmax(error), error.shape)
    if error[worst] > limit:
        of = ", ".join(str(argument[worst[1]]) for argument in arguments)
        expected = f"{exact[worst[1]].astype(found.dtype)!s} within {limit} units of the last place"
        raise _refusal(device, f"{what} of {of}", expected, found[worst])
    return float(error[worst])


def _hexadecimal(words: np.ndarray) -> str:
    return " ".join(f"{word:08x}" for word in words)


def _refusal(device: Device, what: str, expected: object, found: object) -> DeviceError:
    told = f"{what}: expected {expected!s}, found {found!s}"  # !s: digits of the float, not of the double
    return DeviceError(f"{device.label}: computes wrongly: {told}; choose another with --device")


def _answers(device: Device, precision: str, width: int, numbers: np.ndarray, amounts: np.ndarray,
             targets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """The device's results for numbers [3, _TRIPLES] and the sums: reals [values, 3], words [items, lanes, 4], sums.

    Raises DeviceError if it cannot run the kernel.
    """
    lanes = 16 if width > 1 else 1  # WORD_LANES of kernels/arithmetic/simd_*.cl
    given = np.resize(numbers.T, (_ITEMS, width, 3)).transpose(0, 2, 1)
    reals, words = np.zeros((_ITEMS, 3, width), numbers.dtype), np.zeros((_ITEMS, lanes, 4), np.uint32)
    sums = np.zeros(_SUMS, np.uint64)
    program = build(device, compose("self_test.cl", {}, {}, precision, width))
    with driver_errors(device, "cannot run a kernel"):
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
        inputs, outputs = (given, _COUNTERS, _KEYS, amounts, targets), (reals, words, sums)
        buffers = [cl.Buffer(device.context, flags, hostbuf=np.ascontiguousarray(array)) for array in inputs + outputs]
        group = (1,) if device.kind == "cpu" else None
        cl.Kernel(program, "self_test")(device.queue, (_ITEMS,), group, *buffers)
        for array, buffer in zip(outputs, buffers[len(inputs) :], strict=True):
            cl.enqueue_copy(device.queue, array, buffer)
    return reals.transpose(0, 2, 1).reshape(-1, 3), words, sums
