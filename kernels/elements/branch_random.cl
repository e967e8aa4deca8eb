// One branch of a ray at an interface is followed.
#include "branch.cl"

INLINE void branch(__constant Element *element, Interaction *at, realv reflectance, vec3v refracted) {
    roulette(element, at, reflectance, refracted);
}
