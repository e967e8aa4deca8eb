// Rays at an interface when both branches are followed: none ends there, and mirrored rays split off.
#include "split_ray.cl"

#define leave_refractor interaction_end
#define leave_coated interaction_end
#define tally_coated tally_refractor

INLINE maskv tally_refractor(const Trace *trace, const Rays *rays, int v, int number, maskv meets,
                             const Interaction *at, realv left) {
    const vec3v along = to_world(&trace->elements[number], mirrored(at->along, at->normal));
    const realv weight = at->arriving * at->split;
    for (ulong lanes = mask_word(meets & (at->split > 0)); lanes != 0; lanes &= lanes - 1) {
        const int k = lowest_lane(lanes);
        split_ray(trace, rays, v, k, lane_of(along, k), ((const real *)&weight)[k], EVENT_NOMINAL, EVENT_GHOST,
                  light_reflected(&trace->elements[number], at, k));
    }
    return to_mask(at->event != at->event);
}
