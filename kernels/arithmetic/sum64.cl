// 64-bit sums from 32-bit atomics, which every OpenCL device has: low word, then the carry. Addition of integers is
// exact and its order does not matter, so neither does the order in which work-items arrive.
// Range: a sum wraps at 2^64. Counts need that many rays; weights (2^24 per ray, at most 2^31) need 2^33 rays of the
// largest weight in one bin of one replicate, 2^40 of the usual.
#include "simd_*.cl"

INLINE void sum64_add(__global uint *sums, size_t index, ulong amount) {
    const uint low = (uint)amount;
    const uint before = atomic_add(&sums[2 * index], low);
    const uint carry = (before + low < before) + (uint)(amount >> 32);
    if (carry != 0) atomic_add(&sums[2 * index + 1], carry);
}
