// Words of scrambled Sobol points, one at a time: the same words as those of sobol_words_vector.cl.

typedef struct {
    const Launch *launch;
    uint source, run;                               // run: the ray's number / 2^32; each run has its own seeds
    uint leading[DIMENSIONS], trailing[DIMENSIONS]; // seeds
} Sampler;

typedef struct { wordv of[DIMENSIONS]; } Words;

INLINE uintv ray_words(const Words *words, int dimension, int v) { return words->of[dimension]; }

INLINE void sampler_run(Sampler *sampler, uint run) {
    sampler->run = run;
    sampler_seeds(sampler->launch, sampler->source, run, 0, sampler->leading);
    sampler_seeds(sampler->launch, sampler->source, run, 1, sampler->trailing);
}

INLINE void sampler_begin(Sampler *sampler, const Launch *launch, uint source) {
    sampler->launch = launch;
    sampler->source = source;
    sampler_run(sampler, 0);
}

INLINE void sampler_block(Sampler *sampler, ulong first, Words *words) {
    const uint run = (uint)(first >> POINT_BITS);
    if (run != sampler->run) sampler_run(sampler, run);
    for (int d = 0; d < DIMENSIONS; ++d) {
        const uint point = sobol_point(d, (uint)first), leading = point & ((1u << SOBOL_BITS) - 1);
        words->of[d] = sobol_leading(leading, sampler->leading[d]) ^ sobol_trailing(point, sampler->trailing[d]);
    }
}
