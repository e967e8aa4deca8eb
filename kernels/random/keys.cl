// One random word for each ray of a block, from which its path's random numbers follow. path_rng_*.cl fills them.
#include "words.cl"

typedef struct { wordv of[BLOCK / WORD_LANES]; } Keys;

INLINE uintv ray_keys(const Keys *keys, int v) { return ((const uintv *)keys->of)[v]; }
