// The random words of a block of rays: four per ray, [dimension][ray]. Every sampler_*.cl fills them.
#include "simd_*.cl"

#define DIMENSIONS 4

typedef struct { wordv of[DIMENSIONS][BLOCK / WORD_LANES]; } Words;

// The words of one dimension for the rays of vector v.
INLINE uintv ray_words(const Words *words, int dimension, int v) { return ((const uintv *)words->of[dimension])[v]; }
