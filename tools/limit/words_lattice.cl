// Random words of the limit kernels: a lattice in 32 bits, the cheapest even points that there are; good for 2^16 rays.
#include "simd_*.cl"

INLINE void limit_words(uint first, uint stream, uint seed, wordv word[4]) {
    const wordv ray = word_index() + first;
    word[0] = ray * 0xdb4f0b91u + (stream * 0x9e3779b9u ^ seed);
    word[1] = ray * 0xbbe05633u + (stream * 0x85ebca6bu ^ seed);
    word[2] = ray * 0xa0f2ec75u + (stream * 0xc2b2ae35u ^ seed);
    word[3] = ray * 0x89e18285u + (stream * 0x27d4eb2fu ^ seed);
}
