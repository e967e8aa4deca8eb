// The detector: light from the front ends in its pixels (tally.cl records it). Its back is black.
#include "interaction.cl"

INLINE void interact_detector(__constant Element *element, Interaction *at) {
    at->absorbed = dot3(at->along, at->normal) > 0 ? (realv)(0) : (realv)(1);
    at->ends = to_mask(at->event == at->event);
}
