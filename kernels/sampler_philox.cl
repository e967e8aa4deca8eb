// Sampler: independent uniform words from Philox4x32-10. One block gives the four dimensions that a ray needs.
// The counter is (ray, low word first; stream; replicate), the key the seed: words are a function of these alone.
#include "philox.cl"

// Words of the rays first + lane, in the order of the named dimensions of the trace kernels.
INLINE Philox sample_words(const Launch *launch, uint stream, ulong first) {
    const uintv low = (uint)first + lane_index();
    const uintv high = (uint)(first >> 32) + (low < (uint)first ? (uintv)(1) : (uintv)(0));
    const Philox counter = {{low, high, (uintv)(stream), (uintv)(launch->replicate)}};
    return philox4x32_10(counter, launch->seed_low, launch->seed_high);
}
