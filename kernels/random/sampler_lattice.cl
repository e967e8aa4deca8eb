// Sampler: rank-1 lattice of irrational generator (Kronecker sequence), shifted at random per source and replicate.
// Ray i has word hi(i alpha_d) + shift_d in dimension d, hi being the upper half of 64 bits. alpha_d = phi^-(d+1) in
// 64-bit fixed point, phi the real root of x^5 = x + 1 (the generalised golden ratio: Roberts, Evenly distributing
// points in a hypersphere's cube). Any number of rays, up to 2^40 and more per source, fills the unit cube evenly.
#include "seeds.cl"

__constant ulong lattice_step[DIMENSIONS] = {0xdb4f0b9175ae2165UL, 0xbbe0563303a4615fUL, 0xa0f2ec75a1fe1576UL,
                                             0x89e182857d9ed689UL};

typedef struct {
    uint shift[DIMENSIONS];
    wordv high[DIMENSIONS], low[DIMENSIONS];   // halves of j alpha_d for the rays j of a vector
} Sampler;

INLINE void sampler_begin(Sampler *sampler, const Launch *launch, uint source) {
    sampler_seeds(launch, source, 0, sampler->shift);
    for (int d = 0; d < DIMENSIONS; ++d)
        for (int j = 0; j < WORD_LANES; ++j) {
            const ulong place = j * lattice_step[d];
            ((uint *)&sampler->high[d])[j] = (uint)(place >> 32);
            ((uint *)&sampler->low[d])[j] = (uint)place;
        }
}

// Carry from a sum of low halves to the high halves.
INLINE wordv carry(wordv sum, uint summand) { return sum < summand ? (wordv)(1) : (wordv)(0); }

// Words of the rays first ... first + BLOCK - 1.
INLINE void sampler_block(const Sampler *sampler, ulong first, Words *words) {
    for (int d = 0; d < DIMENSIONS; ++d) {
        const ulong base = first * lattice_step[d], stride = WORD_LANES * lattice_step[d];
        wordv low = sampler->low[d] + (uint)base;
        wordv high = sampler->high[d] + ((uint)(base >> 32) + sampler->shift[d]) + carry(low, (uint)base);
        for (int v = 0; v < BLOCK / WORD_LANES; ++v) {
            words->of[d][v] = high;
            low += (uint)stride;
            high += (uint)(stride >> 32) + carry(low, (uint)stride);
        }
    }
}
