// Sampler: Sobol points with hash-based Owen scrambling (Sobol 1967; Laine and Karras 2011; Burley, Practical
// hash-based Owen scrambling, JCGT 2020). Every 2^32 rays of a source get a scrambling of their own, so a source never
// repeats; direction numbers of Joe and Kuo (2008) for four dimensions.
//
// Of every 256 points in turn, each has another one of the 256 values of the first eight bits, and the 24 bits below are
// the same for all. So a point's word is that of its first eight bits, which are scrambled and followed by 24 bits that
// are drawn for them, exclusive or the 24 bits below, which are scrambled for themselves. Any two words are distributed
// as after Owen's scrambling of all 32 bits: independent behind the first bit, of these eight, in which they differ, and
// behind the first eight as the scrambled 24 bits, shifted. The variance of a mean depends on pairs alone.
//
// All points stay bit-reversed until they are scrambled. In that form, multiplication makes each bit depend on the bits
// above it in the original order, as Owen's scrambling requires.
#include "seeds.cl"

#define POINT_BITS 32
#define SOBOL_BITS 8   // of a point, that are scrambled apart

// Direction numbers, bit-reversed: [dimension][bit of the ray's number].
__constant uint sobol_direction[DIMENSIONS][POINT_BITS] = {
    {0x00000001, 0x00000002, 0x00000004, 0x00000008, 0x00000010, 0x00000020, 0x00000040, 0x00000080,
     0x00000100, 0x00000200, 0x00000400, 0x00000800, 0x00001000, 0x00002000, 0x00004000, 0x00008000,
     0x00010000, 0x00020000, 0x00040000, 0x00080000, 0x00100000, 0x00200000, 0x00400000, 0x00800000,
     0x01000000, 0x02000000, 0x04000000, 0x08000000, 0x10000000, 0x20000000, 0x40000000, 0x80000000},
    {0x00000001, 0x00000003, 0x00000005, 0x0000000f, 0x00000011, 0x00000033, 0x00000055, 0x000000ff,
     0x00000101, 0x00000303, 0x00000505, 0x00000f0f, 0x00001111, 0x00003333, 0x00005555, 0x0000ffff,
     0x00010001, 0x00030003, 0x00050005, 0x000f000f, 0x00110011, 0x00330033, 0x00550055, 0x00ff00ff,
     0x01010101, 0x03030303, 0x05050505, 0x0f0f0f0f, 0x11111111, 0x33333333, 0x55555555, 0xffffffff},
    {0x00000001, 0x00000003, 0x00000006, 0x00000009, 0x00000017, 0x0000003a, 0x00000071, 0x000000a3,
     0x00000116, 0x00000339, 0x00000677, 0x000009aa, 0x00001601, 0x00003903, 0x00007706, 0x0000aa09,
     0x00010117, 0x0003033a, 0x00060671, 0x000909a3, 0x00171616, 0x003a3939, 0x00717777, 0x00a3aaaa,
     0x01170001, 0x033a0003, 0x06710006, 0x09a30009, 0x16160017, 0x3939003a, 0x77770071, 0xaaaa00a3},
    {0x00000001, 0x00000003, 0x00000004, 0x0000000a, 0x0000001f, 0x0000002e, 0x00000045, 0x000000c9,
     0x0000011b, 0x000002a4, 0x0000079a, 0x00000b67, 0x0000101e, 0x0000302d, 0x00004041, 0x0000a0c3,
     0x0001f104, 0x0002e28a, 0x000457df, 0x000c9bae, 0x0011a105, 0x002a7289, 0x0079e7db, 0x00b6dba4,
     0x0100011a, 0x030002a7, 0x0400079e, 0x0a000b6d, 0x1f001001, 0x2e003003, 0x45004004, 0xc900a00a},
};

// Point number `ray` of the sequence, not scrambled. Points combine by exclusive or.
INLINE uint sobol_point(int dimension, uint ray) {
    uint point = 0;
    // masks instead of branches: the bits of a ray's number are not predictable
    for (int bit = 0; bit < POINT_BITS; ++bit) point ^= -(ray >> bit & 1) & sobol_direction[dimension][bit];
    return point;
}

// Scrambling of bit-reversed words: each bit is flipped by a hash of the bits that weigh more and of the seed.
INLINE wordv owen_scramble(wordv reversed, wordv seed) {
    wordv x = reversed + seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return x;
}

// The scrambled words of points whose last 24 bits are 0.
INLINE wordv sobol_leading(wordv reversed, uint seed) { return reverse_bits(owen_scramble(reversed, (wordv)(seed))); }

// The scrambled last 24 bits of points.
INLINE wordv sobol_trailing(wordv reversed, wordv seeds) {
    return reverse_bits(owen_scramble(reversed >> SOBOL_BITS, seeds)) >> SOBOL_BITS;
}

#include "sobol_words_*.cl"
