// A batch of rays that leave a screen pixel together: what the sieve_* files fill.
#include "sampler_*.cl"
#include "path_rng_*.cl"
#include "cones_*.cl"
#include "tally.cl"

// words: those of the sampler; keys: one word per ray for events on its path, in the first dimension. first: the number
// of the first ray, if the rays have consecutive numbers.
typedef struct { Words words, keys; ulong first; int count; } Batch;
