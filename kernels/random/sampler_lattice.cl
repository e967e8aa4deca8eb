// Sampler: rank-1 lattice of irrational generator (Kronecker sequence), shifted at random per source and replicate.
// Ray i = 256 k + j has word hi(256 k alpha_d) + hi(j alpha_d) + shift_d in dimension d, hi being the upper half of 64
// bits: one addition, as the second is the same for all k. alpha_d = phi^-(d+1) in 64-bit fixed point, phi the real
// root of x^5 = x + 1 (the generalised golden ratio: Roberts, Evenly distributing points in a hypersphere's cube). Any
// number of rays, up to 2^40 and more per source, fills the unit cube evenly.
#include "seeds.cl"

#define LATTICE_BLOCK 256

__constant ulong lattice_step[DIMENSIONS] = {0xdb4f0b9175ae2165UL, 0xbbe0563303a4615fUL, 0xa0f2ec75a1fe1576UL,
                                             0x89e182857d9ed689UL};

typedef struct {
    uint shift[DIMENSIONS];
    wordv within[DIMENSIONS][BLOCK / WORD_LANES];   // words of the rays 0 ... BLOCK - 1, not shifted
} Sampler;

typedef struct { const Sampler *sampler; uint base[DIMENSIONS]; } Words;

INLINE uintv ray_words(const Words *words, int dimension, int v) {
    return ((const uintv *)words->sampler->within[dimension])[v] + words->base[dimension];
}

// Carry from a sum of low halves to the high halves.
INLINE wordv carry(wordv sum, uint summand) { return sum < summand ? (wordv)(1) : (wordv)(0); }

INLINE void sampler_begin(Sampler *sampler, const Launch *launch, uint source) {
    sampler_seeds(launch, source, 0, 0, sampler->shift);
    for (int d = 0; d < DIMENSIONS; ++d) {
        wordv low, high;   // halves of j alpha_d for the rays j of a vector
        for (int j = 0; j < WORD_LANES; ++j) {
            const ulong place = j * lattice_step[d];
            ((uint *)&high)[j] = (uint)(place >> 32);
            ((uint *)&low)[j] = (uint)place;
        }
        const ulong stride = WORD_LANES * lattice_step[d];
        for (int v = 0; v < BLOCK / WORD_LANES; ++v) {
            sampler->within[d][v] = high;
            low += (uint)stride;
            high += (uint)(stride >> 32) + carry(low, (uint)stride);
        }
    }
}

// Words of the rays first ... first + BLOCK - 1; first is a multiple of BLOCK.
INLINE void sampler_block(const Sampler *sampler, ulong first, Words *words) {
    const ulong within = first % LATTICE_BLOCK;   // 0 if BLOCK is as long
    words->sampler = sampler;
    for (int d = 0; d < DIMENSIONS; ++d)
        words->base[d] = sampler->shift[d] + (uint)((first - within) * lattice_step[d] >> 32)
                         + (uint)(within * lattice_step[d] >> 32);
}
