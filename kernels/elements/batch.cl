// A batch of rays that leave a screen pixel together: what the sieve_* files fill.
#include "sampler_*.cl"
#include "path_rng_*.cl"
#include "cones_*.cl"
#include "tally.cl"

// words: those of the sampler, [dimension][ray]; keys: one word per ray for events on its path. first: the number of the
// first ray, if the rays have consecutive numbers.
typedef struct {
    wordv words[DIMENSIONS][BLOCK / WORD_LANES], keys[BLOCK / WORD_LANES];
    ulong first;
    int count;
} Batch;

INLINE uintv batch_words(const Batch *batch, int dimension, int v) { return ((const uintv *)batch->words[dimension])[v]; }
