// A ray at an interface is reflected or refracted by probability; the weight makes up for a probability that is not the reflectance
// itself.
#include "interaction.cl"
#include "uniform.cl"

INLINE void roulette(__constant Element *element, Interaction *at, realv reflectance, vec3v refracted) {
    const realv least = element->least_chance;
    // not of what is wholly one or the other: the weight would be nothing
    realv probability = reflectance < least ? (realv)(least) : reflectance;
    probability = ((probability > 1 - least) & (reflectance < 1)) ? (realv)(1 - least) : probability;
    probability = reflectance == 0 ? (realv)(0) : probability;
    const maskv reflects = uniform_open(at->draw) < probability;
    const realv pass = probability < 1 ? (1 - reflectance) / (1 - probability) : (realv)(0);
    at->weight = reflects ? reflectance / probability : pass;
    at->goes = blend3(reflects, mirrored(at->along, at->normal), refracted);
    at->event = to_int(reflects) != 0 ? (intv)(EVENT_GHOST) : at->event;
}
