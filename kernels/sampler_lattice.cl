// Sampler: rank-1 lattice of irrational generator (Kronecker sequence), shifted at random per stream and replicate.
// Ray i has word hi(i alpha_d) + shift_d in dimension d, where alpha_d = phi^-(d+1) in 64-bit fixed point and phi is the
// real root of x^5 = x + 1 (the generalised golden ratio: Roberts, Evenly distributing points in a hypersphere's cube).
// Any number of rays, up to 2^40 and more per stream, fills the unit cube evenly.
#include "seeds.cl"

__constant ulong lattice_step[DIMENSIONS] = {0xdb4f0b9175ae2165UL, 0xbbe0563303a4615fUL, 0xa0f2ec75a1fe1576UL, 0x89e182857d9ed689UL};

typedef struct {
    uint shift[DIMENSIONS];
    wordv within[DIMENSIONS][BLOCK / WORD_LANES];   // hi(j alpha_d) of the rays j of a block
} Sampler;

INLINE void sampler_begin(Sampler *sampler, const Launch *launch, uint stream) {
    sampler_seeds(launch, stream, 0, sampler->shift);
    for (int d = 0; d < DIMENSIONS; ++d)
        for (int j = 0; j < BLOCK; ++j) ((uint *)sampler->within[d])[j] = (uint)((ulong)j * lattice_step[d] >> 32);
}

// Words of the rays first ... first + BLOCK - 1; first is a multiple of BLOCK.
INLINE void sampler_block(const Sampler *sampler, ulong first, Words *words) {
    for (int d = 0; d < DIMENSIONS; ++d) {
        const uint base = (uint)(first * lattice_step[d] >> 32) + sampler->shift[d];
        for (int v = 0; v < BLOCK / WORD_LANES; ++v) words->of[d][v] = sampler->within[d][v] + base;
    }
}
