// An interface between two media, bare or with a given reflectance.
#include "fresnel_*.cl"
#include "branch_*.cl"

INLINE void interact_refractor(__constant Element *element, Interaction *at) {
    const Refraction r = refract(element, at);
    Parted parted;
    branch(element, at, refractor_share(element, at, &r, &parted), r.beyond);
    parted_leave(at, &parted);
}
