// One branch of a ray at an interface, reflected or refracted, is chosen at random. The weight corrects for a
// probability that differs from the reflectance.
#include "interaction.cl"
#include "uniform.cl"

INLINE void roulette(__constant Element *element, Interaction *at, realv reflectance, vec3v refracted) {
    const realv least = element->least_chance;
    // each branch gets at least this probability, unless the reflectance is exactly 0 or 1
    realv probability = reflectance < least ? (realv)(least) : reflectance;
    probability = ((probability > 1 - least) & (reflectance < 1)) ? (realv)(1 - least) : probability;
    probability = reflectance == 0 ? (realv)(0) : probability;
    const maskv reflects = uniform_open(at->draw) < probability;
    const realv pass = probability < 1 ? (1 - reflectance) / (1 - probability) : (realv)(0);
    at->weight = reflects ? reflectance / probability : pass;
    at->goes = blend3(reflects, mirrored(at->along, at->normal), refracted);
    at->event = to_int(reflects) != 0 ? (intv)(EVENT_GHOST) : at->event;
}
