// An interface between two media: Snell's law, and Fresnel's reflectance of unpolarised light or that of a coating.
// A ray is reflected or refracted by chance; the weight makes up for a chance that is not the reflectance itself.
#include "interaction.cl"
#include "uniform.cl"

// Fresnel's reflectance of unpolarised light; cosines of the angles of incidence and refraction.
INLINE realv fresnel(realv index_in, realv index_out, realv cosine_in, realv cosine_out) {
    const realv s = (index_in * cosine_in - index_out * cosine_out) / (index_in * cosine_in + index_out * cosine_out);
    const realv p = (index_out * cosine_in - index_in * cosine_out) / (index_out * cosine_in + index_in * cosine_out);
    return (s * s + p * p) / 2;
}

// Reflectance of the interface and, for what is not totally reflected, the direction behind it.
INLINE realv refract(__constant Element *element, const Interaction *at, vec3v *refracted) {
    const realv along_normal = dot3(at->along, at->normal);
    const maskv front = along_normal < 0;
    const realv index_in = front ? (realv)(element->index_front) : (realv)(element->index_back);
    const realv index_out = front ? (realv)(element->index_back) : (realv)(element->index_front);
    const realv cosine_in = front ? -along_normal : along_normal;
    const realv ratio = index_in / index_out;
    const realv square = 1 - ratio * ratio * (1 - cosine_in * cosine_in);
    const maskv total = square <= 0;
    const realv cosine_out = real_sqrt(total ? (realv)(0) : square);
    const realv turn = (front ? (realv)(1) : (realv)(-1)) * (ratio * cosine_in - cosine_out);
    *refracted = (vec3v){ratio * at->along.x + turn * at->normal.x, ratio * at->along.y + turn * at->normal.y,
                         ratio * at->along.z + turn * at->normal.z};
    const realv coated = element->reflectance < 0 ? fresnel(index_in, index_out, cosine_in, cosine_out)
                                                  : (realv)(element->reflectance);
    return total ? (realv)(1) : coated;
}

INLINE void interact_refractor(__constant Element *element, Interaction *at) {
    vec3v refracted;
    const realv reflectance = refract(element, at, &refracted);
    const realv least = element->least_chance;
    // not of what is wholly one or the other: the weight would be nothing
    realv chance = reflectance < least ? (realv)(least) : reflectance;
    chance = (chance > 1 - least) & (reflectance < 1) ? (realv)(1 - least) : chance;
    chance = reflectance == 0 ? (realv)(0) : chance;
    const maskv reflects = uniform_open(at->draw) < chance;
    const realv pass = chance < 1 ? (1 - reflectance) / (1 - chance) : (realv)(0);
    at->weight = reflects ? reflectance / chance : pass;
    at->goes = blend3(reflects, mirrored(at->along, at->normal), refracted);
    at->event = to_int(reflects) != 0 ? (intv)(EVENT_GHOST) : at->event;
}
