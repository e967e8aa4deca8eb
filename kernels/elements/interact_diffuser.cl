// A wall: an absorber that scatters, on both sides, about the direction of a mirror. What does not scatter is absorbed.
#include "interaction.cl"

INLINE void interact_diffuser(__constant Element *element, Interaction *at) {
    at->goes = mirrored(at->along, at->normal);
    at->absorbed = (realv)(1);
    at->ends = to_mask(at->event == at->event);
}
