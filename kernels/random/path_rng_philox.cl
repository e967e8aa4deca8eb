// Random words for what happens on a ray's path, of scenes where probability decides: interfaces, scatter.
#include "words.cl"
#include "philox.cl"

// One per ray, from Philox with a counter that no sampler uses.
INLINE void path_keys(const Launch *launch, uint source, ulong first, Words *keys) {
    for (int v = 0; v < BLOCK / WORD_LANES; ++v) {
        const ulong ray = first + v * WORD_LANES;
        const wordv low = (uint)ray + word_index();
        const Philox counter = {{low, (wordv)((uint)(ray >> 32) | 0x80000000u), (wordv)(source), (wordv)(launch->replicate)}};
        keys->of[0][v] = philox4x32_10(counter, launch->seed_low, launch->seed_high).word[0];
    }
}
