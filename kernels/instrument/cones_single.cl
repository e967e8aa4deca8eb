// Rays leave the screen into the one cone that covers the mirror. Frame: the screen's.
#include "emission.cl"

// A ray that leaves the screen: direction, and its weight.
typedef struct { realv l, m, n, weight; } Leave;

// What chooses the cones of a source's rays: nothing.
INLINE uint cones_begin(const Launch *launch, uint source) { return 0; }

// The weight of every ray of a source.
INLINE real cones_weight(const PathJob *job, const Emitter *own) {
    return own->aim_ll * own->aim_mm * job->inverse_unit_area;
}

INLINE Leave cones_leave(const PathJob *job, __global const Emitter *emitter, uintv radius_word, uintv angle_word,
                         uint first, ulong ray, int v) {
    const Emitter own = *emitter;
    const Direction aim = aim_of(&own, radius_word, angle_word);
    const realv n = -real_sqrt(1 - aim.l * aim.l - aim.m * aim.m);
    return (Leave){aim.l, aim.m, n, (realv)(cones_weight(job, &own))};
}
