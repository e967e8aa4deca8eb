// Words of scrambled Sobol points for CPUs: the words of the 256 values of the first eight bits are a source's table.
// Within a block those eight bits are a linear function of a ray's place, and the block's first point adds a constant:
// rays take the words of the places exclusive or another place.

// The place within a block, by its bits, of the ray whose first eight bits are one bit: [dimension][bit, reversed].
__constant uchar sobol_place[DIMENSIONS][SOBOL_BITS] = {{0x01, 0x02, 0x04, 0x08, 0x10, 0x20, 0x40, 0x80},
                                                        {0x01, 0x03, 0x05, 0x0f, 0x11, 0x33, 0x55, 0xff},
                                                        {0x01, 0x03, 0x07, 0x09, 0x15, 0x3f, 0x6b, 0xbd},
                                                        {0x01, 0x03, 0x04, 0x0b, 0x1d, 0x2c, 0x45, 0xcf}};

typedef struct {
    const Launch *launch;
    uint source, run;                               // run: the ray's number / 2^32; each run has its own seeds
    wordv seeds;                                    // of the last 24 bits, a lane for each dimension
    wordv base;                                     // point number `number`, not scrambled
    uint number;
    wordv within[DIMENSIONS][BLOCK / WORD_LANES];   // words of the rays 0 ... BLOCK - 1
} Sampler;

typedef struct {
    const Sampler *sampler;
    uint last[DIMENSIONS];                          // scrambled bits that all rays of the block share
    int vector[DIMENSIONS];                         // what the number of a vector is changed by
    intv swap[DIMENSIONS][LANE_BITS];               // whether lanes are changed by 1, 2, 4, ...
} Words;

INLINE uintv ray_words(const Words *words, int dimension, int v) {
    uintv word = ((const uintv *)words->sampler->within[dimension])[v ^ words->vector[dimension]];
    if (dimension > 0) word = swap_lanes(word, words->swap[dimension]);   // the first dimension's places are the rays'
    return word ^ words->last[dimension];
}

INLINE void sampler_run(Sampler *sampler, uint run) {
    uint seeds[DIMENSIONS];
    sampler->run = run;
    sampler_seeds(sampler->launch, sampler->source, run, 0, seeds);
    sampler_seeds(sampler->launch, sampler->source, run, 1, (uint *)&sampler->seeds);
    for (int d = 0; d < DIMENSIONS; ++d) {
        wordv lanes;
        for (int lane = 0; lane < WORD_LANES; ++lane) ((uint *)&lanes)[lane] = sobol_point(d, lane);
        for (int v = 0; v < BLOCK / WORD_LANES; ++v)
            sampler->within[d][v] = sobol_leading(lanes ^ sobol_point(d, (uint)(v * WORD_LANES)), seeds[d]);
    }
}

INLINE void sampler_begin(Sampler *sampler, const Launch *launch, uint source) {
    sampler->launch = launch;
    sampler->source = source;
    sampler->base = sampler->seeds = 0;
    sampler->number = 0;
    sampler_run(sampler, 0);
}

// Words of the rays first ... first + BLOCK - 1; first is a multiple of BLOCK.
INLINE void sampler_block(Sampler *sampler, ulong first, Words *words) {
    const uint run = (uint)(first >> POINT_BITS);
    if (run != sampler->run) sampler_run(sampler, run);
    for (ulong changed = (uint)first ^ sampler->number; changed != 0; changed &= changed - 1)
        for (int d = 0; d < DIMENSIONS; ++d) ((uint *)&sampler->base)[d] ^= sobol_direction[d][lowest_bit(changed)];
    sampler->number = (uint)first;
    words->sampler = sampler;
    const wordv last = sobol_trailing(sampler->base, sampler->seeds);
    for (int d = 0; d < DIMENSIONS; ++d) {
        uint place = 0;
        for (int bit = 0; bit < SOBOL_BITS; ++bit)
            place ^= -(((const uint *)&sampler->base)[d] >> bit & 1) & sobol_place[d][bit];
        words->last[d] = ((const uint *)&last)[d];
        words->vector[d] = place / WIDTH;
        for (int bit = 0; bit < LANE_BITS; ++bit) words->swap[d][bit] = -(intv)(place >> bit & 1);
    }
}
