// A mirror: reflects what comes from the front. Its back is black.
#include "interaction.cl"

INLINE void interact_mirror(__constant Element *element, Interaction *at) {
    at->goes = mirrored(at->along, at->normal);
    at->weight = element->reflectance;
    at->ends = dot3(at->along, at->normal) >= 0;
}
