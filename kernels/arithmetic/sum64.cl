// 64-bit sums from 32-bit atomics, which every OpenCL device has: low word first, then the carry. Integer addition is
// exact, so the order in which work-items add does not matter.
// Range: a sum wraps at 2^64. That takes 2^64 counted rays, or, in one bin of one replicate, 2^33 rays of the largest
// weight (2^31) or 2^40 rays of the usual weight (2^24).
// Adding nothing touches no memory: a launch of no rays leaves sums that nobody has set yet as they are.
#include "simd_*.cl"

INLINE void sum64_add(__global uint *sums, size_t index, ulong amount) {
    if (amount == 0) return;
    const uint low = (uint)amount;
    const uint before = atomic_add(&sums[2 * index], low);
    const uint carry = (before + low < before) + (uint)(amount >> 32);
    if (carry != 0) atomic_add(&sums[2 * index + 1], carry);
}
