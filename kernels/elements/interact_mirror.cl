// A mirror: reflects light from the front. Its back is black.
#include "carry_*.cl"

INLINE void interact_mirror(__constant Element *element, Interaction *at) {
    at->goes = mirrored(at->along, at->normal);
    at->ends = dot3(at->along, at->normal) >= 0;
    at->weight = at->ends ? (realv)(0) : (realv)(element->reflectance);
    at->absorbed = 1 - at->weight;
    light_mirror(at);
}
