// At an interface, one branch of a ray is followed, chosen at random.
#include "branch.cl"

INLINE void branch(__constant Element *element, Interaction *at, realv reflectance, vec3v refracted) {
    roulette(element, at, reflectance, refracted);
}
