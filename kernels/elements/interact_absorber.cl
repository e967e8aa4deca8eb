// An absorber, such as a baffle, a stop or a wall. It is black on both sides.
#include "interaction.cl"

INLINE void interact_absorber(__constant Element *element, Interaction *at) {
    at->absorbed = (realv)(1);
    at->ends = to_mask(at->event == at->event);
}
