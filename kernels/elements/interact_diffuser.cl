// A diffuser: scatters on both sides about the specular direction. Light that does not scatter is absorbed.
#include "interaction.cl"

INLINE void interact_diffuser(__constant Element *element, Interaction *at) {
    at->goes = mirrored(at->along, at->normal);
    at->absorbed = (realv)(1);
    at->ends = to_mask(at->event == at->event);
}
