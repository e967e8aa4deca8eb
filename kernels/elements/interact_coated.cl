// An interface with one coating layer, a quarter of a wavelength thick: its reflectance at that wavelength.
#include "fresnel_*.cl"
#include "branch_*.cl"

INLINE void interact_coated(__constant Element *element, Interaction *at) {
    const Refraction r = refract(element, at);
    Parted parted;
    branch(element, at, coated_share(element, at, &r, &parted), r.beyond);
    parted_leave(at, &parted);
}
