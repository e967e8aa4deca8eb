// Rays leave the screen into several cones that may overlap; the last is the half space. A ray's number decides its cone,
// its weight is 1 / the density of all cones at its direction (irtscots_cl/optics/elements/emission.py). Frame: the
// screen's.
#include "emission.cl"
#include "philox.cl"

typedef struct { realv l, m, n, weight; } Leave;

#define GOLDEN 0x9E3779B9u   // 2^32 over the golden ratio: multiples of it fill the words evenly
#define LEAST_COSINE2 ((real)6e-8)   // rounding takes a direction of the half space's rim beyond it

// The word of a source's first ray: at random, from a counter that neither samplers nor path_rng_*.cl use.
INLINE uint cones_begin(const Launch *launch, uint source) {
    const Philox counter = {{(wordv)(0), (wordv)(0xfffffffeu), (wordv)(source), (wordv)(launch->replicate)}};
    const Philox out = philox4x32_10(counter, launch->seed_low, launch->seed_high);
    return ((const uint *)&out.word[0])[0];
}

// Density of a cone at a direction; sure: the direction is known to be in it.
INLINE realv cone_density(__global const Cone *cone, realv l, realv m, maskv sure) {
    const realv a = (l - cone->centre_l) / cone->aim_ll, b = (m - cone->centre_m - cone->aim_ml * a) / cone->aim_mm;
    return (sure | (a * a + b * b <= 1)) ? (realv)(cone->density) : (realv)(0);
}

// The number of each ray's cone; ray: the number of the block's first ray.
INLINE intv cones_of(const PathJob *job, uint first, ulong ray, int v) {
    const uintv word = first + ((uint)ray + (uint)(v * WIDTH) + lane_index()) * GOLDEN;
    intv cone = (intv)(0);
    for (uint k = 0; k < sizeof(job->cone_from) / sizeof(job->cone_from[0]); ++k)
        cone = word >= job->cone_from[k] ? (intv)(k + 1) : cone;
    return cone;
}

INLINE Leave cones_leave(const PathJob *job, __global const Emitter *emitter, uintv radius_word, uintv angle_word,
                         uint first, ulong ray, int v) {
    const int count = sizeof(emitter->cones) / sizeof(emitter->cones[0]);
    const intv chosen = cones_of(job, first, ray, v);
    realv x, y, l = (realv)(0), m = (realv)(0), density = (realv)(0);
    unit_disk(radius_word, angle_word, &x, &y);
    for (int k = 0; k < count; ++k) {
        __global const Cone *cone = &emitter->cones[k];
        const maskv mine = to_mask(chosen == k);
        l = mine ? cone->centre_l + cone->aim_ll * x : l;
        m = mine ? cone->centre_m + cone->aim_ml * x + cone->aim_mm * y : m;
    }
    for (int k = 0; k < count; ++k) density += cone_density(&emitter->cones[k], l, m, to_mask(chosen == k));
    const realv left = 1 - l * l - m * m;
    const realv n = -real_sqrt(left > LEAST_COSINE2 ? left : (realv)(LEAST_COSINE2));
    return (Leave){l, m, n, job->inverse_unit_area / density};
}
