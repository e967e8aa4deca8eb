// At an interface, both branches of a ray are followed if the weaker one weighs enough and the ray stack has room.
// Otherwise one branch is chosen at random.
#include "branch.cl"

INLINE void branch(__constant Element *element, Interaction *at, realv reflectance, vec3v refracted) {
    const realv weaker = reflectance < (realv)(0.5) ? reflectance : 1 - reflectance;
    const maskv both = (weaker * at->arriving > element->min_weight) & to_mask(at->room > 0);
    roulette(element, at, reflectance, refracted);
    at->split = both ? reflectance : (realv)(0);
    at->weight = both ? 1 - reflectance : at->weight;
    at->goes = blend3(both, refracted, at->goes);
    at->event = to_int(both) != 0 ? (intv)(EVENT_NOMINAL) : at->event;
}
