// The random words of a block of rays: four per ray. Every sampler_*.cl defines the type Words, sampler_block, which
// prepares those of a block, and ray_words, the words of one dimension for the rays of one vector.
#include "simd_*.cl"

#define DIMENSIONS 4
