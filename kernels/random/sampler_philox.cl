// Sampler: independent uniform words from Philox4x32-10. One Philox block gives the four dimensions that a ray needs.
// The counter is (ray, low word first; source; replicate), the key the seed: words are a function of these alone.
#include "words.cl"
#include "philox.cl"

typedef struct { uint source, replicate, key0, key1; } Sampler;

// [dimension][ray].
typedef struct { wordv of[DIMENSIONS][BLOCK / WORD_LANES]; } Words;

INLINE uintv ray_words(const Words *words, int dimension, int v) { return ((const uintv *)words->of[dimension])[v]; }

INLINE void sampler_begin(Sampler *sampler, const Launch *launch, uint source) {
    *sampler = (Sampler){source, launch->replicate, launch->seed_low, launch->seed_high};
}

// Words of the rays first ... first + BLOCK - 1; first is a multiple of BLOCK.
INLINE void sampler_block(const Sampler *sampler, ulong first, Words *words) {
    for (int v = 0; v < BLOCK / WORD_LANES; ++v) {
        const wordv low = (uint)first + v * WORD_LANES + word_index();   // within a block nothing is carried
        const Philox counter = {{low, (wordv)((uint)(first >> 32)), (wordv)(sampler->source),
                                 (wordv)(sampler->replicate)}};
        const Philox out = philox4x32_10(counter, sampler->key0, sampler->key1);
        for (int d = 0; d < DIMENSIONS; ++d) words->of[d][v] = out.word[d];
    }
}
