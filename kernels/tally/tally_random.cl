// Rays at an interface when one branch is followed: none ends there.
#include "tally.cl"

#define leave_refractor interaction_end
#define leave_coated interaction_end
#define tally_coated tally_refractor

INLINE maskv tally_refractor(const Trace *trace, const Rays *rays, int v, int number, maskv meets,
                             const Interaction *at, realv left) {
    return to_mask(at->event != at->event);
}
