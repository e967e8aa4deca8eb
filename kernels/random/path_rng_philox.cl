// Random words for ray paths: for scenes with interfaces or scatter, where events on a path are random.
#include "philox.cl"

// One word per ray, from Philox with a counter that no sampler uses. low, high: the words of the rays' numbers.
INLINE wordv path_key(const Launch *launch, uint source, wordv low, wordv high) {
    const Philox counter = {{low, high | 0x80000000u, (wordv)(source), (wordv)(launch->replicate)}};
    return philox4x32_10(counter, launch->seed_low, launch->seed_high).word[0];
}
