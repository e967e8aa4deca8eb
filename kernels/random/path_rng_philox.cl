// Random words for ray paths: for scenes with interfaces or scatter, where events on a path are random.
#include "keys.cl"
#include "philox.cl"

// One word per ray, from Philox with a counter that no sampler uses.
INLINE void path_keys(const Launch *launch, uint source, ulong first, Keys *keys) {
    for (int v = 0; v < BLOCK / WORD_LANES; ++v) {
        const ulong ray = first + v * WORD_LANES;
        const wordv low = (uint)ray + word_index();
        const wordv high = (wordv)((uint)(ray >> 32) | 0x80000000u);
        const Philox counter = {{low, high, (wordv)(source), (wordv)(launch->replicate)}};
        keys->of[v] = philox4x32_10(counter, launch->seed_low, launch->seed_high).word[0];
    }
}
